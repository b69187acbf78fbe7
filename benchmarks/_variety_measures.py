# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""PET, arrival gap and time to collision once more, by other means: sampled footprints and shapely, nothing of the product."""

from itertools import combinations
from typing import Any

import numpy as np
import shapely

from benchmarks._recheck_motion import boxes_at
from scenario_gen.types.scenario import Scenario

STEP = 0.01  # s, between the footprints that are looked at
HORIZON = 3.0  # s, to which a time to collision is followed
SHARED = 3.0  # lengths of a vehicle; who shares a longer stretch with another one in the same direction follows


def pet(scenario: Scenario) -> float:
    """Return the least PET [s] of all crossing pairs; NaN without one."""
    return min(
        (
            found[0]
            for pair in _pairs(scenario)
            if (found := _crossing(scenario, *pair)) is not None
        ),
        default=float("nan"),
    )


def ttc(scenario: Scenario) -> float:
    """Return the least time to collision [s] of all pairs while both keep their velocities; inf beyond the horizon."""
    least = np.inf
    for a, b in _pairs(scenario):
        together = np.flatnonzero(scenario.there[a] & scenario.there[b])
        for k in together.tolist():
            least = min(least, _time(scenario, a, b, k, min(least, HORIZON)))
    return float(least)


def _pairs(scenario: Scenario) -> list[tuple[int, int]]:
    return list(combinations(range(len(scenario.vehicles)), 2))


def _half(scenario: Scenario, n: int, count: int) -> Any:
    return np.tile(
        [0.5 * scenario.vehicles[n].length, 0.5 * scenario.vehicles[n].width], (count, 1)
    )


def _boxes(scenario: Scenario, n: int) -> tuple[Any, Any]:
    """Instants and footprints of a vehicle while it is there, evenly spaced."""
    first, last = scenario.time[scenario.present[n]]
    time = np.linspace(first, last, max(2, int((last - first) / STEP)))
    rows = (scenario.position[n, :, 0], scenario.position[n, :, 1], scenario.heading[n])
    poses = np.column_stack([np.interp(time, scenario.time, row) for row in rows])
    return time, boxes_at(poses, _half(scenario, n, len(time)))


def _crossing(scenario: Scenario, a: int, b: int) -> tuple[float, float] | None:
    """PET and arrival gap [s] of two vehicles; None if they do not cross or merge."""
    times, inside = [], []
    boxes = {n: _boxes(scenario, n) for n in (a, b)}
    for one, two in ((a, b), (b, a)):
        sweep = shapely.union_all(boxes[two][1][::5])
        shapely.prepare(sweep)
        time, own = boxes[one]
        hit = np.flatnonzero(shapely.intersects(sweep, own))
        if not len(hit):
            return None
        times.append((time[hit[0]], time[hit[-1]]))
        inside.append(hit)
    if _follows(scenario, a, b):
        return None
    (in_a, out_a), (in_b, out_b) = times
    return (in_b - out_a, in_b - in_a) if in_a <= in_b else (in_a - out_b, in_a - in_b)


def _follows(scenario: Scenario, a: int, b: int) -> bool:
    """Whether a drives more than SHARED lengths where b does, in the same direction."""
    longest = max(scenario.vehicles[n].length for n in (a, b))
    width = 0.5 * (scenario.vehicles[a].width + scenario.vehicles[b].width)
    line = shapely.linestrings(scenario.position[b])
    shared = 0.0
    steps = np.hypot(*np.diff(scenario.position[a], axis=0).T)
    for k in np.flatnonzero(steps > 1e-3).tolist():
        point = shapely.points(scenario.position[a, k + 1])
        near = int(np.argmin(np.hypot(*(scenario.position[b] - scenario.position[a, k + 1]).T)))
        turned = abs(
            (scenario.heading[a, k + 1] - scenario.heading[b, near] + np.pi) % (2.0 * np.pi)
            - np.pi
        )
        if turned < 0.5 and shapely.distance(line, point) < width:
            shared += float(steps[k])
    return shared >= SHARED * longest


def _time(scenario: Scenario, a: int, b: int, k: int, most: float) -> float:
    """Time [s] until two footprints touch from instant k on, by conservative advancement; inf if it is more than `most`."""
    pair = [a, b]
    pose = np.column_stack([scenario.position[pair, k], scenario.heading[pair, k]])
    ways = scenario.speed[pair, k, None] * np.column_stack(
        [np.cos(pose[:, 2]), np.sin(pose[:, 2])]
    )
    relative = float(np.hypot(*(ways[0] - ways[1])))
    half = np.concatenate([_half(scenario, n, 1) for n in pair])
    if relative < 1e-6:
        return float("inf")
    passed = 0.0
    for _ in range(200):
        moved = pose.copy()
        moved[:, :2] += passed * ways
        one, two = boxes_at(moved, half)
        gap = float(shapely.distance(one, two))
        if gap < 1e-3:
            return passed
        passed += gap / relative
        if passed > most:
            break
    return float("inf")
