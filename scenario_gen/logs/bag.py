# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""rosbag2 bags, MCAP and SQLite: per-vehicle fixes and speeds, odometry, or tracks that are encounters already."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import math
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import get_typestore, Stores

from msg_conventions import trajectory
from msg_conventions.streams import speed_of
from msg_conventions.tracks import decode_tracks
from msg_conventions.yaw import yaw
from scenario_gen import exact
from scenario_gen.encounter import Encounter
from scenario_gen.errors import InputError
from scenario_gen.guard import guarded
from scenario_gen.logs.budgets import check_size, check_vehicles
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import RawLog, Rows, Segment
from scenario_gen.storage import BagConfig, open_bag

FIX = "sensor_msgs/msg/NavSatFix"
TWIST = "geometry_msgs/msg/TwistStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
USED = (FIX, TWIST, ODOMETRY, trajectory.TYPE)
STORES = get_typestore(Stores.ROS2_JAZZY)  # the four types are standard, so bags without type definitions read as well


@dataclass
class Topic:
    """The messages of one topic: log stamps and CDR bytes, in the order of the log."""

    name: str
    type: str
    stamps: list[int] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the topics that this project knows; several bags are one log."""
    topics = read_topics(paths, config)
    label = str(paths[0]) if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} more"
    tracks = [topic for topic in topics if topic.type == trajectory.TYPE]
    name = paths[0].stem if paths[0].is_file() else paths[0].name
    if tracks:
        return read_tracks(tracks, name, label, others=[topic.name for topic in topics if topic not in tracks])
    return read_streams(topics, name, label, config)


def read_topics(paths: Sequence[Path], config: LogConfig) -> list[Topic]:
    """Read the messages of all topics that can be used, sorted by name.

    Raises:
        InputError: a file is damaged or too large, or no topic can be used.
    """
    wanted = [name.strip() for name in config.topics.split(",") if name.strip()]
    found: dict[str, Topic] = {}
    seen: dict[str, str] = {}
    bounds = BagConfig(most_bytes=config.size_limit << 20)
    rows = 0
    for path in paths:
        with open_bag(path, bounds, "log.size_limit") as bag:
            seen |= {topic.name: topic.type for topic in bag.topics()}
            for message in bag.messages(lambda name, kind: is_used(name, kind, wanted)):
                rows += 1
                check_size(str(path), 0, rows, config)
                topic = found.setdefault(message.topic, Topic(message.topic, message.type))
                topic.stamps.append(message.stamp_ns)
                topic.data.append(message.data)
    for name in wanted:
        if name not in seen:
            raise InputError(f"parameter topics: {paths[0]} has no topic {name!r}; it has {listing(seen)}")
        if seen[name] not in USED:
            raise InputError(f"{paths[0]}, topic {name}: type {seen[name]} is not one of {', '.join(USED)}")
    if not found:
        raise InputError(
            f"{paths[0]}: no topic to read. It has {listing(seen)}. Needed is {FIX} with {TWIST}, or {ODOMETRY}, one per "
            f"vehicle, or a topic named tracks of {trajectory.TYPE}; the parameter topics chooses by name"
        )
    return [found[name] for name in sorted(found)]


def is_used(topic: str, kind: str, wanted: list[str]) -> bool:
    """Return whether a topic is read; of trajectories only those called tracks, unless asked for by name."""
    if wanted:
        return topic in wanted and kind in USED
    return kind in USED and (kind != trajectory.TYPE or topic.rpartition("/")[2] == "tracks")


def listing(seen: dict[str, str]) -> str:
    """Topics and types for a message."""
    return ", ".join(f"{name} ({kind})" for name, kind in sorted(seen.items())) or "no topics"


def vehicle_id(topic: str) -> str:
    """The vehicle a topic belongs to: its namespace, without the prefix `vehicle_` that this project writes."""
    namespace = topic.strip("/").rpartition("/")[0]
    return namespace.rpartition("/")[2].removeprefix("vehicle_") or topic.strip("/")


def read_streams(topics: list[Topic], name: str, label: str, config: LogConfig) -> RawLog:
    """Collect fixes, speeds and odometry per vehicle."""
    if len({topic.type == ODOMETRY for topic in topics if topic.type != TWIST}) > 1:
        mixed = listing({topic.name: topic.type for topic in topics})
        raise InputError(f"{label} has both {FIX} and {ODOMETRY} ({mixed}); choose with the parameter topics")
    vehicles: dict[str, Rows] = {}
    segments: list[Segment] = []
    unstamped: list[str] = []
    owners = own(topics, label)
    check_vehicles(label, len(set(owners.values())), config)
    row = 0
    for topic in topics:
        segments.append(Segment(row, f"{label}, topic {topic.name}", "message", 1))
        vehicle = vehicles.setdefault(owners[topic.name], Rows())
        take = {FIX: take_fix, TWIST: take_twist, ODOMETRY: take_odometry}[topic.type]
        if collect(topic, take, vehicle, row, label):
            unstamped.append(topic.name)
        row += len(topic.data)
    notes = [f"{len(unstamped)} topic(s) bear no header stamps, so the time of reception is used: {', '.join(unstamped)}"]
    silent = [owners[topic.name] for topic in topics if topic.type == TWIST and not vehicles[owners[topic.name]].fixes]
    if silent:
        raise InputError(f"{label}: speeds but no positions for {', '.join(silent)}; put {FIX} and {TWIST} in one namespace")
    for vehicle_name, vehicle in vehicles.items():
        if not vehicle.speeds:
            notes.append(f"vehicle {vehicle_name} has no speeds: taken from its positions")
    return RawLog(
        name=name,
        geographic=any(topic.type == FIX for topic in topics),
        vehicles=tuple(vehicle.observations(vehicle_name) for vehicle_name, vehicle in vehicles.items()),
        rows=row,
        segments=tuple(segments),
        notes=tuple(notes if unstamped else notes[1:]),
    )


def own(topics: list[Topic], label: str) -> dict[str, str]:
    """Return the vehicle of each topic by its namespace.

    Raises:
        InputError: two topics of one type share a namespace.
    """
    owners = {topic.name: vehicle_id(topic.name) for topic in topics}
    taken: dict[tuple[str, str], str] = {}
    for topic in topics:
        other = taken.setdefault((owners[topic.name], topic.type), topic.name)
        if other != topic.name:
            raise InputError(
                f"{label}: {other} and {topic.name} are both {topic.type} of vehicle {owners[topic.name]}; choose one with the "
                "parameter topics, or record each vehicle in a namespace of its own"
            )
    return owners


def collect(topic: Topic, take: Callable[[Any, Rows, int, int], None], vehicle: Rows, row: int, label: str) -> bool:
    """Decode the messages of a topic; return whether their headers bear no stamps."""
    unstamped = False
    for number, (received, data) in enumerate(zip(topic.stamps, topic.data, strict=True)):
        with guarded(f"{label}, topic {topic.name}, message {number + 1}: not a {topic.type}"):
            message: Any = STORES.deserialize_cdr(data, topic.type)
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        unstamped |= stamp == 0
        take(message, vehicle, stamp or received, row + number)
    return unstamped


def take_fix(message: Any, vehicle: Rows, stamp: int, row: int) -> None:
    """A NavSatFix; one without a fix (status below 0) has no position."""
    known = message.status.status >= 0
    position = (message.latitude, message.longitude) if known else (math.nan, math.nan)
    vehicle.fixes.append((stamp, row, *position, math.nan))


def take_twist(message: Any, vehicle: Rows, stamp: int, row: int) -> None:
    """A TwistStamped."""
    vehicle.speeds.append((stamp, row, speed_of(message.twist.linear.x, message.twist.linear.y)))


def take_odometry(message: Any, vehicle: Rows, stamp: int, row: int) -> None:
    """An Odometry: pose in its frame, speed in the body frame."""
    pose, linear = message.pose.pose, message.twist.twist.linear
    turn = pose.orientation
    heading = float(yaw(np.array([turn.x, turn.y, turn.z, turn.w])))
    vehicle.fixes.append((stamp, row, pose.position.x, pose.position.y, heading))
    vehicle.speeds.append((stamp, row, exact.hypot(linear.x, linear.y)))


def read_tracks(topics: list[Topic], name: str, label: str, others: list[str]) -> RawLog:
    """Read tracks: each message on an even clock is an encounter as it stands, without any cleaning; repeats count once."""
    encounters: list[Encounter] = []
    segments, notes, row = [], [], 0
    whole = len({data for topic in topics for data in topic.data})
    for topic in topics:
        segments.append(Segment(row, f"{label}, topic {topic.name}", "message", 1))
        row += len(topic.data)
        for number, data in enumerate(dict.fromkeys(topic.data)):
            where = f"{label}, topic {topic.name}, message {number + 1}"
            found = decode_tracks(data, where)
            values = {key: getattr(found, key) for key in found.__dataclass_fields__}
            encounters.append(Encounter(**(values | {"name": name if whole == 1 else f"{name}-{len(encounters) + 1}"})))
    if others:
        notes.append(
            f"read from {', '.join(topic.name for topic in topics)}; the parameter topics can choose {', '.join(others)}"
        )
    return RawLog(name, False, (), row, tuple(segments), tuple(notes), encounters=tuple(encounters))


def between(encounter: Encounter, config: LogConfig) -> Encounter:
    """Return the encounter in the asked time window and with the asked vehicles.

    Raises:
        InputError: a vehicle is unknown, or fewer than two vehicles or samples are left.
    """
    names = [name.strip() for name in config.vehicles.split(",") if name.strip()]
    ids = [vehicle.id for vehicle in encounter.vehicles]
    for unknown in (name for name in names if name not in ids):
        raise InputError(f"parameter vehicles: {encounter.name} has no vehicle {unknown!r}; it has {', '.join(ids)}")
    if config.start >= encounter.duration:
        raise InputError(f"parameter start is {config.start:g} s, but {encounter.name} is only {encounter.duration:.1f} s long")
    rows = [ids.index(name) for name in dict.fromkeys(names)] or list(range(len(ids)))
    first = math.ceil(config.start / encounter.dt - 1e-9)
    last = math.floor(config.end / encounter.dt + 1e-9) + 1 if config.end else len(encounter.time)
    return Encounter(
        name=encounter.name,
        vehicles=tuple(encounter.vehicles[n] for n in rows),
        start_ns=encounter.start_ns + first * encounter.dt_ns,
        dt_ns=encounter.dt_ns,
        position=encounter.position[rows, first:last],
        heading=encounter.heading[rows, first:last],
        speed=encounter.speed[rows, first:last],
        origin=encounter.origin,
    )
