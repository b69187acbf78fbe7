# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Meetings of two vehicles -> encounters of two to twelve, with the rule for logs (`logs.Growth`).

Only meetings that overlap in time influence each other. An instant without a meeting therefore
divides the archive, and each task groups the meetings between two of these instants.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, UTC
from pathlib import Path

import numpy as np

from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.messages import DAY_US, digest_of
from scenario_gen.corpus.tables import write_table
from scenario_gen.logs import Growth, LogConfig
from scenario_gen.logs import Meeting as LogMeeting
from scenario_gen.numerics import Ints

EPOCH = datetime(2004, 1, 1, tzinfo=UTC)
PARTITION_ROWS = 5000  # least number of meetings in a partition
SHARED_ID_STEP_COUNT = 1 << 40  # added to a shared id for each further vehicle
MEETING_COLUMNS = ("gap", "start", "a", "b", "end", "distance", "lat", "lon")
COLUMNS = {
    "name": "string",
    "devices": "int64[]",
    **dict.fromkeys(("start", "end", "earliest"), "int64"),
    **dict.fromkeys(("gap", "distance", "lat", "lon"), "double"),
}


@dataclass(frozen=True, order=True)
class Meeting(LogMeeting):
    """Two vehicles near each other, as in the table; times in µs since 2004."""

    distance: float
    lat: float
    lon: float


@dataclass(frozen=True)
class FoundEncounter:
    """An encounter of messages.

    Attributes:
        devices: its vehicles.
        start: µs since 2004.
        end: µs since 2004.
        meetings: its meetings, the closest first; none if it was read from a table.
    """

    devices: tuple[int, ...]
    start: int
    end: int
    meetings: tuple[Meeting, ...] = ()

    @property
    def name(self) -> str:
        """A unique name: the time, and the first three vehicles."""
        time = EPOCH + timedelta(microseconds=self.start)
        vehicles = "_".join(label(device) for device in self.devices[:3])
        return f"{time:%Y%m%dT%H%M%S}{time.microsecond // 100_000}_{vehicles}"


@dataclass(frozen=True)
class GroupTask:
    """A partition: the meetings from `begin` to before `end` [µs since 2004].

    The meetings are in the tables of the hours with the keys `hours`.
    """

    name: str
    corpus: Path
    hours: tuple[str, ...]
    begin: int
    end: int
    config: CorpusConfig

    @property
    def target(self) -> Path:
        """The table of encounters to write."""
        digest = digest_of(self.hours, self.begin, self.end)
        return self.corpus / "found" / f"part-{self.begin:016}-{digest}.parquet"


def partitions(start: Ints, end: Ints, least: int = 0) -> list[tuple[int, int]]:
    """Return spans of time (begin, end) [µs since 2004] such that each meeting is in one span.

    The end is excluded. Spans begin anew each day, so that further days leave them unchanged.

    Args:
        start: (M,) of the meetings, in any order.
        end: (M,) of the meetings.
        least: meetings in each span but the last; 0: `PARTITION_ROWS`.
    """
    if not len(start):
        return []
    order = np.argsort(start, kind="stable")
    start, until = start[order], np.maximum.accumulate(end[order])
    cuts = np.flatnonzero(start[1:] >= until[:-1]) + 1
    first = [0]
    for cut in cuts.tolist():
        is_new_day = start[cut] // DAY_US > start[first[-1]] // DAY_US
        if is_new_day or cut - first[-1] >= (least or PARTITION_ROWS):
            first.append(cut)
    begins = start[first].tolist()
    return list(zip(begins, [*begins[1:], int(until[-1]) + 1], strict=True))


def label(device: int) -> str:
    """Return the name of a vehicle; vehicles that share an id are numbered."""
    number, shared_id = divmod(device, SHARED_ID_STEP_COUNT)
    return f"{shared_id}x{number}" if number else str(device)


def group(meetings: Sequence[Meeting], config: LogConfig) -> list[FoundEncounter]:
    """Return the encounters, sorted by time."""
    growth = Growth[Meeting](
        round(config.min_duration * 1e6), round(config.min_presence * 1e6), config.max_vehicles
    )
    encounters = [
        FoundEncounter(tuple(sorted(entry.spans)), entry.start, entry.end, entry.meetings)
        for entry in growth.groups(meetings)
    ]
    return sorted(encounters, key=lambda encounter: (encounter.start, encounter.devices))


def group_partition(task: GroupTask) -> None:
    """Write the table of a partition's encounters, sorted by time.

    The column `earliest` is the start of the first meeting of an encounter.
    """
    from pyarrow import parquet

    filters = [("start", ">=", task.begin), ("start", "<", task.end)]
    meetings = []
    for hour in task.hours:
        path = task.corpus / "hours" / f"hour-{hour}.parquet"
        table = parquet.read_table(path, columns=list(MEETING_COLUMNS), filters=filters)
        meetings += [Meeting(**row) for row in table.to_pylist()]
    rows = []
    for encounter in group(meetings, task.config.log):
        closest = encounter.meetings[0]
        row = {
            "name": encounter.name,
            "devices": list(encounter.devices),
            "start": encounter.start,
            "end": encounter.end,
            "gap": closest.gap,
            "distance": min(meeting.distance for meeting in encounter.meetings),
            "lat": closest.lat,
            "lon": closest.lon,
            "earliest": min(meeting.start for meeting in encounter.meetings),
        }
        rows.append(row)
    write_table(task.target, rows, COLUMNS)


def read_found(table: Path, first: int, last: int) -> list[FoundEncounter]:
    """Return the encounters in rows `first` to before `last` of a table, without meetings."""
    from pyarrow import parquet

    columns = parquet.read_table(table, columns=["devices", "start", "end"])
    rows = columns.slice(first, last - first).to_pylist()
    return [FoundEncounter(tuple(row["devices"]), row["start"], row["end"]) for row in rows]
