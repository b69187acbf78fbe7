# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Who reacts to whom in a record: followers to leaders, and those who enter a shared area second to those who go first.

Need decides, and who is near another one depends on it. *Need*: had the one gone on as it drove, it would have come into the
other's swept space within a human margin, and the record shows that it did not. *Closeness*: it drives in the other's lane, or
passes behind it, within a few seconds. How alike the motions are says how late and how strongly one answers, and beyond that
closeness alone whether it does. docs/interaction.md has the definitions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations
import math

import numpy as np
from scipy import ndimage

from scenario_gen.numerics import Bools, Floats, wrap_angle
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.numerics.plane import ahead_and_left, angle_between
from scenario_gen.situation.gaps import (
    ALIKE,
    bumper_gaps,
    is_behind,
    LANE,
    passing,
    SLOWEST,
)
from scenario_gen.situation.interaction import Conflict, Wait
from scenario_gen.situation.tracks import Track
from scenario_gen.types import Encounter, FOLLOW, Reaction, ReactionGraph, YIELD

LONG_ENOUGH = 2.0  # s, for which one drives behind another
LAGS = 0.3, 3.0  # s, between which a follower answers
SURE = 0.3  # confidence below which there is no edge
NEAR, IN_LANE, PASSES = (
    0.9,
    (2.0, 4.0),
    (3.0, 5.0),
)  # confidence of closeness up to so many s apart, and 0.5 until so many
_STANDS_AS = 4.0  # m/s, of a follower that is slower, where its gap is turned into seconds
_BESIDE = 0.25  # of its length, by which records may overlap of who is behind another one and not beside it
_KEPT_FOR = 1.0  # s, for which a gap in a lane is kept to count
_HEAD_ON, _ALONG = (
    2.6,
    0.35,
)  # rad between headings, beyond and below which closeness to a crossing says nothing
_BEFORE = 8.0  # s, for which a driver foresees
_APART, _MARGIN = 0.5, 1.0  # m and s by which a footprint is kept away from another one's
_LOOKS = (
    0.5,
    0.2,
)  # s, between the instants at which a driver looks ahead, and between those that it sees
_SMOOTH = 1.0  # s
_SIGNIFICANT = 2.6  # standard errors of a correlation, the best of some lags
_DRIVERS_LAG, _PERFECT = (
    (1.2, 0.6),
    0.999,
)  # s, mean and standard deviation of followers' lags; greatest correlation
_STEADY = 0.3  # m/s, spread of a leader's speed below which no gain can be seen
_GAINS = 0.3, 1.0
_OWN = 0.05, 0.15  # of the gap, least and greatest own residual of a follower
_HUMAN_LAG, _HUMAN_SPREAD = 1.2, 1.4  # s, of departures behind a clearing
_OWN_LAG = 0.6  # s, what one driver's varies by
_SLOWS_BY = 1.0  # m/s
_WAITS_WITHIN = 25.0  # m from the shared area, within which one waits for it
_ASIDE = 3.0  # s, before it enters, at which one that merges is beside the lane
ANTICIPATES = 1.5  # s, by which one passes before the other has cleared, at most, to be near it


@dataclass(frozen=True)
class _Seen:
    """What is seen of a pair: an edge, if it is sure enough, and how many seconds the one is apart from the other."""

    who: int
    whom: int
    apart: float
    edge: Reaction | None


@dataclass(frozen=True, eq=False)
class _Recording:
    """An encounter with its tracks, conflicts and waits."""

    encounter: Encounter
    tracks: Sequence[Track]
    conflicts: Sequence[Conflict]
    waits: Sequence[Wait]


