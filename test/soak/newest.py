# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The short tests on the newest releases that the bounds in pyproject.toml allow, in an environment of its own."""

from collections.abc import Iterator
import os
from pathlib import Path
import re
import subprocess
import sys

from figures import Figure, ROOT

LISTS = ("run", "extras", "test", "ros-test")
SHOWN = ("numpy", "scipy", "numba", "rosbags", "mcap", "pandas", "shapely", "pyproj")
PYTEST = ("-n", "2", "--dist", "loadgroup", "--max-worker-restart", "0", "--timeout", "600")


def install(python: Path) -> None:
    """Make the environment, or bring it up to date."""
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", python.parents[1]], check=True)
    pip = [python, "-m", "pip", "install", "--quiet", "--upgrade", "--upgrade-strategy", "eager"]
    subprocess.run(
        [
            *pip,
            *(word for name in LISTS for word in ("-r", ROOT / "requirements" / f"{name}.in")),
            f"{ROOT}[ros]",
        ],
        check=True,
    )
    subprocess.run(
        [
            python,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--no-deps",
            "--no-build-isolation",
            "-e",
            ROOT,
        ],
        check=True,
    )


def run(state: Path) -> Iterator[Figure]:
    """Install, and run all tests once; what they said is in `state`."""
    python = (state / "venv" / "bin" / "python").absolute()
    install(python)
    listing = [python, "-m", "pip", "list", "--format", "freeze"]
    frozen = subprocess.run(listing, check=True, stdout=subprocess.PIPE, text=True).stdout
    versions = dict(line.split("==") for line in frozen.splitlines() if "==" in line)
    with (state / "tests.log").open("w") as log:
        words = [
            python,
            "-m",
            "pytest",
            *PYTEST,
            "--deselect",
            "test/packaging/test_supply_chain.py",
        ]
        environment = os.environ | {"PATH": f"{python.parent}{os.pathsep}{os.environ['PATH']}"}
        code = subprocess.run(
            words, cwd=ROOT, env=environment, stdout=log, stderr=log, check=False
        ).returncode
    said = (state / "tests.log").read_text()
    summary = re.findall(r"^.*\d+ passed.*$", said, re.MULTILINE)
    seen = (
        ", ".join(f"{name} {versions[name]}" for name in SHOWN)
        + f": {summary[-1] if summary else f'see {state}/tests.log'}"
    )
    yield Figure("all tests pass on the newest releases", "green", seen, code == 0)
