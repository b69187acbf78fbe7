# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""An independent re-check of scenarios, written differently from the checker: many instants, shapely polygons, splines.

It proves nothing (an instant between two of its own goes unseen), but shares no line with what it checks.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import combinations

import numpy as np
from scipy.interpolate import CubicHermiteSpline
import shapely

from scenario_gen.method.validity import Limits
from scenario_gen.numerics.arrays import Floats
from scenario_gen.template.interaction import Conflict, Wait
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates, Scenario

EDGE = 1e-6  # m, a footprint is shrunk by this before it is compared with the road
SLIVER = 1e-4  # m², a shared area smaller than this is no reliable conflict


@lru_cache(maxsize=8)
def drivable_area(road: Road) -> shapely.Geometry:
    """Union of all drivable cells, each run of a row as one rectangle, prepared."""
    boxes = []
    for row, cells in enumerate(road.drivable):
        edges = np.flatnonzero(np.diff(np.concatenate(([0], cells.astype(int), [0]))))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            x, y = (
                road.origin + road.resolution * np.array((begin, row)),
                road.origin + road.resolution * np.array((end, row + 1)),
            )
            boxes.append(shapely.box(*x, *y))
    area = shapely.union_all(boxes)
    shapely.prepare(area)
    return area


def footprints(position: Floats, heading: Floats, length: float, width: float) -> np.ndarray:
    """(M,) polygons at positions (M, 2) and headings (M,)."""
    ahead = np.stack((np.cos(heading), np.sin(heading)), axis=-1) * 0.5 * length
    aside = np.stack((-np.sin(heading), np.cos(heading)), axis=-1) * 0.5 * width
    corners = np.stack((ahead + aside, aside - ahead, -ahead - aside, ahead - aside), axis=1) + position[:, None]
    return shapely.polygons(corners)


def motion_at(scenario: Scenario, instants: Floats) -> tuple[Floats, Floats, Floats]:
    """Positions (N, M, 2), headings (N, M) and velocities (N, M, 2) at instants (M,) of the motion that `Scenario` defines."""
    direction = np.stack((np.cos(scenario.heading), np.sin(scenario.heading)), axis=-1)
    spline = CubicHermiteSpline(scenario.time, scenario.position, scenario.speed[..., None] * direction, axis=1)
    heading = np.array([np.interp(instants, scenario.time, row) for row in scenario.heading])
    return spline(instants), heading, spline(instants, 1)


def boxes_at(scenario: Scenario, instants: Floats) -> list[np.ndarray]:
    """For each vehicle its footprints (M,) at the instants."""
    position, heading, _ = motion_at(scenario, instants)
    return [footprints(position[i], heading[i], vehicle.length, vehicle.width) for i, vehicle in enumerate(scenario.vehicles)]


def oracle_violations(
    scenario: Scenario,
    road: Road | None,
    asked: BoundaryStates | None,
    conflicts: Sequence[Conflict] | None,
    waits: Sequence[Wait] | None,
    limits: Limits | None = None,
    dt: float = 0.005,
) -> list[str]:
    """Return a sentence for each thing wrong with `scenario` at instants at most `dt` [s] apart; None skips a check."""
    limits = limits or Limits()
    if not scenario.all_present:
        return list(_while_there(scenario, road, asked, conflicts or (), waits or (), limits, dt))
    fields = (scenario.time, scenario.position, scenario.heading, scenario.speed, scenario.acceleration)
    if not all(np.isfinite(values).all() for values in fields) or not (np.diff(scenario.time) > 0).all():
        return ["not_finite: a value is not finite or time does not increase"]
    count = int(np.ceil((scenario.time[-1] - scenario.time[0]) / dt)) + 1
    instants = np.union1d(np.linspace(scenario.time[0], scenario.time[-1], count), scenario.time)
    position, heading, velocity = motion_at(scenario, instants)
    boxes = boxes_at(scenario, instants)
    return [
        *_overlaps(instants, boxes, limits),
        *(_off_road(instants, position, heading, scenario, road) if road is not None else ()),
        *(_boundary(scenario, asked, limits) if asked is not None else ()),
        *_kinematics(scenario, velocity, limits),
        *_orders(instants, position, boxes, conflicts or ()),
        *_stands(scenario, instants, velocity, asked, waits or (), limits),
    ]