def find_reactions(
    encounter: Encounter,
    tracks: Sequence[Track],
    conflicts: Sequence[Conflict],
    waits: Sequence[Wait],
) -> ReactionGraph:
    """Return the graph of reactions.

    Args:
        encounter: the recording.
        tracks: its cleaned tracks.
        conflicts: its conflicts.
        waits: its waits.
    """
    recording = _Recording(encounter, tracks, conflicts, waits)
    seen, leaders = _nearest_leaders(recording)
    passes = [
        found for conflict in conflicts if (found := _passes(recording, conflict)) is not None
    ]
    led = {edge.who: edge for edge in leaders}
    met = {
        pair
        for one in conflicts
        for pair in ((one.first, one.second), (one.second, one.first))
        if _turned(encounter, (one.first, one.exit_first), (one.second, one.entry_second))
        < _HEAD_ON
    }
    met |= {(found.who, found.whom) for found in [*seen, *(one for one in passes if one.edge)]}
    pairs = [pair for pair in permutations(range(len(encounter.vehicles)), 2) if pair not in met]
    short = [edge for pair in pairs if (edge := _gives_way(recording, *pair)) is not None]
    best: dict[tuple[int, float], Reaction] = {}
    for edge in [*short, *(found.edge for found in passes if found.edge is not None)]:
        if not _explained(
            edge, led.get(edge.who), waits
        ):  # of several that a wait is for, the last to clear lets it go
            key = edge.who, edge.until
            best[key] = max(
                best.get(key, edge), edge, key=lambda known: (known.clears, known.confidence)
            )
    graph = without_circles([*leaders, *best.values()], len(encounter.vehicles))
    return graph if graph.edges else replace(graph, why=_why(encounter, [*seen, *passes]))


def _why(encounter: Encounter, seen: Sequence[_Seen]) -> str:
    """Say why nobody is seen to react."""
    nearest = min(seen, key=lambda found: found.apart, default=None)
    if nearest is None or nearest.apart == math.inf:
        pairs = zip(encounter.vehicles, encounter.speed, strict=True)
        stand = [
            vehicle.label for vehicle, speed in pairs if np.all(speed < vehicle.kind.waits_below)
        ]
        standing = f"; {' and '.join(stand)} stands throughout" if stand else ""
        return f"none drives behind another one in its lane, or crosses its path{standing}"
    who, whom = (encounter.vehicles[n].label for n in (nearest.who, nearest.whom))
    least = math.floor(10.0 * nearest.apart) / 10.0
    return (
        f"the nearest are {who} and {whom}, and they are never within {least:.1f} s of each other"
    )


def without_circles(edges: Sequence[Reaction], count: int) -> ReactionGraph:
    """Return the graph of these edges of `count` vehicles; the least sure edge of every circle is cut."""
    kept: list[Reaction] = []
    cut: list[Reaction] = []
    behind: list[set[int]] = [
        set() for _ in range(count)
    ]  # all whom a vehicle reacts to, directly or through others
    for edge in sorted(edges, key=lambda edge: (-edge.confidence, edge.who, edge.whom)):
        if edge.who == edge.whom or edge.who in behind[edge.whom]:
            cut.append(edge)
            continue
        kept.append(edge)
        reached = {edge.whom, *behind[edge.whom]}
        for n in range(count):
            if n == edge.who or edge.who in behind[n]:
                behind[n] |= reached
    order = tuple(sorted(range(count), key=lambda n: (len(behind[n]), n)))
    kept.sort(key=lambda edge: (order.index(edge.who), edge.whom, edge.kind, edge.until))
    return ReactionGraph(tuple(kept), order, tuple(cut))


def _closeness(apart: float, limits: tuple[float, float]) -> float:
    """The confidence of a pair that comes within so many seconds of each other."""
    near, far = limits
    return float(np.interp(apart, [near, far], [NEAR, 0.5])) if apart <= far else 0.0


def _need(recording: _Recording, who: int, whom: int) -> float:
    """The confidence that one had to act, and did: it foresees the other in its way, and comes there later than foreseen.

    It foresees itself at its speed, its acceleration fading over a second, on its own path; the other one as it drives.
    """
    one, other = recording.tracks[who], recording.tracks[whom]
    rows = np.flatnonzero(one.there & other.there)
    speed = _smoothed(one.speed, one.dt)
    begins = rows[:: max(round(_LOOKS[0] / one.dt), 1)]
    begins = begins[speed[begins] > SLOWEST]
    if len(begins) == 0:
        return 0.0
    ahead = np.arange(_LOOKS[1], _BEFORE, _LOOKS[1])
    later = begins[:, None] + np.round(ahead / one.dt).astype(np.int64)
    gains = np.gradient(speed, one.dt)[begins, None] * (ahead - 1.0 + np.exp(-ahead))
    driven = np.maximum.accumulate(speed[begins, None] * ahead + gains, axis=1)
    poses = one.curve.at(one.progress[begins, None] + driven).reshape(-1, 3)
    gap = np.full(len(poses), np.inf)
    for off in (-_MARGIN, 0.0, _MARGIN):
        at = np.clip(later + round(off / one.dt), rows[0], rows[-1]).ravel()
        gap = np.minimum(
            gap, footprint_gaps(one.vehicle.half, poses, other.vehicle.half, other.poses[at])[0]
        )
    meets = (gap.reshape(later.shape) < _APART) & (later <= rows[-1])
    first = np.argmax(meets, axis=1)
    each = np.arange(len(begins))
    recorded = one.progress[np.minimum(later, rows[-1])[each, first]] - one.progress[begins]
    relief = ((driven[each, first] - recorded) / speed[begins])[meets.any(axis=1)].max(initial=0.0)
    return float(0.9 * (1.0 - np.exp(-max(relief - 0.4, 0.0) / 0.4)))


