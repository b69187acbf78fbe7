# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Write an invented archive in the format of the Safety Pilot, whose encounters are known: `mine` has something to find.

    python examples/synthetic_archive.py FOLDER [--seed SEED] [--rows N] [--hours H] [--encounters N] ...

`FOLDER/synthetic.json` tells which vehicles meet, and how. It needs a checkout (test/worlds/archives.py makes the archive) and
`pip install 'scenario_gen[corpus]'`.
"""

import argparse
from dataclasses import fields
from pathlib import Path
import sys

sys.path.append(str(Path(__file__).resolve().parents[1] / "test"))

from support.archives import ArchiveConfig, read_planted, write_archive


def main() -> None:
    """Write the archive that the command line describes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    for one in fields(ArchiveConfig):
        parser.add_argument(
            f"--{one.name.replace('_', '-')}", type=type(one.default), default=one.default
        )
    arguments = vars(parser.parse_args())
    folder, seed = arguments.pop("folder"), arguments.pop("seed")
    try:
        planted = read_planted(write_archive(folder, ArchiveConfig(**arguments), seed))
    except ValueError as error:
        parser.error(str(error))
    inside = sum(one.inside for one in planted)
    print(
        f"{folder}: synthetic, {inside} encounters to find, {len(planted) - inside} just beyond a threshold"
    )


if __name__ == "__main__":
    main()
