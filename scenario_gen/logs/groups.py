# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Groups of vehicles that meet, and the time that each is there.

A *pair interval* is a time in which two vehicles are nearer than `proximity`, for at least `min_presence` seconds; those longer
than `max_duration` are cut.
A group grows from the strongest pair interval of `min_duration` or more, whose time is its own, and is joined by vehicles that
are near a member for at least `min_presence` of its seconds, up to `max_vehicles`: each is there for the time in which it is
recorded and near, so it may arrive late and leave early. Then the pairs inside the group are removed, and the next group grows.
In a small log (of at most `max_vehicles`, as cut by a person) every pair interval counts, and a vehicle joins that meets any
member. In a larger one only those count in which a vehicle moves and the two interact (places and times come close,
`space_time_gap`: they cross, follow, merge or pass), and a vehicle joins that so meets at least half of the members that it is
together with.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.encounters import Piece
from scenario_gen.numerics import Floats, runs

MOST = 0.6  # with `whole`, a vehicle that is there for less of the time is left out; for more, it shortens the time
EDGE = 1.0  # s by which a group is shortened so that no vehicle joins late or leaves early
SHARED = 0.5  # least share of the members together with a vehicle that it interacts with, in a large log
INTERACTS = 6.0  # m: the space-time gap below which two vehicles interact
LAG = 2.0  # m/s: converts the time between two vehicles at the same place to metres
APART = 1.0  # s that a pair may be out of range within one pair interval
REST = 2.0  # s of a long standstill that belong to the encounter before or after it


@dataclass(frozen=True)
class PairInterval:
    """Pieces `i` and `j` are near each other from tick `first` to before tick `last`; a smaller gap interacts more."""

    i: int
    j: int
    first: int
    last: int
    gap: float


@dataclass(frozen=True)
class Group:
    """Pieces that form an encounter, from tick `first` to before tick `last`.

    Attributes:
        spans: for each member from which to before which tick it is there.
    """

    members: tuple[int, ...]
    first: int
    last: int
    spans: tuple[tuple[int, int], ...]


@dataclass
class Growing:
    """A group while it grows: the ticks of its encounter, and of each member."""

    first: int
    last: int
    spans: dict[int, tuple[int, int]]
    notes: list[str] = field(default_factory=list)

    def done(self) -> Group:
        """Return the group, its members in order."""
        members = tuple(sorted(self.spans))
        return Group(members, self.first, self.last, tuple(self.spans[m] for m in members))


def find_groups(pieces: Sequence[Piece], config: LogConfig) -> tuple[tuple[Group, ...], tuple[str, ...]]:
    """Return the encounters in order of time, and notes on vehicles that were left out or shortened one."""
    small = len({piece.track.id for piece in pieces}) <= config.max_vehicles
    pairs = find_pair_intervals(pieces, config, small=small)
    groups, notes = [], []
    while seeds := [pair for pair in pairs if pair.last - pair.first > ticks(config.min_duration, config)]:
        seed = min(seeds, key=lambda m: (m.gap, m.first - m.last, m.first, m.i, m.j))
        group, remarks = grow(seed, pairs, pieces, config, small=small)
        whole, left = split(group, pieces, config)
        groups += whole
        notes += [*remarks, *left] if whole else []
        pairs = left_over(pairs, group, config)
    groups.sort(key=lambda group: (group.first, group.last, group.members))
    return tuple(groups), tuple(notes)


def find_pair_intervals(pieces: Sequence[Piece], config: LogConfig, *, small: bool) -> list[PairInterval]:
    """Return all pair intervals of two different vehicles; in a `small` log each has gap 0."""
    intervals = []
    order = sorted(range(len(pieces)), key=lambda i: pieces[i].first)
    least = shortest(config)
    for a, i in enumerate(order):
        for j in order[a + 1 :]:
            if pieces[j].first > pieces[i].last - least:
                break
            if pieces[i].track.id == pieces[j].track.id:
                continue
            begin = max(pieces[i].first, pieces[j].first)
            for low, high in runs(distances(pieces[i], pieces[j]) < config.proximity, ticks(APART, config)):
                for first, last in windows(begin + low, begin + high, config):
                    gap = 0.0 if small else space_time_gap(pieces[i], pieces[j], first, last, config)
                    if last - first >= least and gap <= INTERACTS:
                        intervals.append(PairInterval(min(i, j), max(i, j), first, last, gap))
    return intervals


def windows(first: int, last: int, config: LogConfig) -> list[tuple[int, int]]:
    """Cut a long pair interval at whole multiples of `max_duration` on the common clock, so that all pairs are cut alike."""
    longest, least = ticks(config.max_duration, config), ticks(config.min_duration, config) + 1
    if last - first <= longest:
        return [(first, last)]
    inside = [edge for edge in range(longest, last, longest) if first + least <= edge <= last - least]
    return list(pairwise([first, *inside, last]))


