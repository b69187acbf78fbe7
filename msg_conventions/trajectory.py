# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""trajectory_msgs/MultiDOFJointTrajectory for tracks, changepoints, fits and scenarios.

- `header.frame_id`: the frame of the positions.
- `header.stamp`: the template's first sample, repeated in messages derived from the template.
- `joint_names[i]`: `<id>:<length>x<width>` in metres, then `:<type>` unless the vehicle is a car
  shorter than 7 m or a truck from 7 m on. A bare `<id>` is a default car. After the type (or "")
  a vehicle with a trailer has `:<id>:<length>x<width>x<hitch>x<reach>`, see `Trailer`. The last
  joint of `tracks` is `signals=<JSON>`, far below the ground, if states of traffic lights were
  recorded.
- `points[k].time_from_start`: time since `header.stamp`.
- `points[k].transforms[i]`: pose of the footprint's centre with z = 0 and the yaw as a quaternion.
  z is `ABSENT_Z_M`, far below the ground, where the vehicle is absent; x, y and yaw are then those
  of its first or last instant.
- `velocities[i].linear.x`: speed along the heading [m/s].
- `accelerations[i].linear.x`: acceleration along the heading [m/s²].

All other components are zero; no value is NaN. In `scenarios` no vehicle is absent (scenarios.py).
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
import json
import re
from typing import Any

import numpy as np

from msg_conventions import layouts
from msg_conventions.cdr import CdrReader, HEADER
from msg_conventions.cdr import encode as encode_fields
from msg_conventions.poses import (
    check_quaternions,
    MAX_COMPONENT_RATIO,
    MAX_COORDINATE_M,
    quaternion,
    yaw,
)
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.numerics import Bools, Floats, Ints, NS_PER_S
from scenario_gen.types import token, tokens, TrafficLight, Trailer, usual_type, Vehicle

TYPE = "trajectory_msgs/msg/MultiDOFJointTrajectory"
MAX_SPEED_MPS = 1e4  # no vehicle is faster, and sums of squares stay finite
MAX_TABLE_VEHICLES = 10_000  # in a message that is decoded as one array
MAX_DURATION_NS = 7200 * NS_PER_S  # of an encounter or a scenario
MIN_SIZE_M = 0.01  # of a footprint
MAX_SIZE_M = 1000.0
ABSENT_Z_M = -1000.0  # z of an absent vehicle
_SIGNALS = "signals="
SEQUENCES = {"transforms": 7, "velocities": 6, "accelerations": 6}
"""The sequences of a point, and how many numbers an entry has."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The content of the message: N vehicles at T instants.

    Attributes:
        stamp_ns: header stamp.
        frame_id: header frame.
        vehicles: (N,) identities and footprints.
        time_ns: (T,) time from start [ns].
        position: (N, T, 2) [m].
        heading: (N, T) [rad].
        speed: (N, T) [m/s].
        acceleration: (N, T) [m/s²].
        present: (N, T) whether each vehicle is present; None: all are.
        lights: traffic lights whose states are known.
    """

    stamp_ns: int
    frame_id: str
    vehicles: tuple[Vehicle, ...]
    time_ns: Ints
    position: Floats
    heading: Floats
    speed: Floats
    acceleration: Floats
    present: Bools | None = None
    lights: tuple[TrafficLight, ...] = ()


def joint_names(vehicles: Sequence[Vehicle]) -> tuple[str, ...]:
    """Return `<token>:<length>x<width>:<type>` of each vehicle [m].

    The type is omitted if it is usual for the length.
    """
    names = []
    ids = tokens(vehicle.id for vehicle in vehicles)
    for name, vehicle in zip(ids, vehicles, strict=True):
        kind = "" if vehicle.type == usual_type(vehicle.length) else f":{vehicle.type}"
        trailer = vehicle.trailer
        if trailer is not None:
            sizes = (trailer.length, trailer.width, trailer.hitch, trailer.reach)
            kind = f"{kind or ':'}:{token(trailer.id)}:{'x'.join(map(repr, sizes))}"
        names.append(f"{name}:{vehicle.length!r}x{vehicle.width!r}{kind}")
    return tuple(names)


