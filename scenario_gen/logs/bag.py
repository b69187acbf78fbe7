# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""rosbag2 bags, MCAP and SQLite: per-vehicle fixes and speeds, odometry, or tracks that are encounters already."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import math
from pathlib import Path

import numpy as np

from scenario_gen.bags.recordings.samples import decode_sample, decode_tracks, FIX, ODOMETRY, TRACKS, TWIST
from scenario_gen.bags.recordings.tracked import decode_tracked, TRACKED, VEHICLES
from scenario_gen.bags.storage.bag import open_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import listed, LogConfig
from scenario_gen.logs.raw import check_size, check_vehicles, RawLog, Rows, Segment
from scenario_gen.types import Encounter

USED = (FIX, TWIST, ODOMETRY, TRACKS, TRACKED)


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
    tracks = [topic for topic in topics if topic.type == TRACKS]
    name = paths[0].stem if paths[0].is_file() else paths[0].name
    tracked = [topic for topic in topics if topic.type == TRACKED]
    if tracked and not tracks:
        return read_tracked(tracked, name, label, others=[topic.name for topic in topics if topic.type != TRACKED])
    if tracks:
        return read_tracks(tracks, name, label, others=[topic.name for topic in topics if topic not in tracks])
    return read_streams(topics, name, label, config)


def read_topics(paths: Sequence[Path], config: LogConfig) -> list[Topic]:
    """Read the messages of all topics that can be used, sorted by name.

    Raises:
        InputError: a file is damaged or too large, or no topic can be used.
    """
    wanted = listed(config.topics)
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
            f"vehicle, or a topic named tracks of {TRACKS}, or {TRACKED}; the parameter topics chooses by name"
        )
    return [found[name] for name in sorted(found)]


def is_used(topic: str, kind: str, wanted: list[str]) -> bool:
    """Return whether a topic is read; of trajectories only those called tracks, unless asked for by name."""
    if wanted:
        return topic in wanted and kind in USED
    return kind in USED and (kind != TRACKS or topic.rpartition("/")[2] == "tracks")


def listing(seen: dict[str, str]) -> str:
    """Topics and types for a message."""
    return ", ".join(f"{name} ({kind})" for name, kind in sorted(seen.items())) or "no topics"


def vehicle_id(topic: str) -> str:
    """The vehicle a topic belongs to: its namespace, without the prefix `vehicle_` that this project writes."""
    namespace = topic.strip("/").rpartition("/")[0]
    return namespace.rpartition("/")[2].removeprefix("vehicle_") or topic.strip("/")


def read_streams(topics: list[Topic], name: str, label: str, config: LogConfig) -> RawLog:
    """Collect fixes, speeds and odometry per vehicle.

    Raises:
        InputError: a message is damaged, positions are of two kinds, or a vehicle has none, or there are too many vehicles.
    """
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
        if collect(topic, vehicle, row, label):
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


def collect(topic: Topic, vehicle: Rows, row: int, label: str) -> bool:
    """Decode the messages of a topic; return whether their headers bear no stamps."""
    unstamped = False
    for number, (received, data) in enumerate(zip(topic.stamps, topic.data, strict=True)):
        sample = decode_sample(data, topic.type, f"{label}, topic {topic.name}, message {number + 1}")
        unstamped |= sample.stamp_ns == 0
        stamp = sample.stamp_ns or received
        if sample.position is not None:
            vehicle.fixes.append((stamp, row + number, *sample.position, sample.heading))
        if sample.speed is not None:
            vehicle.speeds.append((stamp, row + number, sample.speed))
    return unstamped


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
            encounters.append(replace(found, name=name if whole == 1 else f"{name}-{len(encounters) + 1}"))
    if others:
        notes.append(
            f"read from {', '.join(topic.name for topic in topics)}; the parameter topics can choose {', '.join(others)}"
        )
    return RawLog(name, False, (), row, tuple(segments), tuple(notes), encounters=tuple(encounters))


def read_tracked(topics: list[Topic], name: str, label: str, others: list[str]) -> RawLog:
    """Read the objects that a perception tracks; those that are no vehicles are counted and left out.

    Raises:
        InputError: a message is damaged, or there are several topics or frames.
    """
    if len(topics) > 1:
        raise InputError(f"{label} has {listing({t.name: t.type for t in topics})}; choose one with the parameter topics")
    topic, kinds, frames = topics[0], Counter[str](), set()
    vehicles: dict[str, Rows] = {}
    sizes: dict[str, list[tuple[float, float]]] = {}
    left_out: dict[str, str] = {}
    for row, (received, data) in enumerate(zip(topic.stamps, topic.data, strict=True)):
        stamp, frame, objects = decode_tracked(data, f"{label}, topic {topic.name}, message {row + 1}")
        frames.add(frame)
        if len(frames) > 1:
            raise InputError(f"{label}, topic {topic.name}, message {row + 1}: frame {frame!r} is not that of those before")
        for thing in objects:
            if thing.kind not in VEHICLES:
                left_out.setdefault(thing.id, thing.kind)
                continue
            rows = vehicles.setdefault(thing.id, Rows())
            rows.fixes.append((stamp or received, row, *thing.position, thing.heading))
            rows.speeds.append((stamp or received, row, thing.speed))
            sizes.setdefault(thing.id, []).append(thing.size)
    kinds.update(left_out.values())
    notes = [f"read from {topic.name} in frame {next(iter(frames), '')!r}"]
    if kinds:
        counted = ", ".join(f"{count} × {kind}" for kind, count in sorted(kinds.items()))
        notes.append(f"who is no car, truck, bus or trailer was left out: {counted}")
    if others:
        notes.append(f"the parameter topics can choose {', '.join(others)}")
    found = []
    for vehicle, rows in vehicles.items():
        length, width = (value if value > 0.0 else math.nan for value in np.median(np.array(sizes[vehicle]), axis=0).tolist())
        found.append(replace(rows.observations(vehicle), length=length, width=width))
    segment = Segment(0, f"{label}, topic {topic.name}", "message", 1)
    return RawLog(name, False, tuple(found), len(topic.data), (segment,), tuple(notes))
