# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Long tests, by part: `make soak`, `make soak PART=fuzz`. A part that was stopped goes on where it was.

Each part is a module here with `run(state: Path) -> Iterable[Figure]`; `state` is a folder of its own that it may keep
progress in, and that is emptied by `--fresh`. The last figures of all parts are printed as one table.
"""

import argparse
from dataclasses import asdict
import importlib
import json
from pathlib import Path
import shutil
import sys
import time

from figures import Figure, ROOT
from rich.console import Console
from rich.table import Table

PARTS = (
    "cpu",
    "fuzz",
    "libraries",
    "long",
    "mutations",
    "oracle",
    "properties",
    "recorded",
    "speed",
    "tests",
)
OUT = Path("out/soak")


def run_part(part: str) -> list[Figure]:
    """Run one part and keep its figures."""
    state = OUT / part
    state.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    figures = list(importlib.import_module(part).run(state))
    record = {
        "seconds": round(time.monotonic() - started, 1),
        "figures": [asdict(figure) for figure in figures],
    }
    (OUT / f"{part}.json").write_text(json.dumps(record, indent=2) + "\n")
    return figures


def show() -> bool:
    """Print the last figures of every part that has been run; return whether all were met."""
    table = Table("part", "promise", "asked", "seen", "met")
    met = True
    for part in PARTS:
        path = OUT / f"{part}.json"
        for row in json.loads(path.read_text())["figures"] if path.exists() else ():
            table.add_row(
                part, row["promise"], row["asked"], row["seen"], "yes" if row["met"] else "NO"
            )
            met = met and row["met"]
    Console(width=160 if not sys.stdout.isatty() else None).print(table)
    return met


def main() -> int:
    """Run the parts that are named, or all, and print one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS])
    parser.add_argument(
        "--fresh",
        action="store_true",
        help="begin again instead of going on where a part was stopped",
    )
    arguments = parser.parse_args()
    sys.path += [str(ROOT / "test"), str(ROOT / "test" / "packaging")]
    for part in arguments.parts or PARTS:
        if arguments.fresh:
            shutil.rmtree(OUT / part, ignore_errors=True)
        run_part(part)
    return 0 if show() else 1


if __name__ == "__main__":
    sys.exit(main())
