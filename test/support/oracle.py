# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Brute force for the checker's tests: footprints as shapely's polygons at many instants of a spline.

It proves nothing (an instant between two of its own goes unseen), but shares no line with what it checks.
"""

from functools import lru_cache
from itertools import combinations

import numpy as np
from scipy.interpolate import CubicHermiteSpline
import shapely

from scenario_gen.method.validity import Limits
from scenario_gen.numerics.arrays import Floats
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import Scenario

EDGE = 1e-6  # m, a footprint is shrunk by this before it is compared with the road


@lru_cache(maxsize=8)
def drivable_area(road: Road) -> shapely.Geometry:
    """Union of all drivable cells, each run of a row as one rectangle, prepared."""
    boxes = []
    for row, cells in enumerate(road.drivable):
        edges = np.flatnonzero(np.diff(np.concatenate(([0], cells.astype(int), [0]))))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            x = road.origin + road.resolution * np.array((begin, row))
            y = road.origin + road.resolution * np.array((end, row + 1))
            boxes.append(shapely.box(*x, *y))
    area = shapely.union_all(boxes)
    shapely.prepare(area)
    return area


def footprints(position: Floats, heading: Floats, length: float, width: float) -> np.ndarray:
    """(M,) polygons at positions (M, 2) and headings (M,)."""
    ahead = np.stack((np.cos(heading), np.sin(heading)), axis=-1) * 0.5 * length
    aside = np.stack((-np.sin(heading), np.cos(heading)), axis=-1) * 0.5 * width
    corners = (
        np.stack((ahead + aside, aside - ahead, -ahead - aside, ahead - aside), axis=1)
        + position[:, None]
    )
    return shapely.polygons(corners)


def boxes_at(scenario: Scenario, instants: Floats) -> list[np.ndarray]:
    """For each vehicle its footprints (M,) at the instants."""
    return [boxes_beyond(scenario, n, instants) for n in range(len(scenario.vehicles))]


def instants_from(scenario: Scenario, begin: float, end: float, dt: float) -> Floats:
    """Instants at most `dt` [s] apart, those of the scenario among them."""
    own = scenario.time[(scenario.time >= begin) & (scenario.time <= end)]
    return np.union1d(np.linspace(begin, end, int(np.ceil((end - begin) / dt)) + 1), own)


def overlapping(scenario: Scenario, limits: Limits, dt: float) -> set[tuple[int, int]]:
    """Pairs that meet while both are there, each for `presence_margin` more than it is shown, as far as there are instants."""
    time, wide = scenario.time, []
    for first, last in scenario.present:
        before = time[
            time < time[first] - limits.presence_margin + 1e-9
        ]  # the margin is whole: it ends at an instant, or later
        after = time[time > time[last] + limits.presence_margin - 1e-9]
        wide.append((before[-1] if len(before) else time[0], after[0] if len(after) else time[-1]))
    found = set()
    for i, j in combinations(range(len(scenario.vehicles)), 2):
        begin, end = max(wide[i][0], wide[j][0]), min(wide[i][1], wide[j][1])
        if begin <= end:
            instants = instants_from(scenario, begin, end, dt)
            if shapely.intersects(*(boxes_beyond(scenario, n, instants) for n in (i, j))).any():
                found.add((i, j))
    return found


def off_road(scenario: Scenario, road: Road, dt: float) -> set[int]:
    """Vehicles that leave the road; all are there throughout."""
    instants = instants_from(scenario, scenario.time[0], scenario.time[-1], dt)
    boxes = (boxes_beyond(scenario, n, instants, EDGE) for n in range(len(scenario.vehicles)))
    return {n for n, own in enumerate(boxes) if not shapely.covers(drivable_area(road), own).all()}


def boxes_beyond(scenario: Scenario, n: int, instants: Floats, edge: float = 0.0) -> np.ndarray:
    """Footprints (M,) of a vehicle, smaller by `edge` on each side; before and after it is shown it drives on along a circle."""
    first, last = scenario.present[n]
    time, heading, speed = (
        values[first : last + 1]
        for values in (scenario.time, scenario.heading[n], scenario.speed[n])
    )
    direction = np.stack((np.cos(heading), np.sin(heading)), axis=-1)
    spline = CubicHermiteSpline(
        time, scenario.position[n, first : last + 1], speed[:, None] * direction
    )
    place, yaw = spline(np.clip(instants, time[0], time[-1])), np.interp(instants, time, heading)
    for end, inner, beyond in ((0, 1, instants < time[0]), (-1, -2, instants > time[-1])):
        rate = (heading[end] - heading[inner]) / (time[end] - time[inner])
        for k in np.flatnonzero(beyond):
            fine = np.linspace(time[end], instants[k], 401)
            turned = heading[end] + rate * (fine - time[end])
            place[k] += speed[end] * np.trapezoid(np.stack((np.cos(turned), np.sin(turned))), fine)
            yaw[k] = turned[-1]
    return footprints(
        place, yaw, scenario.vehicles[n].length - 2 * edge, scenario.vehicles[n].width - 2 * edge
    )
