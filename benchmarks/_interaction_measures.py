# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whether the vehicles of a set drive with one another: figures of each reaction of the template, and braking for nobody.

The definitions are those of docs/interaction.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenario_gen.numerics import Floats, runs
from scenario_gen.situation import conflict_of, departure, lane_gaps, passing, time_gaps
from scenario_gen.types import Motion, Reaction

EARLY, _ROUNDED = (
    0.5,
    0.15,
)  # s, by which a yielder leaves, and enters, before the other has cleared
_BRAKES, _LOSES = 0.6, 1.5  # m/s², m/s
_NEAR, _AHEAD = 12.0, 3.0  # m, s
_BENDS = 0.8  # m/s² sideways
_PATH = 2.2  # m, within which two paths meet: nearer than lanes lie beside each other
_TAILGATES, _FOR = 0.3, 0.05  # s bumper to bumper, and share of the time below it
LONG_ENOUGH = 2.0  # s in one lane
_START = 1.0  # s
_LONGEST_LAG = 4.0  # s


@dataclass(frozen=True)
class Following:
    """A following edge over a set.

    Attributes:
        slope: of the follower's mean speed on its leader's; nan where the leader's do not vary.
        gaps: 10th and 90th percentile of the median time gap over the template's.
        lag: seconds by which the follower's deviations from the set's mean are behind its leader's; nan where there are none.
        own: share of the variance of the follower's deviations that its leader's do not explain.
        edge: the reaction.
    """

    edge: Reaction
    slope: float
    gaps: tuple[float, float]
    lag: float
    own: float


@dataclass(frozen=True)
class Yielding:
    """A yielding edge over a set: share of scenarios in which it leaves early, and the mean and spread [s] of its lag."""

    edge: Reaction
    early: float
    mean: float
    spread: float


def following(edge: Reaction, template: Motion, scenarios: Sequence[Motion]) -> Following:
    """Measure a following edge over a set of two scenarios or more."""
    speeds = np.array([_mean_speeds(one, edge.whom, edge.who) for one in scenarios])
    leader, own = (speeds - speeds.mean(axis=0)).T
    square = float(np.square(leader).sum())
    slope = float((leader * own).sum()) / square if square > 1e-6 * len(leader) else np.nan
    middles = [
        float(np.median(gaps))
        for one in scenarios
        if len(gaps := time_gaps(lane_gaps(one), edge.who, edge.whom)) > 0
    ]
    base = time_gaps(lane_gaps(template), edge.who, edge.whom)
    relative = (
        np.array(middles) / float(np.median(base)) if middles and len(base) else np.array([np.nan])
    )
    low, high = np.percentile(relative, (10, 90)).tolist()
    lag, explained = _answers(edge, scenarios)
    return Following(edge, slope, (low, high), lag, 1.0 - explained)


