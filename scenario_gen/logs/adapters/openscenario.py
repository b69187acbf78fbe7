# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenSCENARIO XML, 1.0 to 1.3: the vehicles that follow polylines of world positions.

| quantity | element | unit |
|---|---|---|
| vehicle | Entities/ScenarioObject: attribute name | |
| class | Vehicle: vehicleCategory; Pedestrian: pedestrianCategory; in our files the name | |
| length, width | BoundingBox/Dimensions | m |
| time | Polyline/Vertex: time, with Timing: scale, offset; if relative, from the trigger | s |
| position | Vertex/Position/WorldPosition: x, y of the rear axle; BoundingBox/Center | m |
| heading | WorldPosition: h, counter-clockwise from +x; if missing, that of the path | rad |
| speed | property `speed_mps` of our files | m/s |

Without a time reference the vehicle's first speed counts, or else the times of the vertices.

Source: ASAM OpenSCENARIO XML 1.2.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element, read_xml
from scenario_gen.logs.adapters.openscenario_lights import read_lights
from scenario_gen.logs.adapters.openscenario_values import resolve_references
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import (
    check_size,
    check_vehicles,
    Observations,
    only_file,
    RawLog,
    Segment,
)
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import arc_lengths, place
from scenario_gen.types import Trailer, VEHICLE_TYPES

OPENSCENARIO_SPEEDS = "speed_mps"
"""Name of a vehicle's property with its speed at each vertex, which the format cannot express."""

_PRIVATE_ACTIONS = "Storyboard/Init/Actions/Private"
_FOLLOW_ACTION = "PrivateAction/RoutingAction/FollowTrajectoryAction"
_SPEED_TARGET = (
    "PrivateAction/LongitudinalAction/SpeedAction/SpeedActionTarget/AbsoluteTargetSpeed"
)
_CONDITION = "StartTrigger/ConditionGroup/Condition"
_TIME_CONDITION = "ByValueCondition/SimulationTimeCondition"
_ENTITY_CONDITION = "ByEntityCondition/EntityCondition"
_DISTANCE_STEP_S = 0.01  # at which the distance of a trigger is looked at


class _Follower(NamedTuple):
    """A vehicle that follows a trajectory from the conditions of its act and its event on."""

    vehicle: str
    action: Element
    conditions: tuple[Element, ...] = ()

    @property
    def waits_for(self) -> str:
        """The road user whose distance starts it; "" if only a time does."""
        distances = [_distance_condition(condition) for condition in self.conditions]
        names = [each.attribute("entityRef") for each in distances if each is not None]
        return names[0] if names else ""


