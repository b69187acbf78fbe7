# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Groups from meetings of two, for the pieces of a log and for the vehicles of an archive.

A group grows from the strongest remaining meeting that lasts at least `shortest`; its time is that
of the group. A vehicle that meets a member in that time joins, the longest meeting first, if it
meets at least `share` of the members present with it, up to `most` members. The meetings of two
members are then used up, except for their parts outside the group's time.
"""

from collections import defaultdict
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace
import heapq
from typing import Generic, TypeVar

Span = tuple[int, int]

MIN_MET_SHARE = 0.5
"""Share of the members present with a vehicle that it meets at least."""

_EQUAL_GAP_M = 0.1  # smaller differences are noise of the fixes


@dataclass(frozen=True, order=True)
class Meeting:
    """`a` and `b` are near each other from `start` to `end`, in any unit of time.

    A smaller gap [m] means more interaction.
    """

    gap: float
    start: int
    a: int
    b: int
    end: int

    def other(self, member: int) -> int:
        """Return the other one of the two."""
        return self.b if member == self.a else self.a

    @property
    def rank(self) -> tuple[int, int, int, int, int]:
        """Smaller for a stronger meeting: by gap, duration, start and members."""
        return (round(self.gap / _EQUAL_GAP_M), self.start - self.end, self.start, self.a, self.b)


M = TypeVar("M", bound=Meeting)


@dataclass
class Group(Generic[M]):
    """At least two members from `start` to `end`, with their spans, in the order of joining."""

    start: int
    end: int
    spans: dict[int, Span]
    meetings: tuple[M, ...] = ()
    notes: list[str] = field(default_factory=list)

    def overlaps(self, meeting: M) -> bool:
        """Return whether a meeting takes place in the group's time, at least partly."""
        return meeting.start < self.end and meeting.end > self.start

    def common_span(self, meeting: M) -> Span:
        """Return the part of a meeting in the group's time."""
        return max(meeting.start, self.start), min(meeting.end, self.end)


class _Unused(Generic[M]):
    """The meetings that are not used up, by member, and a queue of those that can form groups."""

    def __init__(self, meetings: Iterable[M], shortest: int) -> None:
        self.by_member: dict[int, set[M]] = defaultdict(set)
        self._shortest = shortest
        self._queue: list[tuple[tuple[int, ...], M]] = []
        for meeting in meetings:
            self.add(meeting)

    def add(self, meeting: M) -> None:
        self.by_member[meeting.a].add(meeting)
        self.by_member[meeting.b].add(meeting)
        if meeting.end - meeting.start >= self._shortest:
            heapq.heappush(self._queue, (meeting.rank, meeting))

    def remove(self, meeting: M) -> None:
        self.by_member[meeting.a].discard(meeting)
        self.by_member[meeting.b].discard(meeting)

    def strongest(self) -> M | None:
        """Remove and return the strongest meeting of the queue; None if there is none."""
        while self._queue:
            _, meeting = heapq.heappop(self._queue)
            if meeting in self.by_member[meeting.a]:
                return meeting
        return None

    def within(self, members: Iterable[int]) -> list[M]:
        """Return the meetings of two members."""
        chosen = set(members)
        return [
            meeting
            for member in chosen
            for meeting in self.by_member[member]
            if meeting.a == member and meeting.b in chosen
        ]


@dataclass
class Growth(Generic[M]):
    """Rules of growing groups; a subclass may refine who joins, and when a group begins and ends.

    Attributes:
        shortest: duration of a meeting that can form a group, in the unit of time of the meetings.
        least: duration of the part of a meeting that counts.
        most: number of members.
        share: of the members present with a vehicle that it must meet.
    """

    shortest: int
    least: int
    most: int
    share: float = MIN_MET_SHARE

    def join(self, group: Group[M], other: int, span: Span) -> None:
        """Add a vehicle that meets a member for `span`, if that is long enough."""
        if span[1] - span[0] >= self.least:
            group.spans[other] = span

    def full(self, group: Group[M], others: Iterable[int]) -> None:
        """Note the vehicles that meet a group with `most` members."""

    def finish(self, group: Group[M]) -> None:
        """Adjust a group that has grown."""

    def groups(self, meetings: Iterable[M]) -> list[Group[M]]:
        """Return the groups, the strongest first, with the sorted meetings of their members."""
        unused = _Unused(meetings, self.shortest)
        groups = []
        while (seed := unused.strongest()) is not None:
            group = self._grow(seed, unused.by_member)
            self.finish(group)
            between_members = unused.within(group.spans)
            used = [
                meeting
                for meeting in between_members
                if meeting.start < seed.end and meeting.end > seed.start
            ]
            group.meetings = tuple(sorted(used))
            groups.append(group)
            for meeting in used:
                unused.remove(meeting)
                for rest in self._outside(group, meeting):
                    unused.add(rest)
        return groups

    def _outside(self, group: Group[M], meeting: M) -> list[M]:
        """Return the parts of a meeting before and after a group that are long enough."""
        spans = [
            (meeting.start, min(meeting.end, group.start)),
            (max(meeting.start, group.end), meeting.end),
        ]
        return [
            replace(meeting, start=start, end=end)
            for start, end in spans
            if end - start >= self.least
        ]

    def _grow(self, seed: M, by_member: dict[int, set[M]]) -> Group[M]:
        """Return the group that grows from a meeting."""
        span = (seed.start, seed.end)
        group: Group[M] = Group(*span, {seed.a: span, seed.b: span})
        considered: set[int] = set()
        while near := self._near(group, considered, by_member):
            if len(group.spans) >= self.most:
                self.full(group, near)
                break
            best = min(near, key=lambda other: (*_preference(group, near[other]), other))
            start, end = span = _longest_span(group, near[best])
            n_present = sum(begin < end and start < last for begin, last in group.spans.values())
            n_met = len({meeting.other(best) for meeting in near[best]})
            if n_met >= self.share * n_present:
                self.join(group, best, span)
            considered.add(best)
        return group

    def _near(
        self, group: Group[M], considered: set[int], by_member: dict[int, set[M]]
    ) -> dict[int, list[M]]:
        """Return the vehicles that meet members in the group's time, with their meetings."""
        near: dict[int, list[M]] = defaultdict(list)
        for member in group.spans:
            for meeting in by_member[member]:
                other = meeting.other(member)
                is_new = other not in group.spans and other not in considered
                if is_new and group.overlaps(meeting):
                    near[other].append(meeting)
        return near


def _by_length(span: Span) -> Span:
    """Sort key: by length, then the earlier one."""
    return span[1] - span[0], -span[0]


def _longest_span(group: Group[M], meetings: Iterable[M]) -> Span:
    """Return the longest part of a meeting in a group's time."""
    return max(map(group.common_span, meetings), key=_by_length)


def _preference(group: Group[M], meetings: Collection[M]) -> tuple[int, tuple[int, ...]]:
    """Return the order in which vehicles with some meetings are considered; the least is first."""
    start, end = _longest_span(group, meetings)
    return start - end, min(meeting.rank for meeting in meetings)