def shortest(config: LogConfig) -> int:
    """Return the fewest ticks of a pair interval: of one that forms an encounter, or of one that joins it."""
    return ticks(config.min_duration if config.whole else min(config.min_presence, config.min_duration), config) + 1


def ticks(seconds: float, config: LogConfig) -> int:
    """Return seconds as a number of ticks."""
    return round(seconds / config.period)


def distances(a: Piece, b: Piece) -> Floats:
    """Return the distances (T,) [m] of two pieces at their common ticks; empty where they have none."""
    first = max(a.first, b.first)
    last = max(min(a.last, b.last), first)
    return np.asarray(np.hypot(*(a.position(first, last) - b.position(first, last)).T))


def driven(piece: Piece, first: int, last: int, config: LogConfig) -> float:
    """Return the distance [m] that a piece drives from tick `first` to before tick `last`."""
    return float(piece.speed(first, last).sum() * config.period)


def space_time_gap(a: Piece, b: Piece, first: int, last: int, config: LogConfig) -> float:
    """Return how close two vehicles come in place and time: min over t, t' of |a(t) - b(t')| + LAG |t - t'|, in metres.

    Infinite if neither drives `travel` metres: they do not interact.
    """
    if max(driven(piece, first, last, config) for piece in (a, b)) < config.travel:
        return float("inf")
    every = max(ticks(0.3, config), 1)
    time = np.arange(first, last, every) * config.period
    at_a, at_b = a.position(first, last)[::every], b.position(first, last)[::every]
    apart = np.hypot(at_a[:, None, 0] - at_b[None, :, 0], at_a[:, None, 1] - at_b[None, :, 1])
    return float((apart + LAG * np.abs(time[:, None] - time[None, :])).min())


def grow(
    seed: PairInterval, pairs: list[PairInterval], pieces: Sequence[Piece], config: LogConfig, *, small: bool
) -> tuple[Group, list[str]]:
    """Grow a group from the strongest pair interval, `seed`; notes name the vehicles that meet it but are left out, and why."""
    group = Growing(seed.first, seed.last, dict.fromkeys((seed.i, seed.j), (seed.first, seed.last)))
    refused: set[int] = set()
    while candidates := joining(group, refused, pairs, pieces, small=small):
        spans = {other: common_span(other, group, pieces, config) for other in candidates}
        best = min(candidates, key=lambda other: (spans[other][0] - spans[other][1], min(candidates[other]), other))
        if len(group.spans) >= config.max_vehicles:
            left = sorted({pieces[other].track.id for other in candidates})
            group.notes.append(f"left out of an encounter of {len(group.spans)} vehicles (max_vehicles): {', '.join(left)}")
            break
        refused.add(best)
        if not small and not meets_enough(best, spans[best], len(candidates[best]), group):
            continue
        take(group, best, spans[best], pieces[best].track.id, config)
    settle(group, pieces, config)
    return group.done(), group.notes


def joining(
    group: Growing, refused: set[int], pairs: list[PairInterval], pieces: Sequence[Piece], *, small: bool
) -> dict[int, list[float]]:
    """Return the pieces that meet a member while the group lasts, with the gaps to those that they meet [m]."""
    ids = {pieces[m].track.id for m in group.spans}
    ends: dict[int, list[float]] = {}
    for pair in pairs:
        if not small and (pair.first >= group.last or pair.last <= group.first):
            continue
        for inside, other in ((pair.i, pair.j), (pair.j, pair.i)):
            if inside in group.spans and other not in refused and pieces[other].track.id not in ids:
                ends.setdefault(other, []).append(pair.gap)
    return ends


def meets_enough(other: int, span: tuple[int, int], met: int, group: Growing) -> bool:
    """Return whether a vehicle interacts with enough of the members that it is together with."""
    together = [m for m, own in group.spans.items() if m != other and own[0] < span[1] and span[0] < own[1]]
    return met >= SHARED * len(together)


def take(group: Growing, other: int, span: tuple[int, int], name: str, config: LogConfig) -> None:
    """Add a vehicle for `span`, or note why not."""
    begin, end = span
    lasts = group.last - group.first
    near = f"near for {seconds(begin, end, config)} of {seconds(group.first, group.last, config)} s"
    if not config.whole:
        if end - begin > ticks(config.min_presence, config):
            group.spans[other] = span
        elif end > begin:
            group.notes.append(f"vehicle {name} is left out: {near} (min_presence)")
        return
    if (end - begin) < MOST * lasts or end - begin < ticks(config.min_duration, config) + 1:
        if end > begin:
            group.notes.append(f"vehicle {name} is left out: {near} (whole)")
        return
    if end - begin < lasts:
        group.notes.append(
            f"vehicle {name} shortens its encounter to {seconds(begin, end, config)} of "
            f"{seconds(group.first, group.last, config)} s"
        )
    group.first, group.last = begin, end
    group.spans = dict.fromkeys((*group.spans, other), span)


