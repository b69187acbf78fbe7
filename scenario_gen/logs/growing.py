# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Who is joined to whom: meetings of two -> groups, for the pieces of a log and for the vehicles of an archive alike.

A group grows from the strongest meeting that is left, one of at least `shortest`; its time is the group's. Who meets a member
in that time joins, the longest first, if it meets at least `share` of the members that it is together with, up to `most`
members. Meetings of two members are then used up, but for what of them lies outside the group's time, and the next group grows.
"""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
import heapq
from typing import Generic, TypeVar

Span = tuple[int, int]
SHARED = 0.5  # least share of the members together with a vehicle that it interacts with
EQUAL_M = 0.1  # gaps that round to the same multiple are equal, whatever the noise of the fixes


@dataclass(frozen=True, order=True)
class Meeting:
    """`a` and `b` are near each other from `start` to `end`, in any unit of time; a smaller gap [m] interacts more."""

    gap: float
    start: int
    a: int
    b: int
    end: int

    def other(self, one: int) -> int:
        """Return the one of the two that is not this one."""
        return self.b if one == self.a else self.a

    @property
    def rank(self) -> tuple[int, int, int, int, int]:
        """Smaller for a stronger meeting: the gap, then how long it lasts, then when and who."""
        return (round(self.gap / EQUAL_M), self.start - self.end, self.start, self.a, self.b)


M = TypeVar("M", bound=Meeting)


@dataclass
class Group(Generic[M]):
    """A group of at least two from `start` to `end`: when each member is there, in the order in which they joined."""

    start: int
    end: int
    spans: dict[int, Span]
    meetings: tuple[M, ...] = ()
    notes: list[str] = field(default_factory=list)


@dataclass
class Growth(Generic[M]):
    """How groups grow; a subclass may look closer at who joins, and when a group begins and ends.

    Attributes:
        shortest: of a meeting from which a group grows, in the meetings' unit of time.
        least: of the part of a meeting that counts.
        most: members of a group.
        share: of the members together with one who joins that it meets.
    """

    shortest: int
    least: int
    most: int
    share: float = SHARED

    def join(self, group: Group[M], other: int, span: Span) -> None:
        """Let `other`, who meets a member for `span`, join, if it does so for long enough."""
        if span[1] - span[0] >= self.least:
            group.spans[other] = span

    def full(self, group: Group[M], others: Iterable[int]) -> None:
        """Take note of those who meet a group that has `most` members."""

    def finish(self, group: Group[M]) -> None:
        """Settle a group that has grown."""

    def groups(self, meetings: Iterable[M]) -> list[Group[M]]:
        """Return the groups, the strongest first; the meetings of each are those of its members in its time, sorted."""
        left: dict[int, set[M]] = defaultdict(set)
        queue: list[tuple[tuple[int, ...], M]] = []

        def put(one: M) -> None:
            left[one.a].add(one)
            left[one.b].add(one)
            if one.end - one.start >= self.shortest:
                heapq.heappush(queue, (one.rank, one))

        for one in meetings:
            put(one)
        found = []
        while queue:
            _, seed = heapq.heappop(queue)
            if seed not in left[seed.a]:
                continue
            group = self._grow(seed, left)
            start, end = seed.start, seed.end
            self.finish(group)
            both = [
                one for a in group.spans for one in left[a] if one.a == a and one.b in group.spans
            ]
            inside = [one for one in both if one.start < end and one.end > start]
            group.meetings = tuple(sorted(inside))
            found.append(group)
            for one in inside:
                left[one.a].discard(one)
                left[one.b].discard(one)
                for first, last in (
                    (one.start, min(one.end, group.start)),
                    (max(one.start, group.end), one.end),
                ):
                    if last - first >= self.least:
                        put(replace(one, start=first, end=last))
        return found

    def _grow(self, seed: M, left: dict[int, set[M]]) -> Group[M]:
        """Return the group that a meeting makes."""
        group: Group[M] = Group(
            seed.start, seed.end, dict.fromkeys((seed.a, seed.b), (seed.start, seed.end))
        )
        refused: set[int] = set()
        while near := self._near(group, refused, left):
            spans = {
                other: max((_inside(one, group) for one in ones), key=_length_first)
                for other, ones in near.items()
            }
            if len(group.spans) >= self.most:
                self.full(group, near)
                break
            best = min(
                near,
                key=lambda other: (
                    -_length_first(spans[other])[0],
                    min(one.rank for one in near[other]),
                    other,
                ),
            )
            first, last = spans[best]
            together = sum(begin < last and first < end for begin, end in group.spans.values())
            if len({one.other(best) for one in near[best]}) >= self.share * together:
                self.join(group, best, spans[best])
            refused.add(best)
        return group

    def _near(
        self, group: Group[M], refused: set[int], left: dict[int, set[M]]
    ) -> dict[int, list[M]]:
        """Those who meet members in the group's time, with their meetings."""
        near: dict[int, list[M]] = defaultdict(list)
        for member in group.spans:
            for one in left[member]:
                other = one.other(member)
                if (
                    other not in group.spans
                    and other not in refused
                    and one.start < group.end
                    and one.end > group.start
                ):
                    near[other].append(one)
        return near


def _inside(one: Meeting, group: Group[M]) -> Span:
    return max(one.start, group.start), min(one.end, group.end)


def _length_first(span: Span) -> Span:
    """Sort key: the longer, then the earlier."""
    return span[1] - span[0], -span[0]
