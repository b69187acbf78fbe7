# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`scenario-gen import`: trajectories of other software's files as a table that is read as a log.

Columns: vehicle, t_s from the file's time zero, x_m and y_m of the footprint's centre, speed_mps, heading_rad from +x
counter-clockwise, length_m, width_m. A missing speed is derived. OpenSCENARIO
poses the rear axle, and its vertices have no speeds: the centre follows from the bounding box; the speeds are those of our own
files' property; in others' files they are derived from positions and times, but for the first, which the initial action says.
CommonRoad (2018b, 2020a), traces of OSI and tables of omega-prime are read as logs are (`logs.adapters`).
"""

from dataclasses import dataclass
import math
from pathlib import Path
from typing import Literal

import numpy as np

from scenario_gen.base.errors import InputError, of_system
from scenario_gen.base.markup import Element, read_xml
from scenario_gen.logs import is_commonroad, is_known, is_osi, LogConfig, read_raw
from scenario_gen.numerics import Floats, frozen
from scenario_gen.numerics.plane import place
from scenario_gen.output.exchange.openscenario import SPEEDS
from scenario_gen.output.exchange.xml import number
from scenario_gen.types import Vehicle

HEADER = "vehicle,t_s,x_m,y_m,speed_mps,heading_rad,length_m,width_m"
MOST_ROWS = 2_000_000


@dataclass(frozen=True, eq=False)
class Track:
    """A vehicle's trajectory.

    Attributes:
        vehicle: id.
        length, width: metres.
        rows: (K, 5) time [s], x [m], y [m] of the footprint's centre, speed [m/s], heading [rad].
    """

    vehicle: str
    length: float
    width: float
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
    result = _openscenario(root)
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
        size = f"{number(track.length)},{number(track.width)}"
        lines += [f"{track.vehicle},{','.join(map(number, row))},{size}" for row in track.rows.tolist()]
    try:
        with out.open("x", encoding="utf-8", newline="") as file:
            file.write("\n".join(lines) + "\n")
    except FileExistsError:
        raise InputError(f"{out} exists already; name another file with --out, or remove it") from None
    except OSError as error:
        raise of_system(error, out) from error
    return result


def _each(element: Element, path: str) -> list[Element]:
    """Return every descendant along a path of names."""
    found = [element]
    for tag in path.split("/"):
        found = [child for parent in found for child in parent.all(tag)]
    return found


def _one(element: Element, path: str) -> Element:
    """Return the first descendant along a path of names; what is missing is an error."""
    for tag in path.split("/"):
        element = element.one(tag)
    return element


def _openscenario(root: Element) -> Imported:
    """Return what an OpenSCENARIO file has on vehicles that follow timed polylines."""
    boxes: dict[str, Element] = {}
    own: dict[str, Floats | None] = {}
    notes = []
    for entity in _each(root, "Entities/ScenarioObject"):
        name, box = entity.get("name"), entity.first("Vehicle", "BoundingBox")
        if box is None:
            notes.append(f"{name} left out: it is no vehicle with a bounding box in this file")
        else:
            boxes[name], own[name] = box, _own_speeds(entity)
    speeds = {
        private.get("entityRef"): target.number("value")
        for private in _each(root, "Storyboard/Init/Actions/Private")
        for target in _each(private, "PrivateAction/LongitudinalAction/SpeedAction/SpeedActionTarget/AbsoluteTargetSpeed")
    }
    tracks = []
    for group in _each(root, "Storyboard/Story/Act/ManeuverGroup"):
        for follow in _each(group, "Maneuver/Event/Action/PrivateAction/RoutingAction/FollowTrajectoryAction"):
            for actor in _each(group, "Actors/EntityRef"):
                name = actor.get("entityRef")
                if name in boxes:
                    tracks.append(_followed(follow, name, boxes[name], speeds.get(name), own[name]))
    still = sorted(set(boxes) - {track.vehicle for track in tracks})
    notes += [f"{name} left out: it follows no trajectory" for name in still]
    return Imported(tuple(tracks), tuple(notes))


def _own_speeds(entity: Element) -> Floats | None:
    """Return the speeds (K,) [m/s] that a file of ours has as a property of the vehicle; None if it has none, or damaged ones."""
    for own in _each(entity, "Vehicle/Properties/Property"):
        if own.attributes.get("name") == SPEEDS:
            try:
                speeds = np.array(own.get("value").split(), dtype=np.float64)
            except ValueError:
                return None
            return speeds if np.isfinite(speeds).all() else None
    return None


def _followed(follow: Element, name: str, box: Element, speed: float | None, speeds: Floats | None) -> Track:
    """Return the track of a vehicle that follows a trajectory in absolute time."""
    timing = _one(follow, "TimeReference/Timing")
    if timing.get("domainAbsoluteRelative") != "absolute":
        raise InputError(f"{timing.place}: its times are relative to a trigger; only absolute ones are read")
    scale, offset = timing.number("scale"), timing.number("offset")
    rows = []
    for vertex in _one(follow, "TrajectoryRef/Trajectory/Shape/Polyline").all("Vertex"):
        world = _one(vertex, "Position/WorldPosition")
        time = vertex.number("time") * scale + offset
        rows.append((time, world.number("x"), world.number("y"), float("nan"), world.number("h", 0.0)))
    if len(rows) < 2:
        raise InputError(f"{follow.place}: its polyline has {len(rows)} vertices; at least 2 are needed")
    result = np.array(rows)
    result[:, 4] = np.unwrap(result[:, 4])
    center, size = box.one("Center"), box.one("Dimensions")
    result[:, 1:3] = place(result[:, [1, 2, 4]], center.number("x"), center.number("y"))
    if speeds is not None and len(speeds) == len(result):
        result[:, 3] = speeds
    return _track(follow.place, name, (size.number("length"), size.number("width")), result, speed)


def _track(place: str, vehicle: str, size: tuple[float, float], rows: Floats, speed: float | None) -> Track:
    """Return a track whose times ascend; speeds that are not given are derived. `place` begins messages.

    Raises:
        InputError: a time is not later than the one before, a size is not positive, or there are too many rows.
    """
    if len(rows) > MOST_ROWS:
        raise InputError(f"{place}: {len(rows)} states; at most {MOST_ROWS} are read")
    if min(size) <= 0.0:
        raise InputError(f"{place}: a footprint of {size[0]:g} m × {size[1]:g} m; both must be positive")
    if len(rows) < 2 or (np.diff(rows[:, 0]) <= 0.0).any():
        raise InputError(f"{place}: times must ascend, and be two at least")
    if np.isnan(rows[:, 3]).any():
        rows[:, 3] = _speeds(rows, speed)
    if not np.isfinite(rows).all():
        raise InputError(f"{place}: its times, places or speeds are beyond all numbers")
    if any(not c.isprintable() or c in ',"' for c in vehicle) or not vehicle:
        raise InputError(f"{place}: the id {vehicle[:40]!r} cannot stand in a table; rename it")
    return Track(vehicle, *size, rows)


def _log(path: Path) -> Imported:
    """Return the vehicles of a file that is read as logs are; sizes that are not given are a car's."""
    log = read_raw([path], LogConfig())
    tracks = []
    for seen in log.vehicles:
        speed = np.full(len(seen.fix_ns), np.nan)
        known = dict(zip(seen.speed_row.tolist(), seen.speed.tolist(), strict=True))
        speed[:] = [known.get(row, math.nan) for row in seen.fix_row.tolist()]
        heading = np.unwrap(np.where(np.isnan(seen.heading), _directions(seen.fix), seen.heading))
        rows = np.column_stack((seen.fix_ns * 1e-9, seen.fix, speed, heading))
        usual = Vehicle(seen.id)
        sizes = (seen.length, usual.length), (seen.width, usual.width)
        length, width = (known_size if math.isnan(own) or own == 0.0 else own for own, known_size in sizes)
        tracks.append(_track(f"{path}, vehicle {seen.id}", seen.id, (length, width), rows, None))
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
