# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Groups of vehicles that meet, and the time that each is there.

Two pieces *meet* while they are nearer than `proximity`, for at least `min_presence` seconds; a meeting longer than
`max_duration` is cut. Groups grow from meetings of `min_duration` or more (`growing`), up to `max_vehicles`. Each member is there
for the time in which it is recorded and near another, so it may arrive late and leave early.
In a small log (of at most `max_vehicles`, as cut by a person) every meeting counts, and a vehicle joins that meets any member. In
a larger one only those count in which a vehicle moves and the two interact (`gap`: they cross, follow, merge or pass), and a
vehicle joins that so meets at least half of the members that it is together with.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.encounters import Piece
from scenario_gen.logs.gap import INTERACTS_M, space_time_gap
from scenario_gen.logs.growing import Group, Growth, Meeting, SHARED, Span
from scenario_gen.logs.raw import natural
from scenario_gen.numerics import Floats, runs

MIN_SHARE = 0.6  # with `whole`, a vehicle that is there for less of the time is left out; for more, it shortens the time
EDGE_S = 1.0  # s by which a group is shortened so that no vehicle joins late or leaves early
OUT_OF_RANGE_S = 1.0  # s that a pair may be out of range within one meeting
REST_S = 2.0  # s of a long standstill that belong to the encounter before or after it


class _OfPieces(Growth[Meeting]):
    """Groups of the pieces of a log, in ticks; their notes name the vehicles that meet one and are left out, and why."""

    def __init__(self, pieces: Sequence[Piece], config: LogConfig, *, small: bool) -> None:
        super().__init__(
            ticks(config.min_duration, config) + 1,
            shortest(config),
            config.max_vehicles,
            share=0.0 if small else SHARED,
        )
        self.pieces, self.config = pieces, config

    def strangers(self, group: Group[Meeting], others: Iterable[int]) -> list[int]:
        """Those of some pieces whose vehicle is not in the group with another piece."""
        ids = {self.pieces[m].track.id for m in group.spans}
        return [other for other in others if self.pieces[other].track.id not in ids]

    def full(self, group: Group[Meeting], others: Iterable[int]) -> None:
        """Name those that are left out."""
        if left := sorted(
            {self.pieces[other].track.id for other in self.strangers(group, others)}
        ):
            group.notes.append(
                f"left out of an encounter of {len(group.spans)} vehicles (max_vehicles): {', '.join(left)}"
            )

    def join(self, group: Group[Meeting], other: int, span: Span) -> None:
        """Add a vehicle for the time in which it is near any member, or note why not."""
        if not self.strangers(group, [other]):
            return
        config, name = self.config, self.pieces[other].track.id
        begin, end = span = self.common_span(other, group)
        lasts = group.end - group.start
        near = f"near for {seconds(begin, end, config)} of {seconds(group.start, group.end, config)} s"
        if not config.whole:
            if end - begin > ticks(config.min_presence, config):
                group.spans[other] = span
            elif end > begin:
                group.notes.append(f"vehicle {name} is left out: {near} (min_presence)")
            return
        if (end - begin) < MIN_SHARE * lasts or end - begin < self.shortest:
            if end > begin:
                group.notes.append(f"vehicle {name} is left out: {near} (whole)")
            return
        if end - begin < lasts:
            group.notes.append(
                f"vehicle {name} shortens its encounter to {seconds(begin, end, config)} of "
                f"{seconds(group.start, group.end, config)} s"
            )
        group.start, group.end = span
        group.spans = dict.fromkeys((*group.spans, other), span)

    def finish(self, group: Group[Meeting]) -> None:
        """Shorten a group by up to `EDGE` so that its vehicles come and go together; note those that do not."""
        config = self.config
        edge = ticks(EDGE_S, config)
        first = max(begin for begin, _ in group.spans.values() if begin <= group.start + edge)
        last = min(end for _, end in group.spans.values() if end >= group.end - edge)
        if last - first > ticks(config.min_duration, config):
            group.start, group.end = first, last
            group.spans = {
                m: (max(begin, first), min(end, last)) for m, (begin, end) in group.spans.items()
            }
        for m, (begin, end) in group.spans.items():
            if (begin, end) != (group.start, group.end):
                group.notes.append(
                    f"vehicle {self.pieces[m].track.id} is recorded from {seconds(group.start, begin + 1, config)} to "
                    f"{seconds(group.start, end, config)} s of {seconds(group.start, group.end, config)} s"
                )

    def common_span(self, other: int, group: Group[Meeting]) -> Span:
        """Return the longest stretch of a group's time in which piece `other` is near a member that is there."""
        piece = self.pieces[other]
        flags = np.zeros(group.end - group.start, dtype=bool)
        for member, (first, last) in group.spans.items():
            begin = max(piece.first, self.pieces[member].first)
            close = distances(piece, self.pieces[member]) < self.config.proximity
            low, high = max(begin, first), min(begin + len(close), last)
            if high > low:
                flags[low - group.start : high - group.start] |= close[low - begin : high - begin]
        spans = runs(flags, ticks(OUT_OF_RANGE_S, self.config))
        begin, end = max(spans, key=lambda span: span[1] - span[0], default=(0, 0))
        return group.start + begin, group.start + end


