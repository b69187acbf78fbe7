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

from collections.abc import Iterator, Sequence
from itertools import product
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element, read_xml
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
from scenario_gen.types import VEHICLE_TYPES

OPENSCENARIO_SPEEDS = "speed_mps"
"""Name of a vehicle's property with its speed at each vertex, which the format cannot express."""

_PRIVATE_ACTIONS = "Storyboard/Init/Actions/Private"
_FOLLOW_ACTION = "PrivateAction/RoutingAction/FollowTrajectoryAction"
_SPEED_TARGET = (
    "PrivateAction/LongitudinalAction/SpeedAction/SpeedActionTarget/AbsoluteTargetSpeed"
)
_TIME_CONDITION = "StartTrigger/ConditionGroup/Condition/ByValueCondition/SimulationTimeCondition"


class _Follower(NamedTuple):
    """A vehicle that follows a trajectory from a time [s] on."""

    vehicle: str
    action: Element
    start_s: float


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
    for follower in _followers(root):
        name = follower.vehicle
        if name not in vehicles or name in observations:
            continue
        try:
            observed = _observations(follower, vehicles[name], speeds.get(name, 0.0), n_rows)
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
    if not observations:
        raise InputError(f"{path}: no vehicle has a trajectory; {'; '.join(notes[1:])}")
    segment = Segment(0, str(path), "vertex", 1)
    return RawLog(path.stem, False, tuple(observations.values()), n_rows, (segment,), tuple(notes))


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
        notes += [
            f"trailer {trailer.attribute('name')} left out: it is part of {name}"
            for trailer in vehicle.findall("Trailer/Trailer")
        ]
        notes += [
            f"trailer {trailer.attribute('entityRef')} belongs to {name}: read as a separate "
            "road user"
            for trailer in vehicle.findall("Trailer/TrailerRef")
        ]
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
            yield _Follower(private.attribute("entityRef"), action, 0.0)
    for group in root.findall("Storyboard/Story/Act/ManeuverGroup"):
        actors = [actor.attribute("entityRef") for actor in group.findall("Actors/EntityRef")]
        for event in group.findall("Maneuver/Event"):
            conditions = event.findall(_TIME_CONDITION)
            start_s = conditions[0].number("value") if conditions else 0.0
            actions = event.findall(f"Action/{_FOLLOW_ACTION}")
            yield from (_Follower(*pair, start_s) for pair in product(actors, actions))


def _observations(
    follower: _Follower, vehicle: Element, first_speed: float, first_row: int
) -> Observations:
    """Return the motion of a vehicle that follows a trajectory.

    Args:
        follower: the vehicle's name, and the action.
        vehicle: has the bounding box.
        first_speed: [m/s]; 0 if unknown.
        first_row: of its vertices.

    Raises:
        InputError: an element is missing, or the vertices have no times.
    """
    action = follower.action
    trajectory = action.find("TrajectoryRef/Trajectory")
    if trajectory is None:  # OpenSCENARIO 1.0
        trajectory = action.child("Trajectory")
    vertices = np.array(
        [_vertex(vertex) for vertex in trajectory.child("Shape/Polyline").findall("Vertex")]
    )
    if len(vertices) < 2:
        raise InputError(
            f"{action.place}: its polyline has {len(vertices)} vertices; at least 2 are needed"
        )
    xy = vertices[:, 1:3]
    step = np.gradient(xy, axis=0)
    course = np.arctan2(step[:, 1], step[:, 0])
    heading = np.where(np.isnan(vertices[:, 3]), course, vertices[:, 3])
    seconds = _times(follower, vertices[:, 0], xy, first_speed)

    box = vehicle.child("BoundingBox")
    center = box.child("Center")
    size = box.child("Dimensions")
    poses = np.column_stack((xy, heading))
    position = place(poses, center.number("x"), center.number("y"))
    speeds = _recorded_speeds(vehicle, len(vertices))
    known_speeds = np.zeros(len(vertices)) if speeds is None else speeds
    return Observations.of_rows(
        follower.vehicle,
        np.round(seconds * 1e9).astype(np.int64),
        np.column_stack((position, heading, known_speeds)),
        np.arange(first_row, first_row + len(vertices)),
        (size.number("length"), size.number("width")),
        kind=_category(vehicle),
        measured=speeds is not None,
    )


def _vertex(vertex: Element) -> tuple[float, float, float, float]:
    """Return time, x, y and heading of a vertex; NaN for an unknown time or heading."""
    world = vertex.child("Position/WorldPosition")
    time = vertex.number("time", math.nan)
    return time, world.number("x"), world.number("y"), world.number("h", math.nan)


def _times(follower: _Follower, time: Floats, xy: Floats, first_speed: float) -> Floats:
    """Return the times [s] of vertices (K,), by the time reference or the first speed.

    Raises:
        InputError: they are unknown.
    """
    timing = follower.action.find("TimeReference/Timing")
    if timing is not None:
        is_relative = timing.attribute("domainAbsoluteRelative") == "relative"
        origin = timing.number("offset") + (follower.start_s if is_relative else 0.0)
        time = time * timing.number("scale") + origin
    elif first_speed > 0.0:
        distance = arc_lengths(xy)
        time = follower.start_s + distance / first_speed
    if not np.isfinite(time).all():
        raise InputError(
            f"{follower.action.place}: its vertices have no times, and the vehicle no first speed"
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
