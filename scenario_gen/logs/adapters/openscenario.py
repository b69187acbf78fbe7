# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenSCENARIO XML, 1.0 to 1.3: the vehicles that follow polylines of world positions.

| quantity | element | unit |
|---|---|---|
| vehicle | Entities/ScenarioObject: attribute name | |
| class | Vehicle: vehicleCategory; Pedestrian: pedestrianCategory; in our own files the name | |
| length, width | BoundingBox/Dimensions | m |
| time | Polyline/Vertex: time, by Timing: scale, offset; relative ones from when the event's trigger fires | s |
| position | Vertex/Position/WorldPosition: x, y of the rear axle, from which BoundingBox/Center says where the middle is | m |
| heading | WorldPosition: h, counter-clockwise from +x; that of the path where it is missing | rad |
| speed | our own files' property `speed_mps` | m/s |

Without a time reference the first speed of the vehicle, else the vertices' times, count.

Source: ASAM OpenSCENARIO XML 1.2.
"""

from collections.abc import Iterator, Sequence
import math
from pathlib import Path

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
from scenario_gen.numerics.plane import edge_lengths, place
from scenario_gen.types import VEHICLE_TYPES

OPENSCENARIO_SPEEDS = "speed_mps"
"""Name of a vehicle's property that holds its speed at each vertex, for which the format has no place."""
_FOLLOWS = "PrivateAction/RoutingAction/FollowTrajectoryAction"


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the trajectories of one scenario.

    Raises:
        InputError: it is broken, or no vehicle follows a trajectory that can be read; names file and line.
    """
    path = only_file(paths, config)
    root = read_xml(path, str(path))
    if root.tag != "OpenSCENARIO":
        raise InputError(f"{root.place}: the root of an OpenSCENARIO file is <OpenSCENARIO>")
    resolve_references(root, path)
    notes = ["read as OpenSCENARIO"]
    vehicles = _vehicles(root, notes)
    check_vehicles(str(path), len(vehicles), config)
    speeds = {
        private.attribute("entityRef"): target.number("value")
        for private in root.findall("Storyboard/Init/Actions/Private")
        for target in private.findall(
            "PrivateAction/LongitudinalAction/SpeedAction/SpeedActionTarget/AbsoluteTargetSpeed"
        )
    }
    seen: dict[str, Observations] = {}
    rows = 0
    for name, follow, start in _followers(root):
        if name not in vehicles or name in seen:
            continue
        try:
            seen[name] = _observations(
                follow, name, vehicles[name], start, (speeds.get(name, 0.0), rows)
            )
        except InputError as error:
            notes.append(f"{name} left out: {error}")
            del vehicles[name]
            continue
        rows += len(seen[name].fix)
        check_size(str(path), 0, rows, config)
        if follow.find("TimeReference/Timing") is None:
            notes.append(
                f"{name} follows its trajectory without a time reference: its first speed, or its vertices' times count"
            )
    notes += [
        f"{name} left out: it follows no trajectory" for name in vehicles if name not in seen
    ]
    if not seen:
        raise InputError(f"{path}: no vehicle with a trajectory in it; {'; '.join(notes[1:])}")
    return RawLog(
        path.stem,
        False,
        tuple(seen.values()),
        rows,
        (Segment(0, str(path), "vertex", 1),),
        tuple(notes),
    )


def _vehicles(root: Element, notes: list[str]) -> dict[str, Element]:
    """Return the vehicles by name; who is none that is read is noted."""
    vehicles: dict[str, Element] = {}
    for entity in root.findall("Entities/ScenarioObject"):
        name, vehicle = entity.attribute("name"), entity.first_of("Vehicle", "Pedestrian")
        if vehicle is None or vehicle.find("BoundingBox") is None:
            notes.append(
                f"{name} left out: it is no road user with a bounding box in this file or its catalogs"
            )
        else:
            vehicles[name] = vehicle
            notes += [
                f"trailer {one.attribute('name')} of {name} left out: it is part of it"
                for one in vehicle.findall("Trailer/Trailer")
            ]
            parts = vehicle.findall("Trailer/TrailerRef")
            notes += [
                f"trailer {one.attribute('entityRef')} belongs to {name}: read as a road user by itself"
                for one in parts
            ]
    return vehicles


def _category(entity: Element) -> str:
    """Return what a file calls the type of a road user: its name where that is a type of the category, as in our own files."""
    named = entity.get("name", "")
    key = {"Vehicle": "vehicleCategory", "Pedestrian": "pedestrianCategory"}[entity.tag]
    category = str(entity.get(key, entity.tag))
    return (
        named
        if named in VEHICLE_TYPES and VEHICLE_TYPES[named].openscenario == category
        else category
    )


def _followers(root: Element) -> Iterator[tuple[str, Element, float]]:
    """Yield who follows a trajectory, the action, and the second at which it begins; 0 where that is no matter of time."""
    for private in root.findall("Storyboard/Init/Actions/Private"):
        yield from (
            (private.attribute("entityRef"), follow, 0.0) for follow in private.findall(_FOLLOWS)
        )
    for group in root.findall("Storyboard/Story/Act/ManeuverGroup"):
        for event in group.findall("Maneuver/Event"):
            conditions = event.findall(
                "StartTrigger/ConditionGroup/Condition/ByValueCondition/SimulationTimeCondition"
            )
            start = conditions[0].number("value") if conditions else 0.0
            for follow in event.findall(f"Action/{_FOLLOWS}"):
                yield from (
                    (actor.attribute("entityRef"), follow, start)
                    for actor in group.findall("Actors/EntityRef")
                )


def _observations(
    follow: Element, name: str, vehicle: Element, start: float, given: tuple[float, int]
) -> Observations:
    """Return where a vehicle is that follows a trajectory.

    Args:
        follow: the action.
        name: of the vehicle.
        vehicle: with its bounding box.
        start: seconds at which the action begins.
        given: its first speed [m/s], 0 if it has none; the row of its first vertex.
    """
    trajectory = follow.find("TrajectoryRef/Trajectory")
    if trajectory is None:  # OpenSCENARIO 1.0
        trajectory = follow.child("Trajectory")
    rows = []
    for vertex in trajectory.child("Shape/Polyline").findall("Vertex"):
        world = vertex.child("Position/WorldPosition")
        rows.append(
            (
                vertex.number("time", math.nan),
                world.number("x"),
                world.number("y"),
                world.number("h", math.nan),
            )
        )
    if len(rows) < 2:
        raise InputError(
            f"{follow.place}: its polyline has {len(rows)} vertices; at least 2 are needed"
        )
    (time, x, y, heading), (speed, first) = np.array(rows).T, given
    xy, timing = np.column_stack((x, y)), follow.find("TimeReference/Timing")
    if timing is not None:
        from_start = start if timing.attribute("domainAbsoluteRelative") == "relative" else 0.0
        time = time * timing.number("scale") + timing.number("offset") + from_start
    elif speed > 0.0:
        time = start + np.concatenate(([0.0], np.cumsum(edge_lengths(xy)))) / speed
    if not np.isfinite(time).all():
        raise InputError(
            f"{follow.place}: its vertices have no times, and the vehicle has no first speed"
        )
    step = np.gradient(xy, axis=0)
    heading = np.where(np.isnan(heading), np.arctan2(step[:, 1], step[:, 0]), heading)
    center, size = vehicle.child("BoundingBox/Center"), vehicle.child("BoundingBox/Dimensions")
    middle = place(np.column_stack((xy, heading)), center.number("x"), center.number("y"))
    speeds = _own_speeds(vehicle, len(rows))
    states = np.column_stack(
        (middle, heading, speeds if speeds is not None else np.zeros(len(rows)))
    )
    return Observations.of_rows(
        name, np.round(time * 1e9).astype(np.int64), states, np.arange(first, first + len(rows)),
        (size.number("length"), size.number("width")), kind=_category(vehicle), measured=speeds is not None,
    )  # fmt: skip


def _own_speeds(vehicle: Element, count: int) -> Floats | None:
    """Return the speeds (K,) [m/s] that a file of ours has as a property; None if it has none, damaged ones or not so many."""
    for own in vehicle.findall("Properties/Property"):
        if own.get("name") == OPENSCENARIO_SPEEDS:
            try:
                speeds = np.array(own.attribute("value").split(), dtype=np.float64)
            except ValueError:
                return None
            return speeds if len(speeds) == count and np.isfinite(speeds).all() else None
    return None