class _Timed(NamedTuple):
    """When [s] (K,) a vehicle passes its vertices (K, 4): time, x, y, heading."""

    seconds: Floats
    vertices: Floats


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the trajectories of one scenario.

    Raises:
        InputError: the file is damaged, or no vehicle follows a readable trajectory; names the
            line.
    """
    path = only_file(paths, config)
    root = read_xml(path, str(path))
    if root.tag != "OpenSCENARIO":
        raise InputError(f"{root.place}: the root of an OpenSCENARIO file is <OpenSCENARIO>")
    resolve_references(root, path)
    notes = ["read as OpenSCENARIO"]
    vehicles = _vehicles(root, notes)
    check_vehicles(str(path), len(vehicles), config)
    speeds = _first_speeds(root)

    observations: dict[str, Observations] = {}
    n_rows = 0
    timed: dict[str, _Timed] = {}
    for follower in sorted(_followers(root), key=lambda each: bool(each.waits_for)):
        name = follower.vehicle
        if name not in vehicles or name in observations:
            continue
        try:
            timed[name] = _timed(follower, speeds.get(name, 0.0), timed)
            observed = _observations(name, timed[name], vehicles[name], n_rows)
        except InputError as error:
            notes.append(f"{name} left out: {error}")
            del vehicles[name]
            continue
        observations[name] = observed
        n_rows += len(observed.fix)
        check_size(str(path), 0, n_rows, config)
        if follower.action.find("TimeReference/Timing") is None:
            notes.append(
                f"{name} follows its trajectory without a time reference: its first speed, or the "
                "times of its vertices are used"
            )
    notes += [
        f"{name} left out: it follows no trajectory"
        for name in vehicles
        if name not in observations
    ]
    if len(observations) < min(len(vehicles) + len(notes) - 1, 2):
        only = ", ".join(observations) or "no vehicle"
        raise InputError(f"{path}: {only} has a trajectory; {'; '.join(notes[1:])}")
    are_read = config.signals == "recorded"
    signals = tuple(read_lights(root, path, notes)) if are_read else ()
    segment = Segment(0, str(path), "vertex", 1)
    return RawLog(
        path.stem,
        False,
        tuple(observations.values()),
        n_rows,
        (segment,),
        tuple(notes),
        signals=signals,
    )


def _vehicles(root: Element, notes: list[str]) -> dict[str, Element]:
    """Return the vehicles by name; notes on others are appended."""
    vehicles: dict[str, Element] = {}
    for entity in root.findall("Entities/ScenarioObject"):
        name = entity.attribute("name")
        vehicle = entity.first_of("Vehicle", "Pedestrian")
        if vehicle is None or vehicle.find("BoundingBox") is None:
            notes.append(
                f"{name} left out: it is not a road user with a bounding box, in this file or its "
                "catalogs"
            )
            continue
        vehicles[name] = vehicle
    return vehicles


def _first_speeds(root: Element) -> dict[str, float]:
    """Return the first speeds [m/s] by vehicle."""
    return {
        private.attribute("entityRef"): target.number("value")
        for private in root.findall(_PRIVATE_ACTIONS)
        for target in private.findall(_SPEED_TARGET)
    }


def _category(entity: Element) -> str:
    """Return the type of a road user in the file.

    Our own files have a more precise type as the name, if it suits the category.
    """
    key = "vehicleCategory" if entity.tag == "Vehicle" else "pedestrianCategory"
    category = str(entity.get(key, entity.tag))
    name = str(entity.get("name", ""))
    if name in VEHICLE_TYPES and VEHICLE_TYPES[name].openscenario == category:
        return name
    return category


def _followers(root: Element) -> Iterator[_Follower]:
    """Yield the vehicles that follow trajectories."""
    for private in root.findall(_PRIVATE_ACTIONS):
        for action in private.findall(_FOLLOW_ACTION):
            yield _Follower(private.attribute("entityRef"), action)
    for act in root.findall("Storyboard/Story/Act"):
        for group in act.findall("ManeuverGroup"):
            actors = [actor.attribute("entityRef") for actor in group.findall("Actors/EntityRef")]
            for event in group.findall("Maneuver/Event"):
                conditions = (*act.findall(_CONDITION), *event.findall(_CONDITION))
                actions = event.findall(f"Action/{_FOLLOW_ACTION}")
                yield from (_Follower(*pair, conditions) for pair in product(actors, actions))


def _distance_condition(condition: Element) -> Element | None:
    """Return the distance to another road user that starts an event, if this is its condition."""
    distance = condition.find(f"{_ENTITY_CONDITION}/RelativeDistanceCondition")
    if distance is None or not str(distance.get("rule")).startswith("less"):
        return None
    kind = distance.get("relativeDistanceType")
    is_direct = kind in ("euclidianDistance", "cartesianDistance")
    return distance if is_direct and distance.get("freespace") != "true" else None


def _timed(follower: _Follower, first_speed: float, others: Mapping[str, _Timed]) -> _Timed:
    """Return when a vehicle passes its vertices.

    Args:
        follower: the vehicle and its trajectory.
        first_speed: [m/s]; 0 if unknown.
        others: the vehicles whose times are known.

    Raises:
        InputError: an element is missing, the vertices have no times, or the start is unknown.
    """
    action = follower.action
    trajectory = action.find("TrajectoryRef/Trajectory")
    if trajectory is None:  # OpenSCENARIO 1.0
        trajectory = action.child("Trajectory")
    polyline = trajectory.child("Shape/Polyline").findall("Vertex")
    vertices = np.array([_vertex(vertex) for vertex in polyline])
    if len(vertices) < 2:
        raise InputError(
            f"{action.place}: its polyline has {len(vertices)} vertices; at least 2 are needed"
        )
    starts = [_start_s(each, vertices[0, 1:3], others) for each in follower.conditions]
    start_s = max(starts, default=0.0)
    return _Timed(_times(action, start_s, vertices, first_speed), vertices)


def _start_s(condition: Element, place: Floats, others: Mapping[str, _Timed]) -> float:
    """Return when [s] the condition of a vehicle that stands at a place (2,) [m] is met.

    Raises:
        InputError: it is neither a time nor the distance of a vehicle with a trajectory.
    """
    delay_s = condition.number("delay", 0.0)
    time = condition.find(_TIME_CONDITION)
    if time is not None:
        return time.number("value") + delay_s
    distance = _distance_condition(condition)
    if distance is not None and distance.attribute("entityRef") in others:
        other = others[distance.attribute("entityRef")]
        seconds = np.arange(other.seconds[0], other.seconds[-1], _DISTANCE_STEP_S)
        x, y = (np.interp(seconds, other.seconds, other.vertices[:, k]) for k in (1, 2))
        near = np.hypot(x - place[0], y - place[1]) < distance.number("value")
        if near.any():
            return float(seconds[np.argmax(near)]) + delay_s
        raise InputError(f"{distance.place}: the distance is never reached")
    kinds = [each.tag for group in condition for each in group]
    entity = condition.find(_ENTITY_CONDITION)
    kinds = kinds if entity is None else [each.tag for each in entity]
    raise InputError(
        f"{condition.place}: its trigger is {', '.join(kinds) or 'empty'}; a time, or the "
        "distance of a road user with a trajectory, is needed"
    )


def _observations(name: str, timed: _Timed, vehicle: Element, first_row: int) -> Observations:
    """Return the motion of a vehicle that follows a trajectory.

    Args:
        name: of the vehicle.
        timed: when it passes its vertices.
        vehicle: has the bounding box.
        first_row: of its vertices.
    """
    seconds, vertices = timed
    xy = vertices[:, 1:3]
    step = np.gradient(xy, axis=0)
    course = np.arctan2(step[:, 1], step[:, 0])
    heading = np.where(np.isnan(vertices[:, 3]), course, vertices[:, 3])

    box = vehicle.child("BoundingBox")
    center = box.child("Center")
    size = box.child("Dimensions")
    poses = np.column_stack((xy, heading))
    position = place(poses, center.number("x"), center.number("y"))
    speeds = _recorded_speeds(vehicle, len(vertices))
    known_speeds = np.zeros(len(vertices)) if speeds is None else speeds
    observed = Observations.of_rows(
        name,
        np.round(seconds * 1e9).astype(np.int64),
        np.column_stack((position, heading, known_speeds)),
        np.arange(first_row, first_row + len(vertices)),
        (size.number("length"), size.number("width")),
        kind=_category(vehicle),
        measured=speeds is not None,
    )
    reference = vehicle.find("Trailer/TrailerRef")
    named = reference.attribute("entityRef") if reference is not None else ""
    towed = vehicle.find("Trailer/Trailer/Vehicle")
    trailer = None if towed is None else _trailer(f"{name}_trailer", vehicle, towed)
    return replace(observed, trailer_name=named, trailer=trailer)


def _trailer(name: str, vehicle: Element, towed: Element) -> Trailer | None:
    """Return the trailer that is part of a vehicle; None if it has no bounding box."""
    if towed.find("BoundingBox") is None:
        return None
    hitch, reach = (
        _coupling(element, part, end)
        for element, part, end in ((vehicle, "TrailerHitch", -1.0), (towed, "TrailerCoupler", 1.0))
    )
    size = towed.child("BoundingBox/Dimensions")
    return Trailer(name, size.number("length"), size.number("width"), -hitch, reach)


def _coupling(vehicle: Element, part: str, end: float) -> float:
    """Return where the coupling is, from the box's centre ahead [m]; by default at its `end`."""
    place = vehicle.find(part)
    box = vehicle.child("BoundingBox")
    if place is None:
        return end * 0.5 * box.child("Dimensions").number("length")
    return place.number("dx") - box.child("Center").number("x")