def vehicle_of(joint_name: str) -> Vehicle:
    """Return the vehicle of a joint name; without a footprint it is a car of default size.

    Raises:
        InputError: the footprint is not two possible lengths, or the type is unknown.
    """
    name, *rest = joint_name.split(":")
    if not rest:
        return Vehicle(name)
    size, kind, trailer, trailer_sizes = (*rest, "", "", "")[:4]
    length, width = _sizes(size, 2, joint_name)
    towed = Trailer(trailer, *_sizes(trailer_sizes, 4, joint_name)) if trailer else None
    return Vehicle(name, length, width, kind, towed)


def _sizes(text: str, count: int, joint_name: str) -> list[float]:
    """Return the `count` lengths [m] of a part of a joint name.

    Raises:
        InputError: it has others.
    """
    parts = text.split("x")
    if len(parts) == count and all(re.fullmatch(r"[0-9.eE+-]+", part) for part in parts):
        with suppress(ValueError):
            sizes = list(map(float, parts))
            if all(MIN_SIZE_M <= size <= MAX_SIZE_M for size in sizes):
                return sizes
    raise InputError(
        f"joint name {joint_name!r}: expected <id>:<length>x<width> (and :<type>), "
        f"{MIN_SIZE_M:g} to {MAX_SIZE_M:g} m each, e.g. car:4.8x1.9"
    )


def _point_type(n: int) -> np.dtype[np.void]:
    """Return the wire layout of a point with `n` vehicles, aligned to 8 bytes."""
    fields: list[Any] = []
    for name, width in SEQUENCES.items():
        fields += [("n_" + name, "<u4"), ("pad_" + name, "<u4"), (name, "<f8", (n, width))]
    return np.dtype([*fields, ("sec", "<i4"), ("nanosec", "<u4")])


def encode(trajectory: Trajectory) -> bytes:
    """Return the message's CDR bytes.

    Raises:
        InputError: a value is not finite, an id cannot be a ROS name, or a time does not fit.
    """
    n, count = trajectory.speed.shape
    names = joint_names(trajectory.vehicles)
    if trajectory.lights:
        document = [light.document() for light in trajectory.lights]
        names = (*names, f"{_SIGNALS}{json.dumps(document)}")
    values = (trajectory.position, trajectory.heading, trajectory.speed, trajectory.acceleration)
    if not all(np.isfinite(value).all() for value in values):
        raise InputError("a trajectory with a value that is not finite cannot be sent")
    begin = encode_fields(
        layouts.TRAJECTORY,
        stamp=trajectory.stamp_ns,
        frame_id=trajectory.frame_id,
        names=names,
        count=count,
    )
    points = np.zeros(count, dtype=_point_type(len(names)))
    for name in SEQUENCES:
        points["n_" + name] = len(names)
    pose = points["transforms"]
    pose[:, n:, 2], pose[:, n:, 6] = ABSENT_Z_M, 1.0
    pose[:, :n, :2] = trajectory.position.swapaxes(0, 1)
    if trajectory.present is not None:
        pose[:, :n, 2] = np.where(trajectory.present, 0.0, ABSENT_Z_M).T
    pose[:, :n, 3:] = quaternion(trajectory.heading).swapaxes(0, 1)
    points["velocities"][:, :n, 0] = trajectory.speed.T
    points["accelerations"][:, :n, 0] = trajectory.acceleration.T
    points["sec"], points["nanosec"] = np.divmod(trajectory.time_ns, NS_PER_S)
    body = points.tobytes()
    # At an odd multiple of 4 the first point needs no padding after its first length.
    if (len(begin) - len(HEADER)) % 8:
        body = body[:4] + body[8:]
    return begin + body


def decode(data: bytes, source: str) -> Trajectory:
    """Return the content of the message; missing velocities or accelerations are zero.

    Raises:
        InputError: naming `source`, the message is damaged, lacks poses, or has an impossible
            value.
    """
    return decode_first(data, source)[0]


