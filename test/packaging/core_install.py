# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`make core`: the wheel and the core's locked packages, alone in an environment of their own, segment and generate.

And the wheel with the locked packages of the extra `segmentation`, and nothing else, fits the estimator.
"""

from collections.abc import Sequence
import json
import os
from pathlib import Path
import re
import subprocess
import sys
import tempfile

from licences import extras, installed, needed_at_run_time, REQUIREMENTS, ROOT
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from test_library_alone import EXTRA_MODULES, write_csv

PIP = ("-m", "pip", "--quiet", "--disable-pip-version-check")
SEGMENTATION = ("numpy", "scipy", "numba", "filelock", "threadpoolctl")


def lock_of(wanted: Sequence[Requirement]) -> str:
    """Return the part of core.lock that is needed, hashes included."""
    needed = needed_at_run_time(installed(), wanted)
    blocks = re.split(
        r"^(?=\w)", (REQUIREMENTS / "core.lock").read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    return "".join(
        block for block in blocks if canonicalize_name(re.split(r"[=\s]", block)[0]) in needed
    )


def environment(folder: Path, wheel: Path, wanted: Sequence[Requirement]) -> Path:
    """Make an environment of what is wanted and of the wheel; return its Python."""
    folder.mkdir()
    (folder / "lock").write_text(lock_of(wanted), encoding="utf-8")
    run(sys.executable, "-m", "venv", folder / "env")
    python = folder / "env" / "bin" / "python"
    run(python, *PIP, "install", "--require-hashes", "-r", folder / "lock")
    run(python, *PIP, "install", "--no-deps", wheel)
    return python


def main() -> None:
    """Build, install, run, and say what was seen."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["SOURCE_DATE_EPOCH"] = "1700000000"
        build = [sys.executable, *PIP, "wheel", "--no-deps", "--no-build-isolation", ROOT]
        for place in ("first", "again"):
            run(*build, "--wheel-dir", folder / place)
        wheel, again = sorted(folder.glob("*/*.whl"), reverse=True)
        assert wheel.read_bytes() == again.read_bytes(), "the wheel is not reproducible"
        core = extras()["core"]
        alone = environment(
            folder / "segmentation", wheel, [one for one in core if one.name in SEGMENTATION]
        )
        fitted = json.loads(run(alone, ROOT / "test" / "packaging" / "segmentation_use.py"))
        few = run(alone, "-m", "pip", "freeze").split()
        python = environment(folder / "core", wheel, core)
        run(python, *PIP, "check")
        told = json.loads(
            run(python, ROOT / "test" / "packaging" / "core_use.py", write_csv(folder / "log.csv"))
        )
        packages = run(python, "-m", "pip", "freeze").split()
    assert fitted["states"] == 2 and not set(fitted["loaded"]) - {
        *SEGMENTATION,
        "llvmlite",
        "scenario_gen",
    }, fitted
    print(
        f"{len(few)} packages: {', '.join(few)}: two states found; imported in {fitted['seconds']:.2f} s"
    )
    assert (
        told["scenarios"] == 4 and told["same"] and not set(told["loaded"]) & set(EXTRA_MODULES)
    ), told
    print(f"{len(packages)} packages: {', '.join(packages)}")
    print(f"{told['scenarios']} scenarios from {len(told['changepoints'])} changepoints")


def run(*command: str | Path) -> str:
    """Run a command, away from the sources; return what it printed."""
    return subprocess.run(
        command, check=True, stdout=subprocess.PIPE, text=True, cwd=tempfile.gettempdir()
    ).stdout


if __name__ == "__main__":
    main()