def _vertex(vertex: Element) -> tuple[float, float, float, float]:
    """Return time, x, y and heading of a vertex; NaN for an unknown time or heading."""
    world = vertex.child("Position/WorldPosition")
    time = vertex.number("time", math.nan)
    return time, world.number("x"), world.number("y"), world.number("h", math.nan)


def _times(action: Element, start_s: float, vertices: Floats, first_speed: float) -> Floats:
    """Return the times [s] of vertices (K, 4), by the time reference or the first speed.

    Raises:
        InputError: they are unknown.
    """
    timing, time = action.find("TimeReference/Timing"), vertices[:, 0]
    if timing is not None:
        is_relative = timing.attribute("domainAbsoluteRelative") == "relative"
        origin = timing.number("offset") + (start_s if is_relative else 0.0)
        time = time * timing.number("scale") + origin
    elif first_speed > 0.0:
        time = start_s + arc_lengths(vertices[:, 1:3]) / first_speed
    if not np.isfinite(time).all():
        raise InputError(
            f"{action.place}: its vertices have no times, and the vehicle no first speed"
        )
    return time


def _recorded_speeds(vehicle: Element, count: int) -> Floats | None:
    """Return the speeds (K,) [m/s] in a property of our files; None if missing or damaged."""
    for entry in vehicle.findall("Properties/Property"):
        if entry.get("name") == OPENSCENARIO_SPEEDS:
            try:
                speeds = np.array(entry.attribute("value").split(), dtype=np.float64)
            except ValueError:
                return None
            return speeds if len(speeds) == count and np.isfinite(speeds).all() else None
    return None
