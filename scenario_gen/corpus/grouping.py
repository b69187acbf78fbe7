# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Meetings of two vehicles -> encounters of two to twelve, with the rule for logs (`logs.Growth`).

Only meetings that overlap in time influence each other. An instant without a meeting therefore
divides the archive, and the meetings between two of these instants are grouped at a time.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, UTC

from scenario_gen.logs import Growth, LogConfig, Meeting

EPOCH = datetime(2004, 1, 1, tzinfo=UTC)
SHARED_ID_STEP_COUNT = 1 << 40  # added to a shared id for each further vehicle
MEETING_COLUMNS = ("gap", "start", "a", "b", "end")


@dataclass(frozen=True)
class FoundEncounter:
    """An encounter of messages.

    Attributes:
        devices: its vehicles.
        start: µs since 2004.
        end: µs since 2004.
        earliest: start of its first meeting [µs since 2004].
    """

    devices: tuple[int, ...]
    start: int
    end: int
    earliest: int

    @property
    def name(self) -> str:
        """A unique name: the time, and the first three vehicles."""
        time = EPOCH + timedelta(microseconds=self.start)
        vehicles = "_".join(label(device) for device in self.devices[:3])
        return f"{time:%Y%m%dT%H%M%S}{time.microsecond // 100_000}_{vehicles}"


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
        FoundEncounter(
            tuple(sorted(entry.spans)),
            entry.start,
            entry.end,
            min(meeting.start for meeting in entry.meetings),
        )
        for entry in growth.groups(meetings)
    ]
    return sorted(encounters, key=lambda encounter: (encounter.start, encounter.devices))


def grouped(meetings: Iterable[Meeting], config: LogConfig) -> Iterator[FoundEncounter]:
    """Yield the encounters of an archive, sorted by time; the meetings are sorted by start."""
    overlapping: list[Meeting] = []
    until = 0
    for meeting in meetings:
        if meeting.start >= until:
            yield from group(overlapping, config)
            overlapping = []
        overlapping.append(meeting)
        until = max(until, meeting.end)
    yield from group(overlapping, config)