def _while_there(scenario, road, asked, conflicts, waits, limits, dt):
    """Each vehicle, and each pair that is there throughout, as a scenario of its own; gaps of pairs beyond their presence."""
    yield from _overlaps_of_those_there(scenario, limits, dt)
    always = [i for i, (first, last) in enumerate(scenario.present) if (first, last) == (0, len(scenario.time) - 1)]
    for rows in [[i] for i in range(len(scenario.vehicles))] + [list(p) for p in combinations(range(len(scenario.vehicles)), 2)]:
        if len(rows) == 2 and not set(rows) <= set(always):
            continue
        first, last = scenario.present[rows[0]]
        own = slice(first, last + 1)
        values = (getattr(scenario, name)[rows, own] for name in ("position", "heading", "speed", "acceleration"))
        part = Scenario(tuple(scenario.vehicles[i] for i in rows), scenario.time[own], *values)
        if len(rows) == 2:
            both = [
                replace(c, first=rows.index(c.first), second=rows.index(c.second))
                for c in conflicts
                if {c.first, c.second} == set(rows)
            ]
            without_gaps = (found for found in oracle_violations(part, None, None, both, None, limits, dt) if found[:4] != "over")
            yield from without_gaps
            continue
        states = None if asked is None else BoundaryStates(asked.start[rows], asked.end[rows], asked.relaxed[rows])
        wide = limits
        if rows[0] not in always:  # it comes and goes between two instants
            step = np.diff(part.time).max()
            far, off = step * part.speed.max(), step * np.abs(part.acceleration).max()
            wide = replace(
                limits, position_tolerance=limits.position_tolerance + far, speed_tolerance=limits.speed_tolerance + off
            )
        alone = [
            replace(wait, vehicle=0, start=0.0 if wait.start == part.time[0] else wait.start)
            for wait in waits
            if wait.vehicle == rows[0]
        ]
        yield from oracle_violations(part, road, states, None, alone, wide, dt)


def _overlaps_of_those_there(scenario, limits, dt):
    """Pairs while both are there, each for `presence_margin` more than it is shown, as far as the scenario has instants."""
    time, wide = scenario.time, []
    for first, last in scenario.present:
        before = time[time < time[first] - limits.presence_margin + 1e-9]  # the margin is whole: it ends at an instant, or later
        after = time[time > time[last] + limits.presence_margin - 1e-9]
        wide.append((before[-1] if len(before) else time[0], after[0] if len(after) else time[-1]))
    for i, j in combinations(range(len(scenario.vehicles)), 2):
        begin, end = max(wide[i][0], wide[j][0]), min(wide[i][1], wide[j][1])
        if end < begin:
            continue
        grid = time[(time >= begin) & (time <= end)]
        instants = np.union1d(np.linspace(begin, end, int(np.ceil((end - begin) / dt)) + 1), grid)
        boxes = [boxes_beyond(scenario, n, instants) for n in (i, j)]
        for sentence in _overlaps(instants, boxes, limits):
            yield sentence.replace("vehicles 0 and 1", f"vehicles {i} and {j}")


def boxes_beyond(scenario, n, instants):
    """Footprints of a vehicle, which drives on along a circle before and after it is shown."""
    first, last = scenario.present[n]
    time, heading, speed = (values[first : last + 1] for values in (scenario.time, scenario.heading[n], scenario.speed[n]))
    direction = np.stack((np.cos(heading), np.sin(heading)), axis=-1)
    spline = CubicHermiteSpline(time, scenario.position[n, first : last + 1], speed[:, None] * direction)
    place, yaw = spline(np.clip(instants, time[0], time[-1])), np.interp(instants, time, heading)
    for end, inner, beyond in ((0, 1, instants < time[0]), (-1, -2, instants > time[-1])):
        rate = (heading[end] - heading[inner]) / (time[end] - time[inner])
        for k in np.flatnonzero(beyond):
            fine = np.linspace(time[end], instants[k], 401)
            turned = heading[end] + rate * (fine - time[end])
            place[k] += speed[end] * np.trapezoid(np.stack((np.cos(turned), np.sin(turned))), fine)
            yaw[k] = turned[-1]
    return footprints(place, yaw, scenario.vehicles[n].length, scenario.vehicles[n].width)


def _overlaps(instants, boxes, limits):
    for i, j in combinations(range(len(boxes)), 2):
        if limits.min_clearance > 0:
            bad = shapely.distance(boxes[i], boxes[j]) <= limits.min_clearance
        else:
            bad = shapely.intersects(boxes[i], boxes[j])
        if bad.any():
            k = int(np.argmax(bad))
            yield f"overlap: vehicles {i} and {j} at {instants[k]:.3f} s, for {bad.sum()} instants"


def _off_road(instants, position, heading, scenario, road):
    area = drivable_area(road)
    for i, vehicle in enumerate(scenario.vehicles):
        inside = shapely.covers(area, footprints(position[i], heading[i], vehicle.length - 2 * EDGE, vehicle.width - 2 * EDGE))
        if not inside.all():
            k = int(np.argmin(inside))
            yield f"off_road: vehicle {i} at {instants[k]:.3f} s, for {(~inside).sum()} instants"


def _boundary(scenario, asked, limits):
    for name, k, states in (("start", 0, asked.start), ("end", -1, asked.end)):
        for i in range(len(scenario.vehicles)):
            free, faster = asked.relaxed[i, k]
            if np.linalg.norm(scenario.position[i, k] - states[i, :2]) > limits.position_tolerance + free + 1e-6:
                yield f"boundary_state: vehicle {i} {name} position"
            if abs(scenario.speed[i, k] - states[i, 3]) > limits.speed_tolerance + faster + 1e-6:
                yield f"boundary_state: vehicle {i} {name} speed"


