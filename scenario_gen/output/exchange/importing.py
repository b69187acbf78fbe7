# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`scenario-gen import`: trajectories of other software's files as a table that is read as a log.

Columns: vehicle, t_s from the file's time zero, x_m and y_m of the footprint's centre, speed_mps, heading_rad from +x
counter-clockwise, length_m, width_m. A missing speed is derived. OpenSCENARIO
poses the rear axle, and its vertices have no speeds: the centre follows from the bounding box; the speeds are those of our own
files' property; in others' files they are derived from positions and times, but for the first, which the initial action says.
Times relative to an event count from the time that its trigger waits for; headings that are missing follow the path.
CommonRoad (2018b, 2020a), traces of OSI and tables of omega-prime are read as logs are (`logs.adapters`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
import math
from pathlib import Path
from typing import Literal

import numpy as np

from scenario_gen.base.errors import InputError, of_system
from scenario_gen.base.markup import Element, read_xml
from scenario_gen.logs import is_commonroad, is_known, is_osi, is_road_user, LogConfig, read_raw, type_called, typed, usual_size
from scenario_gen.numerics import Floats, frozen
from scenario_gen.numerics.plane import edge_lengths, place
from scenario_gen.output.exchange.openscenario import SPEEDS
from scenario_gen.output.exchange.substitution import resolved
from scenario_gen.output.exchange.xml import number
from scenario_gen.types import Vehicle, VEHICLE_TYPES

HEADER = "vehicle,t_s,x_m,y_m,speed_mps,heading_rad,length_m,width_m,type"
MOST_ROWS = 2_000_000
_FOLLOWS = "PrivateAction/RoutingAction/FollowTrajectoryAction"


@dataclass(frozen=True, eq=False)
class Track:
    """A vehicle's trajectory.

    Attributes:
        vehicle: id.
        length, width: metres.
        type: of `VEHICLE_TYPES`.
        rows: (K, 5) time [s], x [m], y [m] of the footprint's centre, speed [m/s], heading [rad].
    """

    vehicle: str
    length: float
    width: float
    type: str
    rows: Floats


@dataclass(frozen=True)
class Imported:
    """What was read: the tracks, and sentences on what was left out."""

    tracks: tuple[Track, ...]
    notes: tuple[str, ...]


def read_scenario_file(path: Path) -> Imported:
    """Return the trajectories in a CommonRoad or OpenSCENARIO file, a trace of OSI or a table of omega-prime.

    Raises:
        InputError: it cannot be read, is none of these, or holds no trajectory with times; file and place are named.
    """
    if path.is_file() and (is_osi(path) or is_known(path, name="omega_prime") or is_commonroad(path)):
        return _log(path)
    root = read_xml(path, str(path))
    if root.tag != "OpenSCENARIO":
        raise InputError(f"{path}: its root is {root.tag[:40]!r}; commonRoad and OpenSCENARIO are read, and OSI's .mcap")
    result = _openscenario(resolved(root, path))
    if not result.tracks:
        raise InputError(f"{path}: no vehicle with a trajectory in it" + "".join(f"; {note}" for note in result.notes))
    return result


def import_file(path: Path, out: Path) -> Imported:
    """Write the trajectories of a file to a new table `out`.

    Raises:
        InputError: as of `read_scenario_file`; `out` is there already, or cannot be written.
    """
    result = read_scenario_file(path)
    lines = [HEADER]
    for track in result.tracks:
        size = f"{number(track.length)},{number(track.width)},{track.type}"
        lines += [f"{track.vehicle},{','.join(map(number, row))},{size}" for row in track.rows.tolist()]
    try:
        with out.open("x", encoding="utf-8", newline="") as file:
            file.write("\n".join(lines) + "\n")
    except FileExistsError:
        raise InputError(f"{out} exists already; name another file with --out, or remove it") from None
    except OSError as error:
        raise of_system(error, out) from error
    return result


def _openscenario(root: Element) -> Imported:
    """Return what an OpenSCENARIO file has on vehicles that follow polylines."""
    vehicles: dict[str, Element] = {}
    tracks, notes = list[Track](), list[str]()
    for entity in root.all("Entities/ScenarioObject"):
        name, vehicle = entity.get("name"), entity.first("Vehicle") or entity.first("Pedestrian")
        if vehicle is None or vehicle.first("BoundingBox") is None:
            notes.append(f"{name} left out: it is no road user with a bounding box in this file or its catalogs")
        elif not is_road_user(_category(vehicle)):
            notes.append(f"{name} left out: it is a {_category(vehicle)}")
        else:
            vehicles[name] = vehicle
    speeds = {
        private.get("entityRef"): target
        for private in root.all("Storyboard/Init/Actions/Private")
        for target in private.all("PrivateAction/LongitudinalAction/SpeedAction/SpeedActionTarget/AbsoluteTargetSpeed")
    }
    still = dict.fromkeys(vehicles)
    for name, follow, start in _followers(root):
        if name in vehicles:
            still.pop(name, None)
            try:
                tracks.append(_followed(follow, name, vehicles[name], speeds.get(name), start))
            except InputError as error:
                notes.append(f"{name} left out: {error}")
            else:
                if follow.first("TimeReference", "Timing") is None:
                    notes.append(
                        f"{name} follows its trajectory without a time reference: its first speed, or its vertices' times, count"
                    )
    notes += [f"{name} left out: it follows no trajectory" for name in still]
    return Imported(tuple(tracks), tuple(notes))


def _category(entity: Element) -> str:
    """Return what a file calls the type of a vehicle or a pedestrian: its name where that is a type, as in our files."""
    named = entity.attributes.get("name", "")
    other = {"Vehicle": "vehicleCategory", "Pedestrian": "pedestrianCategory"}[entity.tag]
    category = entity.attributes.get(other, "car" if entity.tag == "Vehicle" else "pedestrian")
    return named if named in VEHICLE_TYPES and VEHICLE_TYPES[named].openscenario == category else category


def _followers(root: Element) -> Iterator[tuple[str, Element, float]]:
    """Yield who follows a trajectory, the action, and the second at which it begins; 0 where that is no matter of time."""
    for private in root.all("Storyboard/Init/Actions/Private"):
        yield from ((private.get("entityRef"), follow, 0.0) for follow in private.all(_FOLLOWS))
    for group in root.all("Storyboard/Story/Act/ManeuverGroup"):
        for event in group.all("Maneuver/Event"):
            conditions = event.all("StartTrigger/ConditionGroup/Condition/ByValueCondition/SimulationTimeCondition")
            start = conditions[0].number("value") if conditions else 0.0
            for follow in event.all(f"Action/{_FOLLOWS}"):
                yield from ((actor.get("entityRef"), follow, start) for actor in group.all("Actors/EntityRef"))


def _own_speeds(vehicle: Element) -> Floats | None:
    """Return the speeds (K,) [m/s] that a file of ours has as a property of the vehicle; None if it has none, or damaged ones."""
    for own in vehicle.all("Properties/Property"):
        if own.attributes.get("name") == SPEEDS:
            try:
                speeds = np.array(own.get("value").split(), dtype=np.float64)
            except ValueError:
                return None
            return speeds if np.isfinite(speeds).all() else None
    return None


def _followed(follow: Element, name: str, vehicle: Element, target: Element | None, start: float) -> Track:
    """Return the track of a vehicle that follows a trajectory.

    Args:
        follow: the action.
        name: of the vehicle.
        vehicle: with its bounding box.
        target: its first speed, if it has one.
        start: seconds at which the action begins.
    """
    trajectory = follow.first("TrajectoryRef", "Trajectory") or follow.one("Trajectory")  # before, in 1.0
    rows = []
    for vertex in trajectory.one("Shape/Polyline").all("Vertex"):
        world = vertex.one("Position/WorldPosition")
        x, y, heading = world.number("x"), world.number("y"), world.number("h", math.nan)
        rows.append((vertex.number("time", math.nan), x, y, math.nan, heading))
    if len(rows) < 2:
        raise InputError(f"{follow.place}: its polyline has {len(rows)} vertices; at least 2 are needed")
    result, speed = np.array(rows), target.number("value") if target else None
    timing = follow.first("TimeReference", "Timing")
    if timing is not None:
        from_start = start if timing.get("domainAbsoluteRelative") == "relative" else 0.0
        result[:, 0] = result[:, 0] * timing.number("scale") + timing.number("offset") + from_start
    elif speed is not None and speed > 0.0:
        result[:, 0] = start + np.concatenate(([0.0], np.cumsum(edge_lengths(result[:, 1:3])))) / speed
    result[:, 4] = np.unwrap(np.where(np.isnan(result[:, 4]), _directions(result[:, 1:3]), result[:, 4]))
    center, size = vehicle.one("BoundingBox/Center"), vehicle.one("BoundingBox/Dimensions")
    result[:, 1:3] = place(result[:, [1, 2, 4]], center.number("x"), center.number("y"))
    speeds = _own_speeds(vehicle)
    if speeds is not None and len(speeds) == len(result):
        result[:, 3] = speeds
    named = Vehicle(name, size.number("length"), size.number("width"), type_called(_category(vehicle)) or "")
    return _track(follow.place, named, result, speed)


def _track(place: str, seen: Vehicle, rows: Floats, speed: float | None) -> Track:
    """Return a track whose times ascend; speeds that are not given are derived. `place` begins messages.

    Raises:
        InputError: a time is not later than the one before, a size is not positive, or there are too many rows.
    """
    if len(rows) > MOST_ROWS:
        raise InputError(f"{place}: {len(rows)} states; at most {MOST_ROWS} are read")
    if min(seen.half) <= 0.0:
        raise InputError(f"{place}: a footprint of {seen.length:g} m × {seen.width:g} m; both must be positive")
    if len(rows) < 2 or not (np.diff(rows[:, 0]) > 0.0).all():
        raise InputError(f"{place}: times must ascend, and be two at least")
    if np.isnan(rows[:, 3]).any():
        rows[:, 3] = _speeds(rows, speed)
    if not np.isfinite(rows).all():
        raise InputError(f"{place}: its times, places or speeds are beyond all numbers")
    if any(not c.isprintable() or c in ',"' for c in seen.id) or not seen.id:
        raise InputError(f"{place}: the id {seen.id[:40]!r} cannot stand in a table; rename it")
    return Track(seen.id, seen.length, seen.width, seen.type, rows)


def _log(path: Path) -> Imported:
    """Return the vehicles of a file that is read as logs are; sizes that are not given are the usual ones of the type."""
    log = typed(read_raw([path], LogConfig()), LogConfig())
    tracks = []
    for seen in log.vehicles:
        speed = np.full(len(seen.fix_ns), np.nan)
        known = dict(zip(seen.speed_row.tolist(), seen.speed.tolist(), strict=True))
        speed[:] = [known.get(row, math.nan) for row in seen.fix_row.tolist()]
        heading = np.unwrap(np.where(np.isnan(seen.heading), _directions(seen.fix), seen.heading))
        rows = np.column_stack((seen.fix_ns * 1e-9, seen.fix, speed, heading))
        sizes = zip((seen.length, seen.width), usual_size(seen.kind, LogConfig()), strict=True)
        length, width = (usual if math.isnan(own) or own == 0.0 else own for own, usual in sizes)
        tracks.append(_track(f"{path}, vehicle {seen.id}", Vehicle(seen.id, length, width, seen.kind), rows, None))
    return Imported(tuple(tracks), log.notes)


def _directions(places: Floats) -> Floats:
    """Return (K,) directions [rad] of the way through places (K, 2) [m]; 0 for a single one."""
    if len(places) < 2:
        return np.zeros(len(places))
    step = np.gradient(places, axis=0)
    return np.asarray(np.arctan2(step[:, 1], step[:, 0]))


def _speeds(rows: Floats, first: float | None) -> Floats:
    """Return (K,) speeds [m/s] along the headings by central differences; `first` is that of the first row, if it is known."""
    order: Literal[1, 2] = 2 if len(rows) > 2 else 1
    velocity = np.gradient(rows[:, 1:3], rows[:, 0], axis=0, edge_order=order)
    along = velocity[:, 0] * np.cos(rows[:, 4]) + velocity[:, 1] * np.sin(rows[:, 4])
    if first is not None:
        along[0] = first
    return frozen(np.maximum(along, 0.0))
