# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""trajectory_msgs/MultiDOFJointTrajectory, the one message for tracks, changepoints, fits and scenarios.

Frame: `header.frame_id`. `header.stamp`: the template's first sample; what derives from a template repeats it.
`joint_names[i]`: `<id>:<length>x<width>`, metres (a bare `<id>` is read as a default car), then `:<type>` of who is neither a car
shorter than 7 m nor a truck from 7 m on.
`points[k].time_from_start`: time since `header.stamp`. `points[k].transforms[i]`: pose of the footprint's centre,
z = 0 (`ABSENT` where the vehicle is not there: far below the ground; x, y and yaw are then those of its first or last instant),
yaw as a quaternion. `velocities[i].linear.x`: speed along the heading, m/s. `accelerations[i].linear.x`: likewise,
m/s². All other components are zero; nothing is NaN. In `scenarios` no vehicle is ever absent: see scenarios.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import re

import numpy as np

from msg_conventions import layouts
from msg_conventions.cdr import CdrReader, HEADER, NANOSECONDS
from msg_conventions.cdr import encode as encode_fields
from msg_conventions.yaw import check_quaternions, quaternion, yaw
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.types import tokens, usual_type, Vehicle

TYPE = "trajectory_msgs/msg/MultiDOFJointTrajectory"
FARTHEST = 1e8  # m from the frame's origin: more than any geodetic grid has
FASTEST = 1e4  # m/s: no vehicle is faster, and sums of squares stay finite
MANY = 10_000  # vehicles: beyond, a message is not laid out as one table
LONGEST_NS = 7200 * NANOSECONDS  # of an encounter or a scenario
SEQUENCES = {
    "transforms": 7,
    "velocities": 6,
    "accelerations": 6,
}  # of a point, and the numbers of an entry
SMALLEST, LARGEST = 0.01, 1000.0  # metres of a footprint
ABSENT = -1000.0  # m: z of a vehicle that is not there


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The content of the message: N vehicles at T instants.

    Attributes:
        stamp_ns: header stamp; frame_id: header frame.
        vehicles: N identities and footprints.
        time_ns: (T,) nanoseconds from start.
        position: (N, T, 2) m; heading: (N, T) rad; speed: (N, T) m/s; acceleration: (N, T) m/s².
        there: (N, T) whether each vehicle is there; None: all of them are.
    """

    stamp_ns: int
    frame_id: str
    vehicles: tuple[Vehicle, ...]
    time_ns: Ints
    position: Floats
    heading: Floats
    speed: Floats
    acceleration: Floats
    there: Bools | None = None


def joint_names(vehicles: Sequence[Vehicle]) -> tuple[str, ...]:
    """Return `<token>:<length>x<width>:<type>` of each vehicle, metres, so that no second message is needed for these.

    The type is left out where it is the usual one of the length, as of all vehicles of older bags.
    """
    names = tokens(vehicle.id for vehicle in vehicles)
    types = ("" if one.type == usual_type(one.length) else f":{one.type}" for one in vehicles)
    return tuple(
        f"{name}:{one.length!r}x{one.width!r}{kind}"
        for name, one, kind in zip(names, vehicles, types, strict=True)
    )


def vehicle_of(joint_name: str) -> Vehicle:
    """Return the vehicle of a joint name; one without a footprint gets the default size of a car.

    Raises:
        InputError: the footprint is not two lengths of a vehicle, or the type is not known.
    """
    name, colon, rest = joint_name.partition(":")
    size, _, kind = rest.partition(":")
    if not colon:
        return Vehicle(name)
    match = re.fullmatch(r"([0-9.eE+-]+)x([0-9.eE+-]+)", size)
    try:
        length, width = (float(value) for value in match.groups()) if match else (0.0, 0.0)
    except ValueError:
        length = width = 0.0
    if not (SMALLEST <= length <= LARGEST and SMALLEST <= width <= LARGEST):
        raise InputError(
            f"joint name {joint_name!r}: expected <id>:<length>x<width> (and :<type>), {SMALLEST:g} to {LARGEST:g} m each, "
            "e.g. car:4.8x1.9"
        )
    return Vehicle(name, length, width, kind)


def _point_type(n: int) -> np.dtype[np.void]:
    """Wire layout of a point of `n` vehicles that begins at a multiple of 8 bytes; it also ends at one."""
    sequences = [
        entry
        for name, width in SEQUENCES.items()
        for entry in (("n_" + name, "<u4"), ("pad_" + name, "<u4"), (name, "<f8", (n, width)))
    ]
    return np.dtype([*sequences, ("sec", "<i4"), ("nanosec", "<u4")])


def encode(trajectory: Trajectory) -> bytes:
    """Return the message's CDR bytes.

    Raises:
        InputError: a value is not finite, an id cannot be a ROS name, or a time does not fit.
    """
    n, count = trajectory.speed.shape
    values = (trajectory.position, trajectory.heading, trajectory.speed, trajectory.acceleration)
    if not all(np.isfinite(value).all() for value in values):
        raise InputError("a trajectory with a value that is not finite cannot be sent")
    stamp, frame, names = (
        trajectory.stamp_ns,
        trajectory.frame_id,
        joint_names(trajectory.vehicles),
    )
    begin = encode_fields(
        layouts.TRAJECTORY, stamp=stamp, frame_id=frame, names=names, count=count
    )
    points = np.zeros(count, dtype=_point_type(n))
    for name in SEQUENCES:
        points["n_" + name] = n
    points["transforms"][..., :2] = trajectory.position.swapaxes(0, 1)
    if trajectory.there is not None:
        points["transforms"][..., 2] = np.where(trajectory.there, 0.0, ABSENT).T
    points["transforms"][..., 3:] = quaternion(trajectory.heading).swapaxes(0, 1)
    points["velocities"][..., 0] = trajectory.speed.T
    points["accelerations"][..., 0] = trajectory.acceleration.T
    points["sec"], points["nanosec"] = np.divmod(trajectory.time_ns, NANOSECONDS)
    body = points.tobytes()
    # Behind an odd multiple of four the first point's length itself fills up to the boundary: no padding after it.
    return begin + (body if (len(begin) - len(HEADER)) % 8 == 0 else body[:4] + body[8:])


def decode(data: bytes, what: str) -> Trajectory:
    """Return the content of the message; velocities or accelerations that were left out are read as zero.

    Raises:
        InputError: naming `what`, where the message is damaged, lacks poses, or holds a value that is not finite or no vehicle's.
    """
    return decode_first(data, what)[0]


def decode_first(data: bytes, what: str) -> tuple[Trajectory, int]:
    """Return the content of the first message, and how many bytes it takes; others may follow.

    Raises:
        InputError: as `decode`.
    """
    reader = CdrReader(data, what)
    head = reader.fields(layouts.TRAJECTORY, framed=True)
    vehicles = tuple(map(vehicle_of, head.names))
    n, count = len(vehicles), head.count
    if not n:
        raise InputError(f"{what}: joint_names is empty; at least one vehicle is needed")
    time_ns, pose, velocity, acceleration = _uniform(reader, n, count) or _one_by_one(
        reader, what, n, count
    )
    if not all(np.isfinite(value).all() for value in (pose, velocity, acceleration)):
        raise InputError(f"{what}: the message holds a value that is not finite")
    bounds = (
        ("position", pose[..., :2], FARTHEST),
        ("speed", velocity, FASTEST),
        ("quaternion", pose[..., 3:], 2.0),
    )
    for name, values, most in bounds:
        if (np.abs(values) > most).any():
            raise InputError(
                f"{what}: a {name} is {np.abs(values).max():g}; at most {most:g} is read"
            )
    check_quaternions(pose[..., 3:], what)
    there = pose[..., 2].T > 0.5 * ABSENT
    states = (
        pose[..., :2].swapaxes(0, 1),
        yaw(pose[..., 3:]).T,
        velocity[..., 0].T,
        acceleration[..., 0].T,
    )
    found = Trajectory(
        head.stamp, head.frame_id, vehicles, time_ns, *states, there=None if there.all() else there
    )
    return found, len(HEADER) + reader.place


Points = tuple[
    Ints, Floats, Floats, Floats
]  # times (T,) [ns], poses (T, N, 7), velocities and accelerations (T, N, 6)


def _uniform(reader: CdrReader, n: int, count: int) -> Points | None:
    """Return the points as one table if each has all its sequences; otherwise None, and nothing is read."""
    place = reader.place
    points = reader.aligned(_point_type(n), count) if n <= MANY else None
    if points is None:
        return None
    if not all((points["n_" + name] == n).all() for name in SEQUENCES):
        reader.place = place
        return None
    pose, velocity, acceleration = (np.ascontiguousarray(points[name]) for name in SEQUENCES)
    return (
        points["sec"].astype(np.int64) * NANOSECONDS + points["nanosec"],
        pose,
        velocity,
        acceleration,
    )


def _one_by_one(reader: CdrReader, what: str, n: int, count: int) -> Points:
    """Return the points, read one after the other; velocities or accelerations that were left out are zero.

    Raises:
        InputError: naming `what`, where the message is damaged or lacks poses.
    """
    points = [reader.fields(layouts.POINT) for _ in range(count)]
    blocks = []
    for name, width in SEQUENCES.items():
        rows = [getattr(point, name) for point in points]
        for k, row in enumerate(rows):
            if len(row) != n and (len(row) or width == 7):
                raise InputError(f"{what}: point {k} has {len(row)} entries for {n} joint names")
        block = [row if len(row) else np.zeros((n, width)) for row in rows]
        blocks.append(np.array(block).reshape(count, n, width))
    pose, velocity, acceleration = blocks
    return np.array([point.time for point in points], dtype=np.int64), pose, velocity, acceleration