def find_groups(
    pieces: Sequence[Piece], config: LogConfig
) -> tuple[tuple[Group[Meeting], ...], tuple[str, ...]]:
    """Return the encounters in order of time, and notes on vehicles that were left out or shortened one."""
    small = len({piece.track.id for piece in pieces}) <= config.max_vehicles
    groups, notes = [], []
    for group in _OfPieces(pieces, config, small=small).groups(
        find_meetings(pieces, config, small=small)
    ):
        whole, left = split(group, pieces, config)
        groups += whole
        notes += [*group.notes, *left] if whole else []
    groups.sort(key=lambda group: (group.start, group.end, sorted(group.spans)))
    shared, until = set[str](), dict[int, int]()
    for group in groups:
        shared |= {
            pieces[m].track.id for m in group.spans if until.get(m, group.start) > group.start
        }
        until |= {m: max(until.get(m, group.end), group.end) for m in group.spans}
    if shared:
        names = ", ".join(sorted(shared, key=natural))
        notes.append(
            f"in several encounters at a time, for each holds who meets half of its vehicles: vehicle {names}"
        )
    return tuple(groups), tuple(notes)


def find_meetings(pieces: Sequence[Piece], config: LogConfig, *, small: bool) -> list[Meeting]:
    """Return all meetings of two different vehicles, from a first tick to before a last one; in a `small` log each has gap 0."""
    meetings = []
    order = sorted(range(len(pieces)), key=lambda i: pieces[i].first)
    least = shortest(config)
    for k, i in enumerate(order):
        for j in order[k + 1 :]:
            if pieces[j].first > pieces[i].last - least:
                break
            if pieces[i].track.id == pieces[j].track.id:
                continue
            begin = max(pieces[i].first, pieces[j].first)
            for low, high in runs(
                distances(pieces[i], pieces[j]) < config.proximity, ticks(OUT_OF_RANGE_S, config)
            ):
                for first, last in windows(begin + low, begin + high, config):
                    if last - first < least:
                        continue
                    gap = 0.0 if small else gap_of(pieces[i], pieces[j], first, last, config)
                    if gap <= INTERACTS_M:
                        meetings.append(Meeting(gap, first, min(i, j), max(i, j), last))
    return meetings


def gap_of(a: Piece, b: Piece, first: int, last: int, config: LogConfig) -> float:
    """Return how close two vehicles come in place and time [m]; infinite if neither drives `travel` metres."""
    if max(driven(piece, first, last, config) for piece in (a, b)) < config.travel:
        return float("inf")
    return space_time_gap(a.position(first, last), b.position(first, last), config.period)[0]


