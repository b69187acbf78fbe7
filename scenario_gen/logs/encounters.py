# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""From clean tracks to encounters: smooth pieces between long gaps, who is near whom, and who belongs to the group.

A *pair interval* is a time in which two vehicles are nearer than `proximity`, for at least `min_duration` seconds; those longer
than `max_duration` are cut.
Encounters grow from pair intervals: the strongest one first, joined by vehicles that are near for most of the time, up to
`max_vehicles`; the interval is the one in which all of them are present and near. Then the pairs inside the encounter are
used up, and the next begins.
In a log of few vehicles (as cut by a person) every pair interval counts, and a vehicle joins that meets any member. In a longer
one only those count in which somebody moves and the two interact (places and times come close, `space_time_gap`: they
cross, follow, merge or pass), and a vehicle joins that so meets all the members.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Bools, Floats, runs
from scenario_gen.logs.cleaning import FASTEST, JUMP_SLACK, select, SLOWEST
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.quality import VehicleQuality
from scenario_gen.logs.raw import Observations
from scenario_gen.logs.smoothing import Smooth, smooth_piece, speed_of_fixes, standing

TURNED = np.radians(120.0)  # who drives off from a stop this far from where it came from has reversed, or turned on the spot
MOST_TICKS = 100_000  # of a piece: smoothing takes 3 kB for each
SHARPEST = 0.4  # 1/m: no car turns sharper, nor by noise on its path
LEVER = 3.0  # m over which that direction is measured
PRESENT = 0.6  # a vehicle that is there for less of the interval is left out; for more, it shortens the interval
INTERACTS = 6.0  # m: the space-time gap below which two vehicles have to do with each other
LAG = 2.0  # m/s: what a second between two vehicles at the same place is worth in metres
APART = 1.0  # s that a pair may be out of range within one pair interval
REST = 2.0  # s of a long standstill that stay with the encounter before or after it


@dataclass(frozen=True, eq=False)
class Piece:
    """A vehicle's smooth motion between two long gaps, on the log's common clock."""

    track: Observations
    smooth: Smooth

    @property
    def first(self) -> int:
        """Tick of the first sample."""
        return self.smooth.first

    @property
    def last(self) -> int:
        """Tick after the final sample."""
        return self.smooth.first + len(self.smooth.speed)

    def position(self, first: int, last: int) -> Floats:
        """Positions (T, 2) [m] from tick `first` to before tick `last`."""
        return self.smooth.position[first - self.first : last - self.first]

    def speed(self, first: int, last: int) -> Floats:
        """Speeds (T,) [m/s], likewise."""
        return self.smooth.speed[first - self.first : last - self.first]


def pieces_of(track: Observations, origin_ns: int, config: LogConfig) -> tuple[list[Piece], VehicleQuality]:
    """Cut a track at gaps, relocations and reversals, and smooth each piece.

    A gap may always be two and a half of the source's own periods long, so that a source of 1 Hz is not cut to bits.
    """
    seconds = np.diff(track.fix_ns) * 1e-9
    usual = float(np.median(seconds))
    longest = longest_bridge(seconds, config)
    step = exact.hypot(*np.diff(track.fix, axis=0).T)
    gaps = (seconds > longest) | (step > JUMP_SLACK + FASTEST * seconds)
    back = reversals(track, config)
    cuts = gaps | back | laps(track, config)
    bridged = (seconds > 1.5 * max(usual, config.period)) & ~gaps
    whole = parts(track, cuts)
    smoothed = [leaf for part in whole for leaf in steered(part, origin_ns, config)]
    pieces = [Piece(part, smooth) for part, smooth in smoothed if smooth is not None]
    smooths = [piece.smooth for piece in pieces]

    def joined(name: str) -> Floats:
        return np.concatenate([np.zeros(0), *(getattr(smooth, name) for smooth in smooths)])

    def rms(name: str) -> float:
        values = joined(name)
        return float(np.sqrt(np.square(values).mean())) if len(values) else 0.0

    turned, used = np.abs(joined("turned")), joined("headings")
    quality = VehicleQuality(
        id=track.id,
        fixes=len(track.fix_ns),
        seconds=sum(int(piece.last - piece.first - 1) for piece in pieces) * config.period,
        pieces=len(pieces),
        bridged=int(bridged.sum()),
        longest_bridged=float(seconds[bridged].max(initial=0.0)),
        cut=int(gaps.sum()),
        longest_cut=float(seconds[gaps].max(initial=0.0)),
        reversals=int((back & ~gaps).sum()) + len(smoothed) - len(whole),
        speed_before=rms("before"),
        speed_after=rms("after"),
        changed=rms("changed"),
        moved=rms("moved"),
        moved_most=max((float(smooth.moved.max()) for smooth in smooths), default=0.0),
        noise=max((smooth.noise for smooth in smooths), default=np.nan),
        turned=float(np.median(turned)) if len(turned) else np.nan,
        headings=float(used.mean()) if len(used) else np.nan,
    )
    return pieces, quality