# --- followers --------------------------------------------------------------------------------------------------------


def _nearest_leaders(recording: _Recording) -> tuple[list[_Seen], list[Reaction]]:
    """What is seen of all who drive behind another one, and at most one edge per follower: to the nearest one ahead."""
    encounter = recording.encounter
    n = len(encounter.vehicles)
    leaders, seen = [], []
    for who in range(n):
        gaps = {whom: bumper_gaps(encounter, who, whom) for whom in range(n) if whom != who}
        ahead = {
            whom: is_behind(encounter, who, whom)
            & (gaps[whom] > -_BESIDE * encounter.vehicles[whom].length)
            for whom in gaps
        }
        nearest = np.min([np.where(ahead[whom], gaps[whom], np.inf) for whom in ahead], axis=0)
        found = [
            _follows(recording, who, whom, ahead[whom] & (gaps[whom] <= nearest), gaps[whom])
            for whom in ahead
        ]
        seen += [one for one in found if one is not None]
        sure = [one.edge for one in found if one is not None and one.edge is not None]
        if sure:
            leaders.append(max(sure, key=lambda edge: (edge.until - edge.since) * edge.confidence))
    return seen, leaders


def _follows(
    recording: _Recording, who: int, whom: int, behind: Bools, gaps: Floats
) -> _Seen | None:
    """What is seen of a vehicle that drives `behind` (T,) another one with `gaps` (T,) [m]; None if it does so for too short."""
    encounter = recording.encounter
    dt, time = encounter.dt, encounter.time
    rows = np.flatnonzero(behind)
    own, other = _smoothed(encounter.speed[who], dt), _smoothed(encounter.speed[whom], dt)
    if len(rows) * dt < LONG_ENOUGH or own[rows].max() < encounter.vehicles[who].kind.waits_below:
        return None
    seconds = np.sort(gaps[rows] / np.maximum(own[rows], _STANDS_AS))
    apart = float(seconds[round(_KEPT_FOR / dt)])
    lag, drop = _best_lag(np.gradient(own, dt), np.gradient(other, dt), behind, dt)
    near = _closeness(apart, IN_LANE)
    confidence = 1.0 - (1.0 - near) * (1.0 - _need(recording, who, whom)) * (
        1.0 - (0.0 if near else drop)
    )
    if confidence < SURE:
        return _Seen(who, whom, apart, None)
    steps = round(lag / dt)
    late = rows[rows >= steps]
    led, answer = other[late - steps], own[late]
    spread = float(np.std(led))
    gain = (
        1.0
        if spread < _STEADY
        else float(((led - led.mean()) * (answer - answer.mean())).mean()) / (spread * spread)
    )
    gap = max(float(np.median(gaps[rows])), 1.0)
    line = np.column_stack([np.ones(len(rows)), own[rows]])
    rest = gaps[rows] - line @ np.linalg.lstsq(line, gaps[rows], rcond=None)[0]
    moves = rows[own[rows] > SLOWEST] if own[rows].max() > SLOWEST else rows
    headway = np.sort(gaps[moves] / np.maximum(own[moves], SLOWEST))
    low, middle, high = headway[[0, len(headway) // 2, -1]].tolist()
    return _Seen(who, whom, apart, Reaction(
        FOLLOW, who, whom, lag, min(max(gain, _GAINS[0]), _GAINS[1]),
        min(max(float(np.std(rest)), _OWN[0] * gap), _OWN[1] * gap), confidence,
        float(time[rows[0]]), float(time[rows[-1]]), (low, middle, high),
    ))  # fmt: skip


def _soon(lag: float, duration: float) -> float:
    """The probability that a departure so long behind an event [s] answers it, and is not anywhere in the record [s]."""
    off = (lag - _HUMAN_LAG) / _HUMAN_SPREAD
    soon = float(np.exp(-0.5 * off * off)) / (_HUMAN_SPREAD * math.sqrt(2.0 * math.pi))
    return soon / (soon + 1.0 / max(duration, 1.0))


def _smoothed(speed: Floats, dt: float) -> Floats:
    """The moving mean over a second, twice."""
    width = 2 * round(0.5 * _SMOOTH / dt) + 1
    return np.asarray(
        ndimage.uniform_filter1d(
            ndimage.uniform_filter1d(speed, width, mode="nearest"), width, mode="nearest"
        )
    )


def _best_lag(own: Floats, other: Floats, behind: Bools, dt: float) -> tuple[float, float]:
    """Lag [s] at which the other's acceleration (T,) explains the own most likely, and the share of variance that it explains.

    How likely a lag is, is how likely the correlation is there, and how likely a driver has it. The share is 0 where the greatest
    correlation could be that of two that know nothing of each other: its standard error is Bartlett's, of two series with the
    autocorrelations that these have.
    """
    pairs = []
    for steps in range(max(round(LAGS[0] / dt), 1), round(LAGS[1] / dt) + 1):
        rows = np.flatnonzero(behind[steps:]) + steps
        if len(rows) * dt < LONG_ENOUGH:
            break
        a, b = own[rows] - own[rows].mean(), other[rows - steps] - other[rows - steps].mean()
        size = float(np.sqrt(np.square(a).mean() * np.square(b).mean()))
        pairs.append((steps * dt, float((a * b).mean()) / size if size > 1e-4 else 0.0, a, b))
    _, greatest, a, b = max(pairs, key=lambda pair: pair[1], default=(0.0, 0.0, own, other))
    if greatest <= 0.0:
        return _DRIVERS_LAG[0], 0.0
    error = _standard_error(a, b)
    lag, correlation = np.array([pair[:2] for pair in pairs]).T
    explained = np.square(np.clip(correlation, 0.0, _PERFECT))
    likely = -0.5 * np.log1p(-explained) / (error * error) - 0.5 * np.square(
        (lag - _DRIVERS_LAG[0]) / _DRIVERS_LAG[1]
    )
    return float(
        lag[int(np.argmax(likely))]
    ), greatest * greatest if greatest > _SIGNIFICANT * error else 0.0


def _standard_error(a: Floats, b: Floats) -> float:
    """The standard error of the correlation of two series (n,) without one."""
    n = len(a)
    total = 1.0
    for k in range(1, n // 2):
        weight = 1.0 - k / n
        product = float(
            (a[k:] * a[:-k]).mean()
            / np.square(a).mean()
            * (b[k:] * b[:-k]).mean()
            / np.square(b).mean()
        )
        total += 2.0 * weight * weight * product
    return math.sqrt(max(total, 1.0) / n)


# --- those who pass second --------------------------------------------------------------------------------------------


def _passes(recording: _Recording, conflict: Conflict) -> _Seen | None:
    """What is seen of the second one at a conflict, unless it drives behind the first before and after."""
    encounter, who, whom = recording.encounter, conflict.second, conflict.first
    aside = _from_aside(recording, conflict)
    k = max(int(np.searchsorted(encounter.time, conflict.entry_second)) - 1, 0)
    if k <= encounter.present[who, 0] or (
        not aside and (conflict.following or is_behind(encounter, who, whom)[k])
    ):
        return None
    clears, enters = passing(encounter, conflict, merges=conflict.following)
    gap = enters - clears
    turned = _turned(encounter, (who, enters), (whom, clears))
    apart = (
        max(gap, 0.0)
        if gap > -ANTICIPATES and (conflict.following or _ALONG < turned < _HEAD_ON)
        else math.inf
    )
    near = _closeness(apart, PASSES)
    since, until, stands = _slow_before(recording, who, clears, enters)
    soon = (
        _soon(until - clears, encounter.duration)
        if stands and until - clears > -ANTICIPATES
        else 0.0
    )
    need = _need(recording, who, whom) * float(
        np.interp(gap, [PASSES[1], 2.0 * PASSES[1]], [1.0, 0.0])
    )
    confidence = 1.0 - (1.0 - near) * (1.0 - need) * (1.0 - soon)
    if confidence < SURE:
        return _Seen(who, whom, apart, None)
    lag, merges = until - clears, conflict.following
    edge = Reaction(
        YIELD,
        who,
        whom,
        lag,
        1.0,
        _OWN_LAG,
        confidence,
        since,
        until,
        gap=gap,
        stands=stands,
        merges=merges,
    )
    return _Seen(who, whom, apart, edge)


def _from_aside(recording: _Recording, conflict: Conflict) -> bool:
    """Whether the second one comes into the first one's lane from beside it."""
    encounter, who = recording.encounter, conflict.second
    time = encounter.time
    rows = np.flatnonzero(
        encounter.is_present[who]
        & (np.abs(time - conflict.entry_second + 0.5 * _ASIDE) <= 0.5 * _ASIDE)
    )
    path = recording.tracks[conflict.first].curve
    station, left = path.project(encounter.position[who, rows])
    turned = wrap_angle(path.at(station)[:, 2] - encounter.heading[who, rows])
    return bool(((station > 0.0) & ((np.abs(left) > LANE) | (np.abs(turned) > ALIKE))).any())


def _turned(encounter: Encounter, *passed: tuple[int, float]) -> float:
    """The angle [rad] between the headings of two vehicles, each when [s] it passes."""
    return abs(
        angle_between(
            *(float(np.interp(at, encounter.time, encounter.heading[n])) for n, at in passed)
        )
    )


def _gives_way(recording: _Recording, who: int, whom: int) -> Reaction | None:
    """The edge of one who slows down for another that it does not come behind: it stops before it, or lets it pass close by."""
    encounter = recording.encounter
    between = encounter.position[whom] - encounter.position[who]
    ahead, aside = ahead_and_left(between, encounter.heading[who])
    both = np.flatnonzero(encounter.is_present[who] & encounter.is_present[whom])
    rows = np.flatnonzero(encounter.is_present[who])
    if len(both) == 0:
        return None
    stops = bool(encounter.speed[who, rows[-1]] <= SLOWEST and ahead[both[-1]] > 0.0)
    if not stops:  # until they pass each other
        rows = rows[rows <= both[int(np.argmin(np.hypot(ahead, aside)[both]))]]
    speed = encounter.speed[who, rows]
    top = int(np.argmax(speed))
    if speed[top] - speed[-1] < _SLOWS_BY or (need := _need(recording, who, whom)) < SURE:
        return None
    since, until = (float(encounter.time[k]) for k in (rows[top], rows[-1]))
    return Reaction(
        YIELD, who, whom, 0.0, 1.0, _OWN_LAG, need, since, until, gap=math.inf, stands=stops
    )


def _slow_before(
    recording: _Recording, who: int, clears: float, enters: float
) -> tuple[float, float, bool]:
    """When [s] a vehicle begins to slow down or stand before it enters, and is slowest or drives off; whether it stands.

    Slow instants in one approach are one wait. Both are when it enters, if it does not slow down.
    """
    encounter = recording.encounter
    time = encounter.time
    stands = [
        wait
        for wait in recording.waits
        if wait.vehicle == who and wait.start < clears and wait.end <= enters + 1.0
    ]
    place = encounter.position[who, min(int(np.searchsorted(time, enters)), len(time) - 1)]
    if (
        stands
        and np.hypot(
            *(encounter.position[who, int(np.searchsorted(time, stands[-1].end - 1e-9))] - place)
        )
        < _WAITS_WITHIN
    ):
        return stands[-1].start, stands[-1].end, True
    rows = np.flatnonzero(encounter.is_present[who] & (time <= enters))
    speed = encounter.speed[who, rows]
    low = int(np.argmin(speed))
    top = int(np.argmax(speed[: low + 1]))
    if speed[top] - speed[low] < _SLOWS_BY:
        return enters, enters, False
    return float(time[rows[top]]), float(time[rows[low]]), False


def _explained(edge: Reaction, leader: Reaction | None, waits: Sequence[Wait]) -> bool:
    """Whether a yielder stands behind its leader, who leaves shortly before it: it waits for that one."""
    if leader is None or not edge.stands or not leader.since <= edge.until <= leader.until:
        return False
    return any(
        wait.vehicle == leader.whom and 0.0 <= edge.until - wait.end <= LAGS[1] + 1.0
        for wait in waits
    )