def settle(group: Growing, pieces: Sequence[Piece], config: LogConfig) -> None:
    """Shorten a group by up to `EDGE` so that its vehicles come and go together; note those that do not."""
    edge = ticks(EDGE, config)
    first = max(begin for begin, _ in group.spans.values() if begin <= group.first + edge)
    last = min(end for _, end in group.spans.values() if end >= group.last - edge)
    if last - first > ticks(config.min_duration, config):
        group.first, group.last = first, last
        group.spans = {m: (max(begin, first), min(end, last)) for m, (begin, end) in group.spans.items()}
    for m, (begin, end) in group.spans.items():
        if (begin, end) != (group.first, group.last):
            group.notes.append(
                f"vehicle {pieces[m].track.id} is recorded from {seconds(group.first, begin + 1, config)} to "
                f"{seconds(group.first, end, config)} s of {seconds(group.first, group.last, config)} s"
            )


def seconds(first: int, last: int, config: LogConfig) -> str:
    """Return the length of an interval of ticks in seconds, for notes."""
    return f"{max(last - first - 1, 0) * config.period:.1f}"


def common_span(other: int, group: Growing, pieces: Sequence[Piece], config: LogConfig) -> tuple[int, int]:
    """Return the longest stretch of a group's time in which piece `other` is near a member that is there."""
    piece = pieces[other]
    flags = np.zeros(group.last - group.first, dtype=bool)
    for member, (first, last) in group.spans.items():
        begin = max(piece.first, pieces[member].first)
        close = distances(piece, pieces[member]) < config.proximity
        low, high = max(begin, first), min(begin + len(close), last)
        if high > low:
            flags[low - group.first : high - group.first] |= close[low - begin : high - begin]
    spans = runs(flags, ticks(APART, config))
    begin, end = max(spans, key=lambda span: span[1] - span[0], default=(0, 0))
    return group.first + begin, group.first + end


def split(group: Group, pieces: Sequence[Piece], config: LogConfig) -> tuple[list[Group], list[str]]:
    """Cut a group at long standstills of all, and into equal parts where it lasts too long; keep the parts with motion.

    Returns:
        The parts, and notes on members that are there for too little of one.
    """
    stands = np.ones(group.last - group.first, dtype=bool)
    for m, (first, last) in zip(group.members, group.spans, strict=True):
        stands[first - group.first : last - group.first] &= pieces[m].speed(first, last) < 0.1
    rest, busy = ticks(REST, config), np.ones(len(stands), dtype=bool)
    for begin, end in runs(stands):
        if end - begin > ticks(config.standstill, config):
            busy[begin + rest : end - rest] = False
    groups, notes = [], []
    for begin, end in runs(busy):
        parts = max(int(np.ceil((end - begin - 1) * config.period / config.max_duration - 1e-9)), 1)
        edges = np.linspace(begin, end - 1, parts + 1).round().astype(int)
        for low, high in pairwise(edges.tolist()):
            part, left = part_of(group, group.first + low, group.first + high + 1, config)
            if len(part.members) < 2 or part.last - part.first <= ticks(config.min_duration, config):
                continue
            spans = zip(part.members, part.spans, strict=True)
            if max(driven(pieces[m], *span, config) for m, span in spans) >= config.travel:
                groups.append(part)
                notes += [
                    f"vehicle {pieces[m].track.id} is left out of a part that lasts {seconds(part.first, part.last, config)} s: "
                    f"there for {seconds(*span, config)} s (min_presence)"
                    for m, span in left
                ]
    return groups, notes


def part_of(group: Group, first: int, last: int, config: LogConfig) -> tuple[Group, list[tuple[int, tuple[int, int]]]]:
    """Return a part of a group with the members that are there long enough; the others are returned with their ticks."""
    spans = {m: (max(own[0], first), min(own[1], last)) for m, own in zip(group.members, group.spans, strict=True)}
    kept = {m: own for m, own in spans.items() if own == (first, last) or own[1] - own[0] > ticks(config.min_presence, config)}
    left = [(m, own) for m, own in spans.items() if m not in kept and own[1] > own[0]]
    if kept:
        first, last = min(begin for begin, _ in kept.values()), max(end for _, end in kept.values())
    return Group(tuple(kept), first, last, tuple(kept.values())), left


def left_over(pairs: list[PairInterval], group: Group, config: LogConfig) -> list[PairInterval]:
    """Return the pair intervals without the parts inside the group."""
    least = shortest(config)
    remaining = []
    for pair in pairs:
        if pair.i not in group.members or pair.j not in group.members:
            remaining.append(pair)
            continue
        for first, last in ((pair.first, min(pair.last, group.first)), (max(pair.first, group.last), pair.last)):
            if last - first >= least:
                remaining.append(PairInterval(pair.i, pair.j, first, last, pair.gap))
    return remaining
