# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Write the locks that `make` installs, with uv, onto those that are there, whose pins stay: python test/packaging/locks.py.

One version for all Pythons wherever wheels allow it.

Each lock holds what its list asks for beyond the locks that are installed before it. Then `make licences`.
"""

from itertools import chain
from pathlib import Path
import re
import subprocess
import tempfile

from licences import REQUIREMENTS

BEFORE = {  # what is installed before each; ROS's wheels may come from a sourced Jazzy instead
    "core": (),
    "run": ("core",),
    "ros": ("core", "run"),
    "extras": ("core", "run"),
    "test": ("core", "run", "extras"),
    "ros-test": ("core", "run", "ros", "extras", "test"),
    "bench": ("core", "run", "extras", "test"),
}  # the others are installed into environments of their own
OPTIONS = [
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
    return {
        block.partition("\n")[0]: block
        for block in re.split(r"^(?=\w)", text, flags=re.MULTILINE)
        if "==" in block
    }


def main() -> None:
    """Write all of them."""
    whole: dict[str, dict[str, str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "whole.lock"
        for name in dict.fromkeys(
            [*BEFORE, *sorted(path.stem for path in REQUIREMENTS.glob("*.in"))]
        ):
            before, lock = BEFORE.get(name, ()), REQUIREMENTS / f"{name}.lock"
            known = dict.fromkeys(
                chain(
                    *(whole[each].values() for each in before),
                    pins(lock.read_text(encoding="utf-8")).values(),
                )
            )
            out.write_text("".join(known), encoding="utf-8")
            lists = [str(REQUIREMENTS / f"{each}.in") for each in (*before, name)]
            command = [
                "uv",
                "pip",
                "compile",
                "--quiet",
                *OPTIONS,
                *lists,
                "--output-file",
                str(out),
            ]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            whole[name] = pins(out.read_text(encoding="utf-8"))
            new = [
                block
                for first, block in whole[name].items()
                if not any(first in whole[each] for each in before)
            ]
            lock.write_text("".join(new), encoding="utf-8")


if __name__ == "__main__":
    main()