def steered(part: Observations, origin_ns: int, config: LogConfig) -> list[tuple[Observations, Smooth | None]]:
    """Smooth a part of a track, cut wherever its path then turns sharper than a car can.

    Nobody turns on the spot: where a path does, the vehicle reversed in a stop too short to be seen in the fixes.
    """
    smooth = smooth_piece(part, origin_ns, config)
    if smooth is None:
        return [(part, None)]
    turn = np.abs(np.diff(smooth.heading)) - SHARPEST * exact.hypot(*np.diff(smooth.position, axis=0).T)
    if not (turn > 1e-6).any():
        return [(part, smooth)]
    at = origin_ns + round((smooth.first + int(np.argmax(turn)) + 0.5) * config.period * 1e9)
    cuts = np.zeros(len(part.fix_ns) - 1, dtype=bool)
    cuts[np.clip(np.searchsorted(part.fix_ns, at), 1, len(cuts)) - 1] = True
    return [leaf for half in parts(part, cuts) for leaf in steered(half, origin_ns, config)]


def laps(track: Observations, config: LogConfig) -> Bools:
    """(F-1,) where a track of hours is cut, so that the memory which smoothing takes does not grow with it."""
    lap = (track.fix_ns - track.fix_ns[0]) // round(MOST_TICKS * config.period * 1e9)
    new: Bools = np.diff(lap) > 0
    return new


def longest_bridge(seconds: Floats, config: LogConfig) -> float:
    """Return the longest gap [s] that is bridged in a track whose fixes are `seconds` (F-1,) apart."""
    return max(config.longest_gap, 2.5 * min(float(np.median(seconds)), SLOWEST)) + 1e-6


