# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags of rosbag2 and ROS 1: fixes, speeds, odometry, tracked objects or encounters."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
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
from scenario_gen.logs.raw import check_size, check_vehicles, Observations, RawLog, Rows, Segment
from scenario_gen.types import Encounter

_AT_ORIGIN_M = 0.5  # within it, two vehicles cannot be at the same time
_SAME_START_NS = 1e9  # a later vehicle may start at the origin, too
READABLE_TYPES = (FIX, TWIST, ODOMETRY, TRACKS, TRACKED)


@dataclass
class Topic:
    """The messages of one topic in the order of the log.

    Attributes:
        name: full name.
        type: of the messages.
        label: the log's name in messages to the user.
        stamps: log stamps [ns].
        data: CDR bytes.
    """

    name: str
    type: str
    label: str
    stamps: list[int] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)

    def where(self, number: int) -> str:
        """Name the log, the topic and a message."""
        return f"{self.label}, topic {self.name}, message {number}"

    def segment(self, first_row: int) -> Segment:
        """Return the place of its messages, which are rows of the log from `first_row` on."""
        return Segment(first_row, f"{self.label}, topic {self.name}", "message", 1)


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the known topics; several bags are one log.

    Raises:
        InputError: a bag is damaged or too large, or its topics do not give positions.
    """
    name = paths[0].stem if paths[0].is_file() else paths[0].name
    return log_of(_read_topics(paths, config), name, config)


def log_of(topics: Sequence[Topic], name: str, config: LogConfig) -> RawLog:
    """Return the log that the messages of known topics make up.

    Raises:
        InputError: a message is damaged, or the topics do not give positions.
    """
    tracks = [topic for topic in topics if topic.type == TRACKS]
    tracked = [topic for topic in topics if topic.type == TRACKED]
    if tracks:
        log = _read_encounters(tracks, name)
    elif tracked:
        log = _read_tracked(tracked, name)
    else:
        return _read_streams(topics, name, config)
    kind = TRACKS if tracks else TRACKED
    others = [topic.name for topic in topics if topic.type != kind]
    if not others:
        return log
    note = f"not read: {', '.join(others)}; choose topics with --set log.topics=…"
    return replace(log, notes=(*log.notes, note))


def _read_topics(paths: Sequence[Path], config: LogConfig) -> list[Topic]:
    """Read the messages of all usable topics, by name.

    Raises:
        InputError: a file is damaged or too large, or no topic can be used.
    """
    requested = listed(config.topics)
    label = str(paths[0]) if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} more"
    bounds = BagConfig(most_bytes=config.size_limit << 20)
    topics: dict[str, Topic] = {}
    types: dict[str, str] = {}
    n_rows = 0

    def is_used(topic: str, kind: str) -> bool:
        if requested:
            return topic in requested and kind in READABLE_TYPES
        is_other_trajectory = kind == TRACKS and topic.rpartition("/")[2] != "tracks"
        return kind in READABLE_TYPES and not is_other_trajectory

    for path in paths:
        with open_bag(path, bounds, "log.size_limit") as bag:
            types |= {topic.name: topic.type for topic in bag.topics()}
            for message in bag.messages(is_used):
                n_rows += 1
                check_size(str(path), 0, n_rows, config)
                topic = topics.setdefault(message.topic, Topic(message.topic, message.type, label))
                topic.stamps.append(message.stamp_ns)
                topic.data.append(message.data)
    _check_requested(requested, types, paths[0])
    if not topics:
        raise InputError(
            f"{paths[0]}: no topic to read, it has {_listing(types)}. Needed per vehicle: {FIX} "
            f"with {TWIST}, or {ODOMETRY}; or a topic named tracks of {TRACKED} or {TRACKS}; "
            "choose others by name with --set log.topics=…"
        )
    return [topics[name] for name in sorted(topics)]


def _check_requested(requested: Sequence[str], types: Mapping[str, str], path: Path) -> None:
    """Check the topics that the parameter names.

    Raises:
        InputError: one does not exist, or has another type.
    """
    for name in requested:
        if name not in types:
            raise InputError(
                f"parameter topics: {path} has no topic {name!r}; it has {_listing(types)}"
            )
        if types[name] not in READABLE_TYPES:
            raise InputError(
                f"{path}, topic {name}: type {types[name]} is not one of "
                f"{', '.join(READABLE_TYPES)}"
            )


def _listing(types: Mapping[str, str]) -> str:
    """Return topics and types for a message."""
    return ", ".join(f"{name} ({kind})" for name, kind in sorted(types.items())) or "no topics"


def _listing_of(topics: Iterable[Topic]) -> str:
    return _listing({topic.name: topic.type for topic in topics})


def _read_streams(topics: Sequence[Topic], name: str, config: LogConfig) -> RawLog:
    """Collect fixes, speeds and odometry per vehicle.

    Raises:
        InputError: a message is damaged, positions have two types, or a vehicle has none.
    """
    label = topics[0].label
    if len({topic.type == ODOMETRY for topic in topics if topic.type != TWIST}) > 1:
        raise InputError(
            f"{label} has both {FIX} and {ODOMETRY} ({_listing_of(topics)}); choose with "
            "--set log.topics=…"
        )
    owners = _find_owners(topics)
    check_vehicles(label, len(set(owners.values())), config)
    vehicles: dict[str, Rows] = {}
    odometry_frames: dict[str, str] = {}
    segments = []
    unstamped = []
    n_rows = 0
    for topic in topics:
        owner = owners[topic.name]
        segments.append(topic.segment(n_rows))
        frame, has_stamps = _collect(topic, vehicles.setdefault(owner, Rows()), n_rows)
        if topic.type == ODOMETRY:
            odometry_frames[owner] = frame
        if not has_stamps:
            unstamped.append(topic.name)
        n_rows += len(topic.data)
    _check_positions(topics, owners, vehicles)
    notes = _check_frames(label, odometry_frames, vehicles)
    if unstamped:
        notes.append(
            f"{len(unstamped)} topic(s) have no header stamps; the time of reception is used: "
            f"{', '.join(unstamped)}"
        )
    notes += [
        f"vehicle {vehicle} has no speeds: derived from its positions"
        for vehicle, rows in vehicles.items()
        if not rows.speeds
    ]
    return RawLog(
        name=name,
        geographic=any(topic.type == FIX for topic in topics),
        vehicles=tuple(rows.observations(vehicle) for vehicle, rows in vehicles.items()),
        rows=n_rows,
        segments=tuple(segments),
        notes=tuple(notes),
    )


def _check_positions(
    topics: Sequence[Topic], owners: Mapping[str, str], vehicles: Mapping[str, Rows]
) -> None:
    """Check that each vehicle with speeds has positions.

    Raises:
        InputError: one has none.
    """
    owners_of_speeds = [owners[topic.name] for topic in topics if topic.type == TWIST]
    without = [vehicle for vehicle in owners_of_speeds if not vehicles[vehicle].fixes]
    if without:
        raise InputError(
            f"{topics[0].label}: speeds but no positions of {', '.join(without)}; put {FIX} and "
            f"{TWIST} into one namespace"
        )


def _find_owners(topics: Sequence[Topic]) -> dict[str, str]:
    """Return the vehicle of each topic: its namespace, or the first level in which topics differ.

    Raises:
        InputError: two topics of one type share a namespace.
    """
    owners = {topic.name: _vehicle_of(topic.name) for topic in topics}
    levels = {topic.name: topic.name.strip("/").split("/")[:-1] for topic in topics}
    for level in range(min(map(len, levels.values()))):
        if len({(owners[topic.name], topic.type) for topic in topics}) == len(topics):
            break
        owners = {
            name: parts[level].removeprefix("vehicle_") or name for name, parts in levels.items()
        }
    taken: dict[tuple[str, str], str] = {}
    for topic in topics:
        owner = owners[topic.name]
        other = taken.setdefault((owner, topic.type), topic.name)
        if other != topic.name:
            raise InputError(
                f"{topic.label}: {other} and {topic.name} are both {topic.type} of vehicle "
                f"{owner}; choose one with --set log.topics=…, or record each vehicle in its own "
                "namespace"
            )
    return owners


def _vehicle_of(topic: str) -> str:
    """Return the namespace of a topic, without the prefix `vehicle_` that this project writes."""
    namespace = topic.strip("/").rpartition("/")[0]
    return namespace.rpartition("/")[2].removeprefix("vehicle_") or topic.strip("/")


def _collect(topic: Topic, vehicle: Rows, first_row: int) -> tuple[str, bool]:
    """Add the messages of a topic, rows from `first_row` on, to a vehicle.

    Returns:
        The frame, and whether all headers have stamps.

    Raises:
        InputError: a message is damaged.
    """
    frame = ""
    has_stamps = True
    for row, (received_ns, data) in enumerate(
        zip(topic.stamps, topic.data, strict=True), first_row
    ):
        sample = decode_sample(data, topic.type, topic.where(row - first_row + 1))
        frame = frame or sample.frame
        has_stamps = has_stamps and sample.stamp_ns != 0
        stamp_ns = sample.stamp_ns or received_ns
        if sample.position is not None:
            vehicle.fixes.append((stamp_ns, row, *sample.position, sample.heading))
        if sample.speed is not None:
            vehicle.speeds.append((stamp_ns, row, sample.speed))
    return frame, has_stamps


def _check_frames(
    label: str, frames: Mapping[str, str], vehicles: Mapping[str, Rows]
) -> list[str]:
    """Return notes on the frames of odometries, by vehicle.

    Raises:
        InputError: a frame moves, or each odometry starts at its vehicle's start: they have no
            common frame.
    """
    for vehicle, frame in frames.items():
        _check_fixed_frame(frame, f"{label}: the odometry of vehicle {vehicle}")
    first_fixes = {
        vehicle: min(vehicles[vehicle].fixes) for vehicle in frames if vehicles[vehicle].fixes
    }
    at_origin = [
        vehicle
        for vehicle, (_, _, x, y, _) in first_fixes.items()
        if math.hypot(x, y) < _AT_ORIGIN_M
    ]
    starts_ns = [first_fixes[vehicle][0] for vehicle in at_origin]
    start_together = len(at_origin) >= 2 and np.ptp(starts_ns) < _SAME_START_NS
    names = ", ".join(f"{vehicle} in {frame!r}" for vehicle, frame in frames.items())
    if start_together or len({frames[vehicle] for vehicle in at_origin}) >= 2:
        raise InputError(
            f"{label}: the odometries of {' and '.join(at_origin)} begin at 0, 0, each where its "
            f"vehicle started ({names}); record positions in one frame, such as map, or choose "
            "with --set log.topics=…"
        )
    if len(set(frames.values())) > 1:
        return [f"the odometries name several frames ({names}); they are read as one"]
    return []


def _check_fixed_frame(frame: str, place: str) -> None:
    """Check that positions are not in the frame of a moving vehicle.

    Raises:
        InputError: they are.
    """
    if frame.rpartition("/")[2].startswith("base_"):
        raise InputError(
            f"{place} is in frame {frame!r}, which moves with its vehicle; record it in a fixed "
            "frame, such as map"
        )


def _read_encounters(topics: Sequence[Topic], name: str) -> RawLog:
    """Read recorded encounters, one per message, without cleaning; repeats count once.

    Raises:
        InputError: a message is damaged.
    """
    n_encounters = len({data for topic in topics for data in topic.data})
    encounters: list[Encounter] = []
    segments = []
    n_rows = 0
    for topic in topics:
        segments.append(topic.segment(n_rows))
        n_rows += len(topic.data)
        for number, data in enumerate(dict.fromkeys(topic.data), 1):
            encounter = decode_tracks(data, topic.where(number))
            suffix = f"-{len(encounters) + 1}" if n_encounters > 1 else ""
            encounters.append(replace(encounter, name=f"{name}{suffix}"))
    return RawLog(name, False, (), n_rows, tuple(segments), encounters=tuple(encounters))


@dataclass
class _TrackedVehicle:
    """The observations of one tracked object: states, sizes [m] and labels."""

    rows: Rows = field(default_factory=Rows)
    sizes: list[tuple[float, float]] = field(default_factory=list)
    kinds: Counter[str] = field(default_factory=Counter)

    def observations(self, name: str) -> Observations:
        """Return the states with the median size and the most frequent label."""
        length, width = np.median(np.array(self.sizes), axis=0).tolist()
        kind = self.kinds.most_common(1)[0][0]
        return replace(self.rows.observations(name), length=length, width=width, kind=kind)


def _read_tracked(topics: Sequence[Topic], name: str) -> RawLog:
    """Read the objects that a perception tracks.

    Raises:
        InputError: a message is damaged, or there are several topics or frames.
    """
    topic = topics[0]
    if len(topics) > 1:
        raise InputError(
            f"{topic.label} has {_listing_of(topics)}; choose one with --set log.topics=…"
        )
    vehicles: dict[str, _TrackedVehicle] = {}
    first_frame = ""
    for row, (received_ns, data) in enumerate(zip(topic.stamps, topic.data, strict=True)):
        where = topic.where(row + 1)
        header_ns, frame, objects = decode_tracked(data, where)
        _check_fixed_frame(frame, where)
        first_frame = frame if row == 0 else first_frame
        if frame != first_frame:
            raise InputError(f"{where}: frame {frame!r} differs from {first_frame!r} before")
        stamp_ns = header_ns or received_ns
        for tracked in objects:
            vehicle = vehicles.setdefault(tracked.id, _TrackedVehicle())
            vehicle.rows.fixes.append((stamp_ns, row, *tracked.position, tracked.heading))
            vehicle.rows.speeds.append((stamp_ns, row, tracked.speed))
            vehicle.sizes.append(tracked.size)
            vehicle.kinds[tracked.kind] += 1
    observations = tuple(vehicle.observations(key) for key, vehicle in vehicles.items())
    note = f"read from {topic.name} in frame {first_frame!r}"
    return RawLog(name, False, observations, len(topic.data), (topic.segment(0),), (note,))