def shared(motion: Motion) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Return (who, whom) of all who drive behind another in its lane for two seconds, and of all who meet otherwise."""
    step = float(motion.time[1] - motion.time[0])
    lanes = [
        pair
        for pair, (_, gap) in lane_gaps(motion).items()
        if np.count_nonzero(gap > 0.0) * step >= LONG_ENOUGH
    ]
    meet = [conflict_of(motion, a, b) for b in range(len(motion.vehicles)) for a in range(b)]
    others = [(one.second, one.first) for one in meet if one is not None]
    return lanes, [
        (who, whom)
        for who, whom in others
        if (who, whom) not in lanes and (whom, who) not in lanes
    ]


def tailgates(motion: Motion, who: int, whom: int) -> bool:
    """Whether one drives 5 % of its time nearer to another one than 0.3 s, bumper to bumper."""
    gaps = time_gaps(lane_gaps(motion), who, whom)
    return len(gaps) > 0 and float(np.mean(gaps < _TAILGATES)) >= _FOR


def yielding(edge: Reaction, scenarios: Sequence[Motion]) -> Yielding:
    """Measure a yielding edge over a set; a scenario in which the two do not meet, or in the other order, counts as early.

    The lag is that of the departure behind the clearing, or, of one that does not stand, of its entry.
    """
    lags, early = [], []
    for one in scenarios:
        conflict = conflict_of(one, edge.who, edge.whom)
        if conflict is None or conflict.second != edge.who:
            early.append(True)
            continue
        clears, enters = passing(one, conflict, merges=edge.merges)
        lags.append((departure(one, edge.who, enters) if edge.stands else enters) - clears)
        early.append(
            enters - clears < min(edge.gap, 0.0) - _ROUNDED
            or (edge.stands and lags[-1] < min(edge.lag, 0.0) - EARLY)
        )
    share = float(np.mean(early)) if early else np.nan
    if len(lags) < 2:
        return Yielding(edge, share, np.nan, np.nan)
    return Yielding(edge, share, float(np.mean(lags)), float(np.std(lags)))


def braking(motion: Motion, who: int) -> list[int]:
    """Return the samples at which a vehicle begins to brake: below -0.6 m/s², until more than 1.5 m/s are lost."""
    first, last = motion.present[who].tolist()
    speed = motion.speed[who, first : last + 1]
    slows = np.diff(speed) < -_BRAKES * np.diff(motion.time[first : last + 1])
    return [first + a for a, b in runs(slows) if speed[a] - speed[b] > _LOSES]


def ghosts(motion: Motion, who: int) -> int:
    """Return how often a vehicle brakes for nobody, a second or more behind the start.

    It brakes below -0.6 m/s² and loses more than 1.5 m/s; nobody is within 12 m, now or in 3 s at constant velocities, nobody
    on a path that meets its own within 3 s, and its next 6 s have no bend (0.8 m/s² sideways).
    """
    begins = [k for k in braking(motion, who) if motion.time[k] - motion.time[0] > _START]
    return len([k for k in begins if _for_nobody(motion, who, k)])


def _for_nobody(motion: Motion, who: int, k: int) -> bool:
    time = motion.time
    own, speed, yaw = motion.position[who], motion.speed[who, k], motion.heading[who]
    later = np.flatnonzero(
        (time >= time[k])
        & (time <= time[k] + 2.0 * _AHEAD)
        & (np.arange(len(time)) <= motion.present[who, 1])
    )
    turning = np.abs(np.gradient(yaw, time))[later]
    if float((motion.speed[who, later] * turning).max(initial=0.0)) > _BENDS:
        return False
    for other in range(len(motion.vehicles)):
        first, last = motion.present[other].tolist()
        if other == who or not first <= k <= last:
            continue
        between = motion.position[other, k] - own[k]
        ways = [
            motion.speed[n, k] * np.array([float(np.cos(h)), float(np.sin(h))])
            for n, h in ((other, motion.heading[other, k]), (who, yaw[k]))
        ]
        ahead = between + np.linspace(0.0, _AHEAD, 13)[:, None] * (ways[0] - ways[1])
        if np.sqrt(np.square(ahead).sum(axis=1)).min() < _NEAR:
            return False
        rows = np.arange(first, last + 1)
        apart = np.sqrt(
            np.square(own[later][:, None] - motion.position[other, rows][None]).sum(axis=-1)
        )
        soon = np.abs(time[later][:, None] - time[rows][None]) <= _AHEAD
        if (soon & (apart < _PATH)).any():
            return False
    return bool(speed > 0.0)


def _mean_speeds(motion: Motion, *who: int) -> list[float]:
    """The mean speed of each while all are there."""
    first, last = int(motion.present[list(who), 0].max()), int(motion.present[list(who), 1].min())
    return [float(motion.speed[n, first : last + 1].mean()) for n in who]


def _answers(edge: Reaction, scenarios: Sequence[Motion]) -> tuple[float, float]:
    """At which lag [s] a leader's changes of speed, beside the set's mean, explain its follower's best, and how much they do."""
    length = min(len(one.time) for one in scenarios)
    step = float(scenarios[0].time[1] - scenarios[0].time[0])
    speed = np.stack([one.speed[[edge.whom, edge.who], :length] for one in scenarios])
    change = np.diff(speed - speed.mean(axis=0), axis=2)
    best, lag = 0.0, np.nan
    for k in range(min(round(_LONGEST_LAG / step), length - 2)):
        a, b = change[:, 0, : change.shape[2] - k].ravel(), change[:, 1, k:].ravel()
        size = float(np.sqrt(np.square(a).sum() * np.square(b).sum()))
        found = float((a * b).sum()) / size if size > 1e-9 else 0.0
        if found > best:
            best, lag = found, k * step
    return lag, best * best


def pair_windows(
    time: Floats, position: Floats, speed: Floats, seconds: float = 3.5, stride: float = 1.0
) -> Floats:
    """Return the features (W, F) of all windows of a pair: distance, closing speed, speeds, accelerations and lagged products.

    Args:
        time: (T,) seconds, evenly spaced.
        position: (2, T, 2) m, speed: (2, T) m/s, of the two.
        speed: their speeds.
        seconds: length of a window; stride: seconds from one to the next.
        stride: see there.
    """
    dt = float(time[1] - time[0])
    width, step = round(seconds / dt), max(round(stride / dt), 1)
    apart = np.sqrt(np.square(position[1] - position[0]).sum(axis=1))
    closing, acceleration = -np.diff(apart) / dt, np.diff(speed, axis=1) / dt
    lags = [round(lag / dt) for lag in (0.0, 0.5, 1.0, 1.5, 2.0)]
    found = []
    for first in range(0, len(time) - width, step):
        at = slice(first, first + width)
        d, c, v, a = apart[at], closing[at], speed[:, at], acceleration[:, at]
        row = [d[0], d[-1], d.min(), c[0], c[-1], c.mean(), float(np.abs(c).max())]
        row += [value for one in v for value in (one[0], one[-1], one.mean())] + [
            v[1].mean() - v[0].mean()
        ]
        row += [value for one in a for value in (one.mean(), one.std(), one.min(), one.max())]
        for lag in lags:
            for one, other in ((0, 1), (1, 0)):
                x, y = a[one, : width - lag], a[other, lag:]
                row += [
                    float((x * y).mean()),
                    float((x * y).mean() / (np.sqrt((x * x).mean() * (y * y).mean()) + 1e-6)),
                ]
        row += [float((closing[at] * a[n]).mean()) for n in (0, 1)]
        found.append(row)
    return np.array(found)
