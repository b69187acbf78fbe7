# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Who is joined to whom: meetings of two vehicles -> encounters of two to twelve, by the rule of every log (`logs.growing`).

Only meetings that overlap in time influence each other. An instant that no meeting spans therefore divides the archive, and each
task groups the meetings between two such instants.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, UTC
from pathlib import Path

import numpy as np

from scenario_gen.base.stores import fetched, Place
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.tables import write_table
from scenario_gen.logs import Growth, LogConfig
from scenario_gen.logs import Meeting as Met
from scenario_gen.numerics import Ints

START = datetime(2004, 1, 1, tzinfo=UTC)
PARTITION = 5000  # meetings that one task groups, at least
COLUMNS = {
    "name": "string",
    "devices": "int64[]",
    **dict.fromkeys(("start", "end", "earliest"), "int64"),
    **dict.fromkeys(("gap", "distance", "lat", "lon"), "double"),
}


@dataclass(frozen=True, order=True)
class Meeting(Met):
    """Two vehicles near each other, times in µs since 2004, with what the table says of them."""

    distance: float
    lat: float
    lon: float


@dataclass(frozen=True)
class Found:
    """An encounter in the table: its vehicles, its time [µs since 2004], and the meetings it is made of, strongest first.

    What is read from a table has no meetings.
    """

    devices: tuple[int, ...]
    start: int
    end: int
    meetings: tuple[Meeting, ...] = ()

    @property
    def name(self) -> str:
        """A name that no other encounter of the archive has: when, and who."""
        when = START + timedelta(microseconds=self.start)
        return f"{when:%Y%m%dT%H%M%S}{when.microsecond // 100_000}_{'_'.join(label(device) for device in self.devices[:3])}"


@dataclass(frozen=True)
class GroupTask:
    """A partition: the meetings from `begin` to before `end` [µs since 2004], which lie in the tables of `hours`."""

    name: str
    corpus: Place
    number: int
    hours: tuple[int, ...]
    begin: int
    end: int
    config: CorpusConfig

    @property
    def target(self) -> Place:
        """The table of encounters to write."""
        return part_of(self.corpus, self.number)


def part_of(corpus: Place, number: int) -> Place:
    """Return the table of a partition's encounters."""
    return corpus / "found" / f"part-{number:06}.parquet"


def partitions(start: Ints, end: Ints, least: int = 0) -> list[tuple[int, int]]:
    """Return spans of time, in order, that no meeting crosses: (begin, end) [µs since 2004], the end excluded.

    Args:
        start: (M,) of the meetings, in any order.
        end: (M,)
        least: meetings in each span but the last; 0: `PARTITION`.
    """
    if not len(start):
        return []
    order = np.argsort(start, kind="stable")
    start, until = start[order], np.maximum.accumulate(end[order])
    free = np.flatnonzero(start[1:] >= until[:-1]) + 1
    first = [0]
    while (k := int(np.searchsorted(free, first[-1] + (least or PARTITION)))) < len(free):
        first.append(int(free[k]))
    begins = start[first].tolist()
    return list(zip(begins, [*begins[1:], int(until[-1]) + 1], strict=True))


def label(device: int) -> str:
    """Return a vehicle's name: of one whose id others bear too, with the number that tells it from them."""
    return str(device) if device < 1 << 40 else f"{device & ((1 << 40) - 1)}x{device >> 40}"


def group(meetings: Sequence[Meeting], config: LogConfig) -> list[Found]:
    """Return the encounters, in order of time."""
    growth = Growth[Meeting](
        round(config.min_duration * 1e6), round(config.min_presence * 1e6), config.max_vehicles
    )
    found = [
        Found(tuple(sorted(one.spans)), one.start, one.end, one.meetings)
        for one in growth.groups(meetings)
    ]
    return sorted(found, key=lambda one: (one.start, one.devices))


def group_partition(task: GroupTask) -> None:
    """Write the table of a partition's encounters, in order of time; `earliest` is the start of the first of its meetings."""
    from pyarrow import parquet

    names = ("gap", "start", "a", "b", "end", "distance", "lat", "lon")
    inside = [("start", ">=", task.begin), ("start", "<", task.end)]
    with fetched([task.corpus / "hours" / f"hour-{hour}.parquet" for hour in task.hours]) as here:
        tables = [
            parquet.read_table(path, columns=list(names), filters=inside).to_pylist()
            for path in here
        ]
    rows = [
        {
            "name": one.name, "devices": list(one.devices), "start": one.start, "end": one.end,
            "gap": one.meetings[0].gap, "distance": min(meeting.distance for meeting in one.meetings),
            "lat": one.meetings[0].lat, "lon": one.meetings[0].lon, "earliest": min(meeting.start for meeting in one.meetings),
        }
        for one in group([Meeting(*(row[name] for name in names)) for table in tables for row in table], task.config.log)
    ]  # fmt: skip
    write_table(task.target, rows, COLUMNS)


def read_found(table: Path, first: int, last: int) -> list[Found]:
    """Return the encounters in rows `first` to before `last` of a table, without their meetings."""
    from pyarrow import parquet

    rows = (
        parquet.read_table(table, columns=["devices", "start", "end"])
        .slice(first, last - first)
        .to_pylist()
    )
    return [Found(tuple(row["devices"]), row["start"], row["end"]) for row in rows]
