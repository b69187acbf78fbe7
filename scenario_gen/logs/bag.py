# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags of rosbag2 and of ROS 1: per-vehicle fixes and speeds, odometry, or tracks that are encounters already."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import math
from pathlib import Path

import numpy as np

from scenario_gen.bags.storage.bag import open_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.definitions import TRACKED
from scenario_gen.bags.vehicles import (
    decode_sample,
    decode_tracked,
    decode_tracks,
    FIX,
    ODOMETRY,
    TRACKS,
    TWIST,
)
from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import listed, LogConfig
from scenario_gen.logs.raw import check_size, check_vehicles, RawLog, Rows, Segment
from scenario_gen.types import Encounter

AT_START_M = 0.5  # m from a frame's origin, in which two vehicles cannot be at once
SPAWNED_S = 1.0  # s after which another one may begin there
USED = (FIX, TWIST, ODOMETRY, TRACKS, TRACKED)


@dataclass
class Topic:
    """The messages of one topic: log stamps and CDR bytes, in the order of the log; `label` names the log in messages."""

    name: str
    type: str
    label: str
    stamps: list[int] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)

    @property
    def where(self) -> str:
        """Log and topic."""
        return f"{self.label}, topic {self.name}"

    def segment(self, row: int) -> Segment:
        """Return the place of its messages, which are the rows of the log from `row` on."""
        return Segment(row, self.where, "message", 1)


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the topics that this project knows; several bags are one log."""
    topics = read_topics(paths, config)
    name = paths[0].stem if paths[0].is_file() else paths[0].name
    for kind, read_kind in ((TRACKS, read_tracks), (TRACKED, read_tracked)):
        if own := [topic for topic in topics if topic.type == kind]:
            return read_kind(own, name, [topic.name for topic in topics if topic.type != kind])
    return read_streams(topics, name, config)


def read_topics(paths: Sequence[Path], config: LogConfig) -> list[Topic]:
    """Read the messages of all topics that can be used, sorted by name.

    Raises:
        InputError: a file is damaged or too large, or no topic can be used.
    """
    listed_topics = listed(config.topics)
    label = str(paths[0]) if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} more"
    topics: dict[str, Topic] = {}
    seen: dict[str, str] = {}
    bounds = BagConfig(most_bytes=config.size_limit << 20)
    rows = 0
    for path in paths:
        with open_bag(path, bounds, "log.size_limit") as bag:
            seen |= {topic.name: topic.type for topic in bag.topics()}
            for message in bag.messages(lambda name, kind: is_used(name, kind, listed_topics)):
                rows += 1
                check_size(str(path), 0, rows, config)
                topic = topics.setdefault(message.topic, Topic(message.topic, message.type, label))
                topic.stamps.append(message.stamp_ns)
                topic.data.append(message.data)
    for name in listed_topics:
        if name not in seen:
            raise InputError(
                f"parameter topics: {paths[0]} has no topic {name!r}; it has {listing(seen)}"
            )
        if seen[name] not in USED:
            raise InputError(
                f"{paths[0]}, topic {name}: type {seen[name]} is not one of {', '.join(USED)}"
            )
    if not topics:
        raise InputError(
            f"{paths[0]}: no topic to read. It has {listing(seen)}. Needed is {FIX} with {TWIST}, or {ODOMETRY}, one per "
            f"vehicle, or a topic named tracks of {TRACKS}, or {TRACKED}; the parameter topics chooses by name"
        )
    return [topics[name] for name in sorted(topics)]


def is_used(topic: str, kind: str, topics: list[str]) -> bool:
    """Return whether a topic is read; of trajectories only those called tracks, unless `topics` names some."""
    if topics:
        return topic in topics and kind in USED
    return kind in USED and (kind != TRACKS or topic.rpartition("/")[2] == "tracks")


def listing(kinds: dict[str, str]) -> str:
    """Return topics and types for a message."""
    return ", ".join(f"{name} ({kind})" for name, kind in sorted(kinds.items())) or "no topics"


def vehicle_id(topic: str) -> str:
    """Return the vehicle of a topic: its namespace, without the prefix `vehicle_` that this project writes."""
    namespace = topic.strip("/").rpartition("/")[0]
    return namespace.rpartition("/")[2].removeprefix("vehicle_") or topic.strip("/")


def read_streams(topics: list[Topic], name: str, config: LogConfig) -> RawLog:
    """Collect fixes, speeds and odometry per vehicle.

    Raises:
        InputError: a message is damaged, positions are of two kinds, or a vehicle has none, or there are too many vehicles.
    """
    label = topics[0].label
    if len({topic.type == ODOMETRY for topic in topics if topic.type != TWIST}) > 1:
        mixed = listing({topic.name: topic.type for topic in topics})
        raise InputError(
            f"{label} has both {FIX} and {ODOMETRY} ({mixed}); choose with the parameter topics"
        )
    vehicles: dict[str, Rows] = {}
    segments: list[Segment] = []
    unstamped: list[str] = []
    frames: dict[str, str] = {}  # of odometry, by vehicle
    owners = find_owners(topics)
    check_vehicles(label, len(set(owners.values())), config)
    row = 0
    for topic in topics:
        segments.append(topic.segment(row))
        frame, is_unstamped = collect(topic, vehicles.setdefault(owners[topic.name], Rows()), row)
        frames |= {owners[topic.name]: frame} if topic.type == ODOMETRY else {}
        unstamped += [topic.name] if is_unstamped else []
        row += len(topic.data)
    notes = check_frames(label, frames, vehicles)
    silent = [
        owners[topic.name]
        for topic in topics
        if topic.type == TWIST and not vehicles[owners[topic.name]].fixes
    ]
    if silent:
        raise InputError(
            f"{label}: there are speeds but no positions of {', '.join(silent)}; put {FIX} and {TWIST} in one namespace"
        )
    if unstamped:
        notes += [
            f"{len(unstamped)} topic(s) have no header stamps; the time of reception is used: {', '.join(unstamped)}"
        ]
    notes += [
        f"vehicle {vehicle} has no speeds: taken from its positions"
        for vehicle, rows in vehicles.items()
        if not rows.speeds
    ]
    return RawLog(
        name=name,
        geographic=any(topic.type == FIX for topic in topics),
        vehicles=tuple(rows.observations(vehicle) for vehicle, rows in vehicles.items()),
        rows=row,
        segments=tuple(segments),
        notes=tuple(notes),
    )


def find_owners(topics: list[Topic]) -> dict[str, str]:
    """Return the vehicle of each topic by its namespace; by the level in which they differ, where several topics share the last.

    Raises:
        InputError: two topics of one type share a namespace.
    """
    owners = {topic.name: vehicle_id(topic.name) for topic in topics}
    parts = {topic.name: topic.name.strip("/").split("/")[:-1] for topic in topics}
    for level in range(min(map(len, parts.values()))):
        if len({(owners[topic.name], topic.type) for topic in topics}) == len(topics):
            break
        owners = {name: own[level].removeprefix("vehicle_") or name for name, own in parts.items()}
    taken: dict[tuple[str, str], str] = {}
    for topic in topics:
        other = taken.setdefault((owners[topic.name], topic.type), topic.name)
        if other != topic.name:
            raise InputError(
                f"{topic.label}: {other} and {topic.name} are both {topic.type} of vehicle {owners[topic.name]}; choose one with "
                "the parameter topics, or record each vehicle in a namespace of its own"
            )
    return owners


def collect(topic: Topic, vehicle: Rows, row: int) -> tuple[str, bool]:
    """Decode the messages of a topic, rows from `row` on, for a vehicle; return its frame, and whether headers bear no stamps."""
    frame, unstamped = "", False
    for number, (received, data) in enumerate(zip(topic.stamps, topic.data, strict=True)):
        sample = decode_sample(data, topic.type, f"{topic.where}, message {number + 1}")
        frame = frame or sample.frame
        unstamped |= sample.stamp_ns == 0
        stamp = sample.stamp_ns or received
        if sample.position is not None:
            vehicle.fixes.append((stamp, row + number, *sample.position, sample.heading))
        if sample.speed is not None:
            vehicle.speeds.append((stamp, row + number, sample.speed))
    return frame, unstamped


def check_frames(label: str, frames: dict[str, str], vehicles: dict[str, Rows]) -> list[str]:
    """Return notes on the frames of odometries, by vehicle.

    Raises:
        InputError: each counts from where it started, or from a vehicle that moves: they have no frame in common.
    """
    for vehicle, frame in frames.items():
        refuse_moving(frame, f"{label}: the odometry of vehicle {vehicle}")
    first = {
        vehicle: min(vehicles[vehicle].fixes) for vehicle in frames if vehicles[vehicle].fixes
    }
    began = [
        vehicle for vehicle, (_, _, x, y, _) in first.items() if math.hypot(x, y) < AT_START_M
    ]
    at_once = (
        len(began) >= 2 and np.ptp([first[vehicle][0] for vehicle in began]) < 1e9 * SPAWNED_S
    )
    named = ", ".join(f"{vehicle} in {frame!r}" for vehicle, frame in frames.items())
    if at_once or len({frames[vehicle] for vehicle in began}) >= 2:
        raise InputError(
            f"{label}: the odometries of {' and '.join(began)} begin at 0, 0, each where its vehicle started ({named}); record "
            "positions in one frame, such as map, or choose with the parameter topics"
        )
    return (
        [f"the odometries name several frames ({named}); they are read as one"]
        if len(set(frames.values())) > 1
        else []
    )


def refuse_moving(frame: str, what: str) -> None:
    """Refuse positions in the frame of a vehicle that moves.

    Raises:
        InputError: they are.
    """
    if frame.rpartition("/")[2].startswith("base_"):
        raise InputError(
            f"{what} is in frame {frame!r}, which moves with its vehicle; record it in a frame that stands, such as map"
        )


def read_tracks(topics: list[Topic], name: str, others: list[str]) -> RawLog:
    """Read tracks: each message on an even clock is an encounter as it stands, without any cleaning; repeats count once.

    Args:
        topics: those of tracks.
        name: of the log.
        others: names of the topics that could be read instead.
    """
    encounters: list[Encounter] = []
    segments, row = [], 0
    whole = len({data for topic in topics for data in topic.data})
    for topic in topics:
        segments.append(topic.segment(row))
        row += len(topic.data)
        for number, data in enumerate(dict.fromkeys(topic.data)):
            found = decode_tracks(data, f"{topic.where}, message {number + 1}")
            encounters.append(
                replace(found, name=name if whole == 1 else f"{name}-{len(encounters) + 1}")
            )
    known = ", ".join(topic.name for topic in topics)
    notes = (
        (f"read from {known}; the parameter topics can choose {', '.join(others)}",)
        if others
        else ()
    )
    return RawLog(name, False, (), row, tuple(segments), notes, encounters=tuple(encounters))


def read_tracked(topics: list[Topic], name: str, others: list[str]) -> RawLog:
    """Read the objects that a perception tracks; a type is the most frequent label.

    Args:
        topics: of tracked objects, one.
        name: of the log.
        others: names of the topics that could be read instead.

    Raises:
        InputError: a message is damaged, or there are several topics or frames.
    """
    topic, frames = topics[0], set()
    if len(topics) > 1:
        listed_topics = listing({t.name: t.type for t in topics})
        raise InputError(
            f"{topic.label} has {listed_topics}; choose one with the parameter topics"
        )
    vehicles: dict[str, Rows] = {}
    sizes: dict[str, list[tuple[float, float]]] = {}
    kinds: dict[str, Counter[str]] = {}
    for row, (received, data) in enumerate(zip(topic.stamps, topic.data, strict=True)):
        where = f"{topic.where}, message {row + 1}"
        stamp, frame, objects = decode_tracked(data, where)
        refuse_moving(frame, where)
        frames.add(frame)
        if len(frames) > 1:
            raise InputError(f"{where}: frame {frame!r} differs from that of the messages before")
        for item in objects:
            kinds.setdefault(item.id, Counter())[item.kind] += 1
            rows = vehicles.setdefault(item.id, Rows())
            rows.fixes.append((stamp or received, row, *item.position, item.heading))
            rows.speeds.append((stamp or received, row, item.speed))
            sizes.setdefault(item.id, []).append(item.size)
    notes = [f"read from {topic.name} in frame {next(iter(frames), '')!r}"]
    if others:
        notes.append(f"the parameter topics can choose {', '.join(others)}")
    found = []
    for vehicle, rows in vehicles.items():
        length, width = np.median(np.array(sizes[vehicle]), axis=0).tolist()
        kind = kinds[vehicle].most_common(1)[0][0]
        found.append(replace(rows.observations(vehicle), length=length, width=width, kind=kind))
    return RawLog(name, False, tuple(found), len(topic.data), (topic.segment(0),), tuple(notes))