def _kinematics(scenario, velocity, limits):
    h = np.diff(scenario.time)
    for i, vehicle in enumerate(scenario.vehicles):
        own = limits.of(vehicle.type)
        speed, turn = scenario.speed[i], np.abs(np.diff(scenario.heading[i]))
        rate = np.diff(speed) / h
        if speed.min() < 0 or speed.max() > own.max_speed + 1e-5:
            yield f"speed: vehicle {i} from {speed.min():.3f} to {speed.max():.3f} m/s"
        if np.linalg.norm(velocity[i], axis=-1).max() > own.max_speed + 1e-5:
            yield f"speed: vehicle {i} between samples"
        for a in (scenario.acceleration[i], rate):
            if a.max() > own.max_acceleration + 1e-5 or a.min() < -own.max_deceleration - 1e-5:
                yield f"longitudinal_acceleration: vehicle {i} from {a.min():.3f} to {a.max():.3f} m/s²"
        if (np.maximum(speed[1:], speed[:-1]) * turn / h).max() > own.max_lateral_acceleration + 1e-5:
            yield f"lateral_acceleration: vehicle {i}"
        chord = np.diff(np.diff(scenario.position[i], axis=0) / h[:, None], axis=0) / (0.5 * (h[1:] + h[:-1]))[:, None]
        if (
            np.abs(chord[:, 1] * np.cos(scenario.heading[i, 1:-1]) - chord[:, 0] * np.sin(scenario.heading[i, 1:-1])).max(
                initial=0.0
            )
            > own.max_lateral_acceleration + limits.acceleration_tolerance + 1e-5
        ):
            yield f"lateral_acceleration: vehicle {i} by its positions"
        length = np.linalg.norm(np.diff(scenario.position[i], axis=0), axis=-1)
        if (turn > np.minimum(own.sharpest, 1e9) * length + 1.1e-4).any():
            yield f"curvature: vehicle {i}"


def _orders(instants, position, boxes, conflicts):
    for asked in conflicts:
        a, b = asked.first, asked.second
        step = max(1, instants.size // 400)
        sweeps = [shapely.union_all(boxes[i][::step]) for i in (a, b)]
        shared = shapely.intersection(*sweeps)
        if shared.area < SLIVER:
            continue
        entry = []
        for i, sweep in ((a, sweeps[1]), (b, sweeps[0])):
            entry.append(instants[_first_inside(boxes[i], sweep)])
        late = entry[0] > entry[1] + 0.05
        if late and not (asked.following and _leads(instants[::step], position[a, ::step], position[b, ::step])):
            yield f"passing_order: vehicle {a} enters at {entry[0]:.2f} s, vehicle {b} at {entry[1]:.2f} s"


def _first_inside(boxes, sweep):
    """Index of the first box that shares more than a sliver with `sweep`; areas are costly, so a few at a time."""
    shapely.prepare(sweep)
    touching = np.flatnonzero(shapely.intersects(boxes, sweep))
    for some in np.array_split(touching, max(1, touching.size // 16)):
        inside = some[shapely.area(shapely.intersection(boxes[some], sweep)) > 0.1 * SLIVER]
        if inside.size:
            return int(inside[0])
    return 0


def _leads(instants, first, second):
    """Whether `first` passes most of the places that both pass before `second` does."""
    distance = np.linalg.norm(first[:, None] - second[None], axis=-1)
    nearest = distance.argmin(axis=1)
    near = distance.min(axis=1) < 2.0
    return bool(np.sum(np.sign(instants[nearest] - instants)[near]) >= 0)


def _stands(scenario, instants, velocity, asked, waits, limits):
    for i in sorted({wait.vehicle for wait in waits}):
        own = [wait for wait in waits if wait.vehicle == i]
        for wanted, limit in ((len(own), limits.creep_speed), (sum(not wait.moves_slowly for wait in own), limits.stand_speed)):
            slow = np.interp(instants, scenario.time, scenario.speed[i]) < limit
            slow &= np.linalg.norm(velocity[i], axis=-1) < 2.0 * limit
            edges = np.flatnonzero(np.diff(np.concatenate(([False], slow, [False]))))
            lengths = [instants[end - 1] - instants[begin] for begin, end in zip(edges[::2], edges[1::2], strict=True)]
            if sum(int((length + 0.011) / limits.stand_duration) for length in lengths) < wanted:
                yield f"stop_not_kept: vehicle {i} is slow {len(lengths)} time(s), {sum(lengths):.2f} s in all; {wanted} asked"
        throughout = any(wait.vehicle == i and wait.start == 0 for wait in waits)
        if throughout and asked is not None and np.linalg.norm(asked.end[i, :2] - asked.start[i, :2]) < 1e-3 and not slow.all():
            yield f"stop_not_kept: vehicle {i} waits throughout but moves"
