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

"""Cutting a log into encounters: who is near whom, for how long, and who belongs to the group.

A *meeting* is a pair of vehicles nearer than `proximity` for at least `shortest` seconds; those longer than `longest` are cut.
Encounters grow from meetings: the strongest one first, joined by vehicles that are near for most of the time, up to
`most_vehicles`; the interval is the one in which all of them are present and near. Then the meetings inside the encounter are
used up, and the next begins.
In a log of few vehicles (as cut by a person) every meeting counts, and a vehicle joins that meets any member. In a longer one
only those meetings count in which somebody moves and the two interact (places and times come close, `space_time_gap`: they
cross, follow, merge or pass), and a vehicle joins that so meets all the members.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Bools
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.intervals import runs
from scenario_gen.logs.pieces import Piece

PRESENT = 0.6  # a vehicle that is there for less of the interval is left out; for more, it shortens the interval
INTERACTS = 6.0  # m: the space-time gap below which two vehicles have to do with each other
LAG = 2.0  # m/s: what a second between two vehicles at the same place is worth in metres
APART = 1.0  # s that a pair may be out of range within one meeting
REST = 2.0  # s of a long standstill that stay with the encounter before or after it


@dataclass(frozen=True)
class Meeting:
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
    few = len({piece.track.id for piece in pieces}) <= config.most_vehicles
    meetings = find_meetings(pieces, config, few=few)
    groups, notes = [], []
    while meetings:
        meetings.sort(key=lambda m: (m.gap, m.first - m.last, m.first, m.i, m.j))
        group, remarks = grow(meetings, pieces, config, few=few)
        whole = split(group, pieces, config)
        groups += whole
        notes += remarks if whole else []
        meetings = left_over(meetings, group, config)
    groups.sort(key=lambda group: (group.first, group.last, group.members))
    return tuple(groups), tuple(notes)


def find_meetings(pieces: Sequence[Piece], config: LogConfig, *, few: bool) -> list[Meeting]:
    """Return all meetings of two different vehicles; with `few` vehicles each has gap 0."""
    found = []
    order = sorted(range(len(pieces)), key=lambda i: pieces[i].first)
    least = ticks(config.shortest, config) + 1
    for a, i in enumerate(order):
        for j in order[a + 1 :]:
            if pieces[j].first > pieces[i].last - least:
                break
            if pieces[i].track.id == pieces[j].track.id:
                continue
            begin = max(pieces[i].first, pieces[j].first)
            for low, high in runs(near(pieces[i], pieces[j], config), ticks(APART, config)):
                for first, last in windows(begin + low, begin + high, config):
                    gap = 0.0 if few else space_time_gap(pieces[i], pieces[j], first, last, config)
                    if last - first >= least and gap <= INTERACTS:
                        found.append(Meeting(min(i, j), max(i, j), first, last, gap))
    return found


def windows(first: int, last: int, config: LogConfig) -> list[tuple[int, int]]:
    """Cut a long meeting at whole multiples of `longest` on the common clock, so that all who meet are cut alike."""
    longest, least = ticks(config.longest, config), ticks(config.shortest, config) + 1
    if last - first <= longest:
        return [(first, last)]
    inside = [edge for edge in range(longest, last, longest) if first + least <= edge <= last - least]
    return list(pairwise([first, *inside, last]))


def ticks(seconds: float, config: LogConfig) -> int:
    """Seconds as a number of ticks."""
    return round(seconds / config.period)


def near(a: Piece, b: Piece, config: LogConfig) -> Bools:
    """At which of their common ticks two pieces are within range."""
    first, last = max(a.first, b.first), min(a.last, b.last)
    if last <= first:
        return np.zeros(0, dtype=bool)
    gap = a.smooth.position[first - a.first : last - a.first] - b.smooth.position[first - b.first : last - b.first]
    return exact.hypot(gap[:, 0], gap[:, 1]) < config.proximity


def space_time_gap(a: Piece, b: Piece, first: int, last: int, config: LogConfig) -> float:
    """How close two vehicles come in place and time: min over t, t' of |a(t) - b(t')| + LAG |t - t'|, in metres.

    Two of whom neither drives `travel` metres have nothing to do with each other: infinite.
    """
    driven = max(p.smooth.speed[first - p.first : last - p.first].sum() * config.period for p in (a, b))
    if driven < config.travel:
        return float("inf")
    every = max(ticks(0.3, config), 1)
    time = np.arange(first, last, every) * config.period
    at_a = a.smooth.position[first - a.first : last - a.first : every]
    at_b = b.smooth.position[first - b.first : last - b.first : every]
    apart = exact.hypot(at_a[:, None, 0] - at_b[None, :, 0], at_a[:, None, 1] - at_b[None, :, 1])
    return float((apart + LAG * np.abs(time[:, None] - time[None, :])).min())


def grow(meetings: list[Meeting], pieces: Sequence[Piece], config: LogConfig, *, few: bool) -> tuple[Group, list[str]]:
    """Grow an encounter from the strongest meeting."""
    seed = meetings[0]
    members, first, last = [seed.i, seed.j], seed.first, seed.last
    notes: list[str] = []
    refused: set[int] = set()
    while len(members) < config.most_vehicles:
        candidates: dict[int, list[float]] = {}
        here = {pieces[m].track.id for m in members}
        for meeting in meetings:
            for inside, other in ((meeting.i, meeting.j), (meeting.j, meeting.i)):
                if inside in members and other not in refused and pieces[other].track.id not in here:
                    candidates.setdefault(other, []).append(meeting.gap)
        candidates = {other: gaps for other, gaps in candidates.items() if few or len(gaps) >= len(members)}
        if not candidates:
            break
        spans = {other: common_span(other, members, first, last, pieces, config) for other in candidates}
        best = min(candidates, key=lambda other: (spans[other][0] - spans[other][1], min(candidates[other]), other))
        begin, end = spans[best]
        share, name = (end - begin) / (last - first), pieces[best].track.id
        if share < PRESENT or end - begin < ticks(config.shortest, config) + 1:
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
        close = near(piece, pieces[member], config)
        low, high = max(begin, first), min(begin + len(close), last)
        if high > low:
            flags[low - first : high - first] |= close[low - begin : high - begin]
    spans = runs(flags, ticks(APART, config))
    begin, end = max(spans, key=lambda span: span[1] - span[0], default=(0, 0))
    return first + begin, first + end


def split(group: Group, pieces: Sequence[Piece], config: LogConfig) -> list[Group]:
    """Cut a group where all stand for long, and into equal parts where it lasts too long; keep the parts with motion."""
    members = [pieces[m] for m in group.members]
    stands = np.all([p.smooth.speed[group.first - p.first : group.last - p.first] < 0.1 for p in members], axis=0)
    rest, busy = ticks(REST, config), np.ones(len(stands), dtype=bool)
    for begin, end in runs(stands):
        if end - begin > ticks(config.standstill, config):
            busy[begin + rest : end - rest] = False
    found = []
    for begin, end in runs(busy):
        parts = max(int(np.ceil((end - begin - 1) * config.period / config.longest - 1e-9)), 1)
        edges = np.linspace(begin, end - 1, parts + 1).round().astype(int)
        for low, high in pairwise(edges.tolist()):
            part = Group(group.members, group.first + low, group.first + high + 1)
            driven = [p.smooth.speed[part.first - p.first : part.last - p.first].sum() * config.period for p in members]
            if part.last - part.first > ticks(config.shortest, config) and max(driven) >= config.travel:
                found.append(part)
    return found


def left_over(meetings: list[Meeting], group: Group, config: LogConfig) -> list[Meeting]:
    """Return what remains of the meetings when those inside the group are used up."""
    least = ticks(config.shortest, config) + 1
    remaining = []
    for meeting in meetings:
        if meeting.i not in group.members or meeting.j not in group.members:
            remaining.append(meeting)
            continue
        for first, last in ((meeting.first, min(meeting.last, group.first)), (max(meeting.first, group.last), meeting.last)):
            if last - first >= least:
                remaining.append(Meeting(meeting.i, meeting.j, first, last, meeting.gap))
    return remaining
