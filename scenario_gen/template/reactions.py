# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Who reacts to whom in a record: followers to leaders, yielders to those who go first, and nobody where nothing is seen.

Every edge is a comparison of two explanations. A follower's accelerations are either its own, or in part those of its leader some
time ago; its gap is either what two free speeds make of it, or kept. A yielder's departure is either anywhere in the record, or
soon after the other has cleared. docs/interaction.md has the definitions.
"""

from collections.abc import Sequence
import math

import numpy as np
from scipy import ndimage

from scenario_gen.numerics import Bools, Floats, wrap_angle
from scenario_gen.numerics.plane import ahead_and_left
from scenario_gen.template.answers import SLOWEST, time_gaps
from scenario_gen.template.interaction import Conflict, find_conflicts, find_waits
from scenario_gen.types import Encounter, FOLLOW, once_per_object, Reaction, ReactionGraph, YIELD

FAR = 60.0  # m, within which one follows
LONG_ENOUGH = 3.0  # s, for which it drives behind the other
LAGS = 0.3, 3.0  # s, between which a follower answers
SURE = 0.3  # confidence below which there is no edge
ANTICIPATES, LATEST = 1.5, 4.0  # s, by which a yielder leaves before the other has cleared, and behind it, at most
_LANE = 2.2  # m, to the side of the other's path
_ALIKE = 0.5  # rad, of two headings on one way
_SMOOTH = 1.0  # s
_SIGNIFICANT = 2.6  # standard errors of a correlation, the best of some lags
_HEADWAY = 3.5  # s, beyond which an even gap says nothing
_EVEN, _EVEN_FOR = 0.2, 5.0  # difference of speeds as a share of them that is no keeping of a gap; s
_STEADY = 0.3  # m/s, spread of a leader's speed below which no gain can be seen
_GAINS = 0.3, 1.0
_OWN = 0.05, 0.15  # of the gap, least and greatest own residual of a follower
_HUMAN_LAG, _HUMAN_SPREAD = 1.2, 1.4  # s, of departures behind a clearing
_OWN_LAG = 0.6  # s, what one driver's varies by
_SLOWS_BY, _SLOWS_TO, _BENDS = 2.0, 0.6, 0.7  # m/s, share of the speed, and what a slowing without a stand counts
_NEAR = 25.0  # m from the shared area, within which one waits for it


@once_per_object
def reactions_of(encounter: Encounter) -> ReactionGraph:
    """Return who reacts to whom."""
    follows = _nearest_leaders(encounter)
    conflicts = find_conflicts(encounter.vehicles, encounter.time, encounter.position, encounter.heading, encounter.present)
    yields = [edge for conflict in conflicts if (edge := _yields(encounter, conflict)) is not None]
    led = {edge.who: edge for edge in follows}
    kept = [edge for edge in yields if not _explained(edge, led.get(edge.who), encounter)]
    best: dict[tuple[int, float], Reaction] = {}
    for edge in kept:  # of several that a wait is for, the last to clear lets it go
        key = edge.who, edge.until
        best[key] = max(best.get(key, edge), edge, key=lambda known: known.confidence)
    return without_circles([*follows, *best.values()], len(encounter.vehicles))


def without_circles(edges: Sequence[Reaction], count: int) -> ReactionGraph:
    """Return the graph of these edges of `count` vehicles; the least sure edge of every circle is cut."""
    kept: list[Reaction] = []
    cut: list[Reaction] = []
    behind: list[set[int]] = [set() for _ in range(count)]  # all whom a vehicle reacts to, directly or through others
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


# --- followers --------------------------------------------------------------------------------------------------------


def _nearest_leaders(encounter: Encounter) -> list[Reaction]:
    """At most one edge per follower: to the nearest one ahead."""
    n = len(encounter.vehicles)
    leaders = []
    for who in range(n):
        ahead = {whom: is_behind(encounter, who, whom) for whom in range(n) if whom != who}
        apart = {whom: _apart(encounter, who, whom) for whom in ahead}
        nearest = np.min([np.where(ahead[whom], apart[whom], np.inf) for whom in ahead], axis=0)
        edges = [_follows(encounter, who, whom, ahead[whom] & (apart[whom] <= nearest), apart[whom]) for whom in ahead]
        sure = [edge for edge in edges if edge is not None]
        if sure:
            leaders.append(max(sure, key=lambda edge: (edge.until - edge.since) * edge.confidence))
    return leaders


def is_behind(encounter: Encounter, who: int, whom: int) -> Bools:
    """(T,) whether one drives behind the other on the same way, within 60 m: where that one was, or straight behind it."""
    a, b = encounter.position[who], encounter.position[whom]
    yaw_a, yaw_b = encounter.heading[who], encounter.heading[whom]
    both = encounter.there[who] & encounter.there[whom]
    between = b - a
    along, across = ahead_and_left(between, yaw_a)
    alike = np.abs(wrap_angle(yaw_b - yaw_a)) < _ALIKE
    straight = (along > 0.0) & (np.abs(across) < _LANE) & alike
    step = max(round(0.5 / encounter.dt), 1)
    now, behind = np.arange(len(a)), straight
    for mine, yaw, path, path_yaw, sign in ((a, yaw_a, b, yaw_b, -1), (b, yaw_b, a, yaw_a, 1)):
        rows = np.arange(0, len(path), step)  # where the other was before; where this one will be
        square = np.square(mine[:, None] - path[None, rows]).sum(axis=-1)
        nearest = np.argmin(square, axis=1)
        near = (np.sqrt(square[now, nearest]) < _LANE) & (np.abs(wrap_angle(path_yaw[rows[nearest]] - yaw)) < _ALIKE)
        behind = behind | (near & (sign * (rows[nearest] - now) > step))
    return np.asarray(behind & both & (np.sqrt(np.square(between).sum(axis=1)) < FAR))


def _apart(encounter: Encounter, who: int, whom: int) -> Floats:
    """(T,) metres between two centres."""
    return np.asarray(np.sqrt(np.square(encounter.position[who] - encounter.position[whom]).sum(axis=1)))


def _follows(encounter: Encounter, who: int, whom: int, behind: Bools, apart: Floats) -> Reaction | None:
    """The edge of a vehicle that drives `behind` (T,) another one at a distance `apart` (T,) [m], if there is one."""
    dt, time = encounter.dt, encounter.time
    rows = np.flatnonzero(behind)
    if len(rows) * dt < LONG_ENOUGH:
        return None
    own, other = _smoothed(encounter.speed[who], dt), _smoothed(encounter.speed[whom], dt)
    moves = behind & (own > SLOWEST)
    if moves.sum() * dt < LONG_ENOUGH:
        return None
    lag, drop = _best_lag(np.gradient(own, dt), np.gradient(other, dt), behind, dt)
    headway = time_gaps(encounter, who, whom)
    if len(headway) == 0:
        return None
    near = moves & (apart < _HEADWAY * np.maximum(own, SLOWEST))
    even = 0.0
    if near.sum() * dt >= _EVEN_FOR:
        differs = float(np.sqrt(np.square(own[near] - other[near]).mean()) / np.sqrt(np.square(own[near]).mean()))
        even = max(1.0 - differs / _EVEN, 0.0)
    starts = _starts_behind(encounter, who, whom, behind)
    confidence = 1.0 - (1.0 - drop) * (1.0 - even) * (1.0 - (starts[1] if starts else 0.0))
    if confidence < SURE:
        return None
    if starts and not drop:
        lag = min(max(starts[0], LAGS[0]), LAGS[1])
    steps = round(lag / dt)
    late = rows[rows >= steps]
    led, answer = other[late - steps], own[late]
    spread = float(np.std(led))
    gain = 1.0 if spread < _STEADY else float(((led - led.mean()) * (answer - answer.mean())).mean()) / (spread * spread)
    gap = float(np.median(apart[moves]))
    line = np.column_stack([np.ones(int(moves.sum())), own[moves]])
    rest = apart[moves] - line @ np.linalg.lstsq(line, apart[moves], rcond=None)[0]
    low, middle, high = np.sort(headway)[[0, len(headway) // 2, -1]].tolist()
    return Reaction(
        FOLLOW, who, whom, lag, min(max(gain, _GAINS[0]), _GAINS[1]),
        min(max(float(np.std(rest)), _OWN[0] * gap), _OWN[1] * gap), confidence,
        float(time[rows[0]]), float(time[rows[-1]]), (low, middle, high),
    )  # fmt: skip


def _starts_behind(encounter: Encounter, who: int, whom: int, behind: Bools) -> tuple[float, float] | None:
    """By how much [s] a vehicle drives off later than the one it stands behind, and how sure it is that it waited for that."""
    pairs = []
    leaders = [wait.end for wait in find_waits(encounter) if wait.vehicle == whom]
    for wait in find_waits(encounter):
        lags = [wait.end - end for end in leaders if 0.0 < wait.end - end <= LAGS[1]]
        if wait.vehicle == who and lags and behind[int(np.searchsorted(encounter.time, wait.end - 1e-9))]:
            pairs.append((min(lags), _soon(min(lags), encounter.duration)))
    return max(pairs, key=lambda start: start[1], default=None)


def _soon(lag: float, duration: float) -> float:
    """The probability that a departure so long behind an event [s] answers it, and is not anywhere in the record [s]."""
    off = (lag - _HUMAN_LAG) / _HUMAN_SPREAD
    soon = float(np.exp(np.array(-0.5 * off * off))) / (_HUMAN_SPREAD * math.sqrt(2.0 * math.pi))
    return soon / (soon + 1.0 / max(duration, 1.0))


def _smoothed(speed: Floats, dt: float) -> Floats:
    """The moving mean over a second, twice."""
    width = 2 * round(0.5 * _SMOOTH / dt) + 1
    return np.asarray(ndimage.uniform_filter1d(ndimage.uniform_filter1d(speed, width, mode="nearest"), width, mode="nearest"))


def _best_lag(own: Floats, other: Floats, behind: Bools, dt: float) -> tuple[float, float]:
    """Lag [s] at which the other's acceleration (T,) explains the own best, and the share of variance that it explains.

    0 where the correlation could be that of two that know nothing of each other: its standard error is Bartlett's, of two series
    with the autocorrelations that these have.
    """
    best = 0.0, _STANDARD_LAG
    error = 1.0
    for steps in range(max(round(LAGS[0] / dt), 1), round(LAGS[1] / dt) + 1):
        rows = np.flatnonzero(behind[steps:]) + steps
        if len(rows) * dt < LONG_ENOUGH:
            break
        a, b = own[rows] - own[rows].mean(), other[rows - steps] - other[rows - steps].mean()
        size = float(np.sqrt(np.square(a).mean() * np.square(b).mean()))
        correlation = float((a * b).mean()) / size if size > 1e-4 else 0.0
        if correlation > best[0]:
            best, error = (correlation, steps * dt), _standard_error(a, b)
    explained, lag = best
    if explained <= _SIGNIFICANT * error:
        return _STANDARD_LAG, 0.0
    return lag, explained * explained


_STANDARD_LAG = 1.2  # s, of a follower whose record does not show it


def _standard_error(a: Floats, b: Floats) -> float:
    """The standard error of the correlation of two series (n,) without one."""
    n = len(a)
    total = 1.0
    for k in range(1, n // 2):
        weight = 1.0 - k / n
        product = float((a[k:] * a[:-k]).mean() / np.square(a).mean() * (b[k:] * b[:-k]).mean() / np.square(b).mean())
        total += 2.0 * weight * weight * product
    return math.sqrt(max(total, 1.0) / n)


# --- yielders ---------------------------------------------------------------------------------------------------------


def _yields(encounter: Encounter, conflict: Conflict) -> Reaction | None:
    """The edge of the second one at a crossing to the first: it waits or slows down while that one comes, and goes behind it."""
    who, whom = conflict.second, conflict.first
    time, speed = encounter.time, encounter.speed[who]
    if conflict.following or conflict.exit_first >= time[encounter.present[whom, 1]] - 1e-9:
        return None
    stands = [wait for wait in find_waits(encounter) if wait.vehicle == who and wait.end <= conflict.entry_second + 1.0]
    if stands:
        since, until, weight = stands[-1].start, stands[-1].end, 1.0
    else:
        slow = _slows(time, speed, encounter.there[who] & (time <= conflict.entry_second))
        if slow is None:
            return None
        (since, until), weight = slow, _BENDS
    k = int(np.searchsorted(time, until))
    entry = encounter.position[who, min(int(np.searchsorted(time, conflict.entry_second)), len(time) - 1)]
    lag = until - conflict.exit_first
    near = float(np.sqrt(np.square(entry - encounter.position[who, k]).sum())) < _NEAR
    comes = since < conflict.exit_first and until < time[encounter.present[who, 1]] - 1e-9
    if not (near and comes and -ANTICIPATES <= lag <= LATEST):
        return None
    confidence = weight * _soon(lag, encounter.duration)
    if confidence < SURE:
        return None
    return Reaction(YIELD, who, whom, lag, 1.0, _OWN_LAG, confidence, since, until, stands=bool(stands))


def _slows(time: Floats, speed: Floats, before: Bools) -> tuple[float, float] | None:
    """When [s] a vehicle begins to slow down `before` (T,) something, and when it is slowest; None if it does not."""
    rows = np.flatnonzero(before)
    if len(rows) < 2:
        return None
    low = rows[int(np.argmin(speed[rows]))]
    earlier = rows[rows <= low]
    top = earlier[int(np.argmax(speed[earlier]))]
    drop = float(speed[top] - speed[low])
    if drop < _SLOWS_BY or speed[low] > _SLOWS_TO * speed[top]:
        return None
    return float(time[top]), float(time[low])


def _explained(edge: Reaction, leader: Reaction | None, encounter: Encounter) -> bool:
    """Whether a yielder stands behind its leader, who leaves shortly before it: it waits for that one."""
    if leader is None or not edge.stands or not leader.since <= edge.until <= leader.until:
        return False
    return any(wait.vehicle == leader.whom and 0.0 <= edge.until - wait.end <= LAGS[1] + 1.0 for wait in find_waits(encounter))
