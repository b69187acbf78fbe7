# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Write the locks that `make` installs, with uv: python test/packaging/locks.py, then `make licences`.

Existing pins stay, and one version serves all Pythons wherever wheels allow it. The requirements
come from pyproject.toml and, for packages that build, test or judge, from requirements/*.in. Each
lock has only the packages that the locks installed before it lack.
"""

from dataclasses import dataclass
from pathlib import Path
import re
import subprocess
import tempfile

from licences import extras, REQUIREMENTS


@dataclass(frozen=True)
class Lock:
    """A lock of the project's environment: the extras that it installs, and the locks before it."""

    extras: tuple[str, ...] = ()
    before: tuple[str, ...] = ()


LOCKS = {
    "core": Lock(("core",)),
    "run": Lock(("bags", "report", "cli"), ("core",)),
    # A sourced Jazzy may replace these wheels, so no other lock builds on them.
    "ros": Lock(("ros",), ("core", "run")),
    "extras": Lock(
        ("parquet", "plot", "planners", "gym", "corpus"),
        ("core", "run"),
    ),
    "test": Lock((), ("core", "run", "extras")),
    "ros-test": Lock((), ("core", "run", "ros", "extras", "test")),
    "bench": Lock((), ("core", "run", "extras", "test")),
}
OPTIONS = [
    "--quiet",
    "--universal",
    "--python-version",
    "3.11",
    "--fork-strategy",
    "fewest",
    "--generate-hashes",
    "--no-header",
    "--no-annotate",
]


def pins(text: str) -> dict[str, str]:
    """Return the pins of a lock with their hashes, by their first lines."""
    blocks = re.split(r"^(?=\w)", text, flags=re.MULTILINE)
    return {block.partition("\n")[0]: block for block in blocks if "==" in block}


def requirements(name: str) -> str:
    """Return the requirements of one lock, a line each."""
    known = extras()
    lines = [str(wanted) for extra in LOCKS.get(name, Lock()).extras for wanted in known[extra]]
    file = REQUIREMENTS / f"{name}.in"
    if file.exists():
        lines += file.read_text(encoding="utf-8").splitlines()
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write all locks."""
    names = dict.fromkeys([*LOCKS, *sorted(path.stem for path in REQUIREMENTS.glob("*.in"))])
    resolved: dict[str, dict[str, str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "resolved.lock"
        wanted = Path(folder) / "wanted.in"
        for name in names:
            before = LOCKS.get(name, Lock()).before
            lock = REQUIREMENTS / f"{name}.lock"

            known: dict[str, str] = {}
            for each in before:
                known |= resolved[each]
            known |= pins(lock.read_text(encoding="utf-8"))
            output.write_text("".join(known.values()), encoding="utf-8")
            wanted.write_text("".join(map(requirements, (*before, name))), encoding="utf-8")

            command = ["uv", "pip", "compile", *OPTIONS, str(wanted), "--output-file", str(output)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            resolved[name] = pins(output.read_text(encoding="utf-8"))
            new = [
                block
                for first, block in resolved[name].items()
                if not any(first in resolved[each] for each in before)
            ]
            lock.write_text("".join(new), encoding="utf-8")


if __name__ == "__main__":
    main()