def decode_first(data: bytes, source: str) -> tuple[Trajectory, int]:
    """Return the content of the first message, and its size [bytes]; others may follow.

    Raises:
        InputError: as `decode`.
    """
    reader = CdrReader(data, source)
    head = reader.fields(layouts.TRAJECTORY, framed=True)
    n, names = len(head.names), head.names
    lights: tuple[TrafficLight, ...] = ()
    if n and names[-1].startswith(_SIGNALS):
        lights = _decode_lights(names[-1].removeprefix(_SIGNALS), source)
        names = names[:-1]
    vehicles = tuple(map(vehicle_of, names))
    if not vehicles:
        raise InputError(f"{source}: joint_names is empty; at least one vehicle is needed")
    points = _read_table(reader, n, head.count) or _read_points(reader, source, n, head.count)
    _check_points(points, source)
    time_ns, *states = points
    pose, velocity, acceleration = (values[:, : len(vehicles)] for values in states)
    present = pose[..., 2].T > 0.5 * ABSENT_Z_M
    trajectory = Trajectory(
        stamp_ns=head.stamp,
        frame_id=head.frame_id,
        vehicles=vehicles,
        time_ns=time_ns,
        position=pose[..., :2].swapaxes(0, 1),
        heading=yaw(pose[..., 3:]).T,
        speed=velocity[..., 0].T,
        acceleration=acceleration[..., 0].T,
        present=None if present.all() else present,
        lights=lights,
    )
    return trajectory, len(HEADER) + reader.place


def _decode_lights(text: str, source: str) -> tuple[TrafficLight, ...]:
    with guarded(f"{source}: traffic lights"):
        return tuple(map(TrafficLight.of_document, json.loads(text)))


Points = tuple[Ints, Floats, Floats, Floats]
"""Times (T,) [ns], poses (T, N, 7), velocities and accelerations (T, N, 6)."""


def _check_points(points: Points, source: str) -> None:
    """Raise InputError naming `source` if a value is not finite, too large or no rotation."""
    _, pose, velocity, acceleration = points
    if not all(np.isfinite(value).all() for value in (pose, velocity, acceleration)):
        raise InputError(f"{source}: the message holds a value that is not finite")
    bounds = (
        ("position", pose[..., :2], MAX_COORDINATE_M),
        ("speed", velocity, MAX_SPEED_MPS),
        ("quaternion", pose[..., 3:], MAX_COMPONENT_RATIO),
    )
    for name, values, bound in bounds:
        if (np.abs(values) > bound).any():
            raise InputError(
                f"{source}: a {name} is {np.abs(values).max():g}; at most {bound:g} is read"
            )
    check_quaternions(pose[..., 3:], source)


def _read_table(reader: CdrReader, n: int, count: int) -> Points | None:
    """Return the points from one array if each has all sequences.

    Otherwise read nothing and return None.
    """
    place = reader.place
    if n > MAX_TABLE_VEHICLES:
        return None
    points = reader.aligned(_point_type(n), count)
    if points is None:
        return None
    if not all((points["n_" + name] == n).all() for name in SEQUENCES):
        reader.place = place
        return None
    pose, velocity, acceleration = (np.ascontiguousarray(points[name]) for name in SEQUENCES)
    time_ns = points["sec"].astype(np.int64) * NS_PER_S + points["nanosec"]
    return time_ns, pose, velocity, acceleration


def _read_points(reader: CdrReader, source: str, n: int, count: int) -> Points:
    """Return the points, read one after the other; missing velocities or accelerations are zero.

    Raises:
        InputError: naming `source`, the message is damaged or lacks poses.
    """
    points = [reader.fields(layouts.POINT) for _ in range(count)]
    time_ns = np.array([point.time for point in points], dtype=np.int64)
    pose = _stacked([point.transforms for point in points], n, 7, source)
    velocity = _stacked([point.velocities for point in points], n, 6, source)
    acceleration = _stacked([point.accelerations for point in points], n, 6, source)
    return time_ns, pose, velocity, acceleration


def _stacked(rows: list[Floats], n: int, width: int, source: str) -> Floats:
    """Return the entries of all points (T, n, width); only poses may not be missing."""
    stacked = np.zeros((len(rows), n, width))
    for k, row in enumerate(rows):
        if len(row) == n:
            stacked[k] = row
        elif len(row) or width == SEQUENCES["transforms"]:
            raise InputError(f"{source}: point {k} has {len(row)} entries for {n} joint names")
    return stacked