def reversals(track: Observations, config: LogConfig) -> Bools:
    """(F-1,) where to cut because the vehicle drives back where it came from after a stop: a heading cannot follow that."""
    seconds = (track.fix_ns - track.fix_ns[0]).astype(np.float64) * 1e-9
    speed_t = (track.speed_ns - track.fix_ns[0]).astype(np.float64) * 1e-9
    speed = track.speed
    if not len(speed):
        speed_t, speed = seconds, speed_of_fixes(seconds, track.fix)
    ticks = config.period * np.arange(max(int(seconds[-1] / config.period), 1) + 1, dtype=np.float64)
    cuts = np.zeros(len(seconds) - 1, dtype=bool)
    for begin, end in runs(standing(ticks, seconds, track.fix, speed_t, speed)):
        first, last = np.searchsorted(seconds, (ticks[begin], ticks[end - 1])).tolist()
        before = departure(track.fix[first::-1])
        after = departure(track.fix[last:])
        if before is not None and after is not None and float(exact.matmul(before, after)) > -exact.cos(TURNED):
            cuts[min((first + last) // 2, len(cuts) - 1)] = True
    return cuts


def departure(fix: Floats) -> Floats | None:
    """Return the unit vector (2,) from the first fix (F, 2) [m] to the first one that is `LEVER` away, None if there is none."""
    offset = fix - fix[0]
    away = exact.hypot(offset[:, 0], offset[:, 1])
    far = np.flatnonzero(away > LEVER)
    return offset[far[0]] / away[far[0]] if len(far) else None


def parts(track: Observations, cuts: Bools) -> list[Observations]:
    """Split a track after each True of `cuts` (F-1,); parts of one fix are left out."""
    edges = [0, *(np.flatnonzero(cuts) + 1).tolist(), len(track.fix_ns)]
    found = []
    for begin, end in pairwise(edges):
        if end - begin < 2:
            continue
        during = (track.speed_ns >= track.fix_ns[begin]) & (track.speed_ns <= track.fix_ns[end - 1])
        found.append(select(track, np.arange(begin, end), during))
    return found


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
    """Pieces that make an encounter, from tick `first` to before tick `last`."""

    members: tuple[int, ...]
    first: int
    last: int


def find_groups(pieces: Sequence[Piece], config: LogConfig) -> tuple[tuple[Group, ...], tuple[str, ...]]:
    """Return the encounters in order of time, and notes on vehicles that were left out or shortened one."""
    few = len({piece.track.id for piece in pieces}) <= config.max_vehicles
    pairs = find_pair_intervals(pieces, config, few=few)
    groups, notes = [], []
    while pairs:
        pairs.sort(key=lambda m: (m.gap, m.first - m.last, m.first, m.i, m.j))
        group, remarks = grow(pairs, pieces, config, few=few)
        whole = split(group, pieces, config)
        groups += whole
        notes += remarks if whole else []
        pairs = left_over(pairs, group, config)
    groups.sort(key=lambda group: (group.first, group.last, group.members))
    return tuple(groups), tuple(notes)


def find_pair_intervals(pieces: Sequence[Piece], config: LogConfig, *, few: bool) -> list[PairInterval]:
    """Return all pair intervals of two different vehicles; with `few` vehicles each has gap 0."""
    found = []
    order = sorted(range(len(pieces)), key=lambda i: pieces[i].first)
    least = ticks(config.min_duration, config) + 1
    for a, i in enumerate(order):
        for j in order[a + 1 :]:
            if pieces[j].first > pieces[i].last - least:
                break
            if pieces[i].track.id == pieces[j].track.id:
                continue
            begin = max(pieces[i].first, pieces[j].first)
            for low, high in runs(distances(pieces[i], pieces[j]) < config.proximity, ticks(APART, config)):
                for first, last in windows(begin + low, begin + high, config):
                    gap = 0.0 if few else space_time_gap(pieces[i], pieces[j], first, last, config)
                    if last - first >= least and gap <= INTERACTS:
                        found.append(PairInterval(min(i, j), max(i, j), first, last, gap))
    return found


def windows(first: int, last: int, config: LogConfig) -> list[tuple[int, int]]:
    """Cut a long pair interval at whole multiples of `max_duration` on the common clock, so that all who meet are cut alike."""
    longest, least = ticks(config.max_duration, config), ticks(config.min_duration, config) + 1
    if last - first <= longest:
        return [(first, last)]
    inside = [edge for edge in range(longest, last, longest) if first + least <= edge <= last - least]
    return list(pairwise([first, *inside, last]))


def ticks(seconds: float, config: LogConfig) -> int:
    """Seconds as a number of ticks."""
    return round(seconds / config.period)


def distances(a: Piece, b: Piece) -> Floats:
    """Distances (T,) [m] of two pieces at their common ticks; empty where they have none."""
    first = max(a.first, b.first)
    last = max(min(a.last, b.last), first)
    return exact.hypot(*(a.position(first, last) - b.position(first, last)).T)


def driven(piece: Piece, first: int, last: int, config: LogConfig) -> float:
    """Distance [m] that a piece drives from tick `first` to before tick `last`."""
    return float(piece.speed(first, last).sum() * config.period)


def space_time_gap(a: Piece, b: Piece, first: int, last: int, config: LogConfig) -> float:
    """How close two vehicles come in place and time: min over t, t' of |a(t) - b(t')| + LAG |t - t'|, in metres.

    Two of whom neither drives `travel` metres have nothing to do with each other: infinite.
    """
    if max(driven(piece, first, last, config) for piece in (a, b)) < config.travel:
        return float("inf")
    every = max(ticks(0.3, config), 1)
    time = np.arange(first, last, every) * config.period
    at_a, at_b = a.position(first, last)[::every], b.position(first, last)[::every]
    apart = exact.hypot(at_a[:, None, 0] - at_b[None, :, 0], at_a[:, None, 1] - at_b[None, :, 1])
    return float((apart + LAG * np.abs(time[:, None] - time[None, :])).min())


def grow(pairs: list[PairInterval], pieces: Sequence[Piece], config: LogConfig, *, few: bool) -> tuple[Group, list[str]]:
    """Grow an encounter from the strongest pair interval."""
    seed = pairs[0]
    members, first, last = [seed.i, seed.j], seed.first, seed.last
    notes: list[str] = []
    refused: set[int] = set()
    while len(members) < config.max_vehicles:
        candidates: dict[int, list[float]] = {}
        here = {pieces[m].track.id for m in members}
        for pair in pairs:
            for inside, other in ((pair.i, pair.j), (pair.j, pair.i)):
                if inside in members and other not in refused and pieces[other].track.id not in here:
                    candidates.setdefault(other, []).append(pair.gap)
        candidates = {other: gaps for other, gaps in candidates.items() if few or len(gaps) >= len(members)}
        if not candidates:
            break
        spans = {other: common_span(other, members, first, last, pieces, config) for other in candidates}
        best = min(candidates, key=lambda other: (spans[other][0] - spans[other][1], min(candidates[other]), other))
        begin, end = spans[best]
        share, name = (end - begin) / (last - first), pieces[best].track.id
        if share < PRESENT or end - begin < ticks(config.min_duration, config) + 1:
            refused.add(best)
            if share > 0.0:
                notes.append(
                    f"vehicle {name} is left out: near for {seconds(begin, end, config)} of {seconds(first, last, config)} s"
                )
            continue
        if share < 1.0:
            notes.append(
                f"vehicle {name} shortens its encounter to {seconds(begin, end, config)} of {seconds(first, last, config)} s"
            )
        members.append(best)
        first, last = begin, end
    return Group(tuple(sorted(members)), first, last), notes


def seconds(first: int, last: int, config: LogConfig) -> str:
    """Length of an interval of ticks, for people."""
    return f"{max(last - first - 1, 0) * config.period:.1f}"


def common_span(
    other: int, members: list[int], first: int, last: int, pieces: Sequence[Piece], config: LogConfig
) -> tuple[int, int]:
    """The longest stretch of [first, last) in which piece `other` is near any member."""
    piece = pieces[other]
    flags = np.zeros(last - first, dtype=bool)
    for member in members:
        begin = max(piece.first, pieces[member].first)
        close = distances(piece, pieces[member]) < config.proximity
        low, high = max(begin, first), min(begin + len(close), last)
        if high > low:
            flags[low - first : high - first] |= close[low - begin : high - begin]
    spans = runs(flags, ticks(APART, config))
    begin, end = max(spans, key=lambda span: span[1] - span[0], default=(0, 0))
    return first + begin, first + end


def split(group: Group, pieces: Sequence[Piece], config: LogConfig) -> list[Group]:
    """Cut a group where all stand for long, and into equal parts where it lasts too long; keep the parts with motion."""
    members = [pieces[m] for m in group.members]
    stands = np.all([p.speed(group.first, group.last) < 0.1 for p in members], axis=0)
    rest, busy = ticks(REST, config), np.ones(len(stands), dtype=bool)
    for begin, end in runs(stands):
        if end - begin > ticks(config.standstill, config):
            busy[begin + rest : end - rest] = False
    found = []
    for begin, end in runs(busy):
        parts = max(int(np.ceil((end - begin - 1) * config.period / config.max_duration - 1e-9)), 1)
        edges = np.linspace(begin, end - 1, parts + 1).round().astype(int)
        for low, high in pairwise(edges.tolist()):
            part = Group(group.members, group.first + low, group.first + high + 1)
            farthest = max(driven(p, part.first, part.last, config) for p in members)
            if part.last - part.first > ticks(config.min_duration, config) and farthest >= config.travel:
                found.append(part)
    return found


def left_over(pairs: list[PairInterval], group: Group, config: LogConfig) -> list[PairInterval]:
    """Return what remains of the pair intervals when those inside the group are used up."""
    least = ticks(config.min_duration, config) + 1
    remaining = []
    for pair in pairs:
        if pair.i not in group.members or pair.j not in group.members:
            remaining.append(pair)
            continue
        for first, last in ((pair.first, min(pair.last, group.first)), (max(pair.first, group.last), pair.last)):
            if last - first >= least:
                remaining.append(PairInterval(pair.i, pair.j, first, last, pair.gap))
    return remaining
