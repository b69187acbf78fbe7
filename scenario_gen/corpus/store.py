# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The files of a batch: which tables it has, which parts they contain, and which are finished.

    templates/templates-00000.parquet                    encounters, with the columns of a corpus
    scenarios/road=NAME/part-00000.parquet               a row per scenario: its criticality
    trajectories/kind=KIND/road=NAME/part-00000.parquet  a row per vehicle of a scenario
    bags/road=NAME/part-00000/                           a bag, where bags were requested
    cases/road=NAME/part-00000.parquet                   a row per set: counts, causes of refusals

The table of cases is written last, so a part is finished if that table exists. There is no other
record of progress. `compact` merges parts to `parts-FIRST-LAST.parquet`, and then removes them.
"""

from collections import defaultdict
import json
from pathlib import Path
import re

from scenario_gen.base.folders import write_text
from scenario_gen.corpus.tasks import arriving

MANIFEST = "batch.json"
FOLDERS = ("cases", "scenarios", "trajectories")
PART = re.compile(r"parts?-([0-9]{1,9})(?:-([0-9]{1,9}))?\.parquet")

Tables = dict[Path, range]
"""Tables and the numbers of their parts."""


def parts_of(folder: Path) -> dict[str, Tables]:
    """Return the tables in each partition of a folder, sorted by part.

    The first ones contain what others repeat: `compact` was stopped before it removed those.
    """
    partitions: dict[str, Tables] = defaultdict(dict)
    for table in folder.rglob("*.parquet"):
        if match := PART.fullmatch(table.name):
            first, last = match[1], match[2] or match[1]
            partition = table.parent.relative_to(folder).as_posix()
            partitions[partition][table] = range(int(first), int(last) + 1)
    return {
        partition: dict(sorted(tables.items(), key=lambda item: (item[1].start, -item[1].stop)))
        for partition, tables in sorted(partitions.items())
    }


def without_repeated(tables: Tables) -> Tables:
    """Return the tables that no other one contains."""
    stop, unique = 0, {}
    for table, numbers in tables.items():
        if numbers.stop > stop:
            stop, unique[table] = numbers.stop, numbers
    return unique


def finished_parts(out: Path) -> dict[str, set[int]]:
    """Return the numbers of the finished parts in each partition (`road=NAME`)."""
    return {
        road: {number for numbers in tables.values() for number in numbers}
        for road, tables in parts_of(out / "cases").items()
    }


def finished_tables(out: Path, folder: str) -> list[Path]:
    """Return the tables of finished parts, sorted; each part is in one of them."""
    finished = finished_parts(out)
    return [
        table
        for partition, tables in parts_of(out / folder).items()
        for table, numbers in without_repeated(tables).items()
        if finished.get(partition.rpartition("/")[2], set()).issuperset(numbers)
    ]


def write_json(path: Path, document: object) -> None:
    """Write a document atomically, in place of an earlier one."""
    with arriving(path) as part:
        write_text(part, json.dumps(document, indent=1) + "\n")