def windows(first: int, last: int, config: LogConfig) -> list[tuple[int, int]]:
    """Cut a long meeting at whole multiples of `max_duration` on the common clock, so that all pairs are cut alike."""
    longest, least = ticks(config.max_duration, config), ticks(config.min_duration, config) + 1
    if last - first <= longest:
        return [(first, last)]
    inside = [
        edge for edge in range(longest, last, longest) if first + least <= edge <= last - least
    ]
    return list(pairwise([first, *inside, last]))


def shortest(config: LogConfig) -> int:
    """Return the fewest ticks of a meeting: of one that forms an encounter, or of one that joins it."""
    return (
        ticks(
            config.min_duration if config.whole else min(config.min_presence, config.min_duration),
            config,
        )
        + 1
    )


def ticks(seconds: float, config: LogConfig) -> int:
    """Return seconds as a number of ticks."""
    return round(seconds / config.period)


def distances(a: Piece, b: Piece) -> Floats:
    """Return the distances (T,) [m] of two pieces at their common ticks, infinite at two sites; empty where they have none."""
    first = max(a.first, b.first)
    last = max(min(a.last, b.last), first)
    if a.track.origin != b.track.origin:
        return np.full(last - first, np.inf)
    apart: Floats = np.hypot(*(a.position(first, last) - b.position(first, last)).T)
    return apart


def driven(piece: Piece, first: int, last: int, config: LogConfig) -> float:
    """Return the distance [m] that a piece drives from tick `first` to before tick `last`."""
    return float(piece.speed(first, last).sum() * config.period)


def seconds(first: int, last: int, config: LogConfig) -> str:
    """Return the length of an interval of ticks in seconds, for notes."""
    return f"{max(last - first - 1, 0) * config.period:.1f}"


def split(
    group: Group[Meeting], pieces: Sequence[Piece], config: LogConfig
) -> tuple[list[Group[Meeting]], list[str]]:
    """Cut a group at long standstills of all, and into equal parts where it lasts too long; keep the parts with motion.

    Returns:
        The parts, and notes on members that are there for too little of one.
    """
    stands = np.ones(group.end - group.start, dtype=bool)
    for m, (first, last) in group.spans.items():
        stands[first - group.start : last - group.start] &= pieces[m].speed(first, last) < 0.1
    rest, busy = ticks(REST_S, config), np.ones(len(stands), dtype=bool)
    for begin, end in runs(stands):
        if end - begin > ticks(config.standstill, config):
            busy[begin + rest : end - rest] = False
    groups, notes = [], []
    for begin, end in runs(busy):
        parts = max(
            int(np.ceil((end - begin - 1) * config.period / config.max_duration - 1e-9)), 1
        )
        edges = np.linspace(begin, end - 1, parts + 1).round().astype(int)
        for low, high in pairwise(edges.tolist()):
            part, left = part_of(group, group.start + low, group.start + high + 1, config)
            if len(part.spans) < 2 or part.end - part.start <= ticks(config.min_duration, config):
                continue
            if (
                max(driven(pieces[m], *span, config) for m, span in part.spans.items())
                >= config.travel
            ):
                groups.append(part)
                notes += [
                    f"vehicle {pieces[m].track.id} is left out of a part that lasts {seconds(part.start, part.end, config)} s: "
                    f"there for {seconds(*span, config)} s (min_presence)"
                    for m, span in left
                ]
    return groups, notes


def part_of(
    group: Group[Meeting], first: int, last: int, config: LogConfig
) -> tuple[Group[Meeting], list[tuple[int, Span]]]:
    """Return a part of a group with the members that are there long enough; the others are returned with their ticks."""
    spans = {m: (max(own[0], first), min(own[1], last)) for m, own in group.spans.items()}
    kept = {
        m: own
        for m, own in spans.items()
        if own == (first, last) or own[1] - own[0] > ticks(config.min_presence, config)
    }
    left = [(m, own) for m, own in spans.items() if m not in kept and own[1] > own[0]]
    if kept:
        first, last = (
            min(begin for begin, _ in kept.values()),
            max(end for _, end in kept.values()),
        )
    return Group(first, last, kept), left
