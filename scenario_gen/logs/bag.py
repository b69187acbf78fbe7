# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags of rosbag2 and ROS 1: fixes, speeds, odometry, tracked objects or encounters."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from scenario_gen.bags.storage.bag import open_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.definitions import TRACKED
from scenario_gen.bags.storage.mcap import BagTopic
from scenario_gen.bags.vehicles import (
    decode_samples,
    decode_tracked,
    decode_tracks,
    FIX,
    ODOMETRY,
    POSE,
    POSE_WITH_COVARIANCE,
    Sample,
    TRACKS,
    TRANSFORMS,
    TWIST,
)
from scenario_gen.base.errors import InputError
from scenario_gen.logs.bag_names import (
    base_frames,
    check_fixed_frame,
    check_frames,
    check_rates,
    child_vehicle,
    clock_doubt,
    find_owners,
    LARGE_COUNT,
    received_window,
    stamp_factor,
    TopicClock,
    without_duplicates,
)
from scenario_gen.logs.config import listed, LogConfig
from scenario_gen.logs.file_names import file_names
from scenario_gen.logs.growing import Span
from scenario_gen.logs.quality import Doubt
from scenario_gen.logs.raw import check_size, check_vehicles, Observations, RawLog, Rows, Segment
from scenario_gen.types import Encounter

_CLOCK_SAMPLES_COUNT = 1_000  # messages of a topic whose stamps are compared
_FIRST_MESSAGES_COUNT = 50  # show whether a topic has several vehicles
_RECORDINGS = (FIX, TWIST, ODOMETRY, TRACKS, TRACKED)
_POSES = (POSE, POSE_WITH_COVARIANCE)
READABLE_TYPES = (*_RECORDINGS, *_POSES, TRANSFORMS)
_REQUESTED_POSES = ("goal_pose", "initialpose", "clicked_point")  # of a person, not of a vehicle


@dataclass
class Topic:
    """The messages of one topic in the order of the log.

    Attributes:
        name: full name.
        type: of the messages.
        label: the log's name in messages to the user.
        bag: name of the bag, if several have the topic at one time; else "".
        stamps: log stamps [ns].
        data: CDR bytes; empty once a message is decoded.
        part: the window of time that is read, if not all of it; else "".
    """

    name: str
    type: str
    label: str
    bag: str = ""
    stamps: list[int] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)
    part: str = ""

    def where(self, number: int) -> str:
        """Name the log, the topic and a message."""
        return f"{self.label}, topic {self.name}{self.part}, message {number}"

    def segment(self, first_row: int) -> Segment:
        """Return the place of its messages, which are rows of the log from `first_row` on."""
        return Segment(first_row, f"{self.label}, topic {self.name}{self.part}", "message", 1)


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
    used: set[str] = set()
    if tracks:
        log = _read_encounters(tracks, name)
    elif tracked:
        odometries = [topic for topic in topics if topic.type == ODOMETRY]
        log, used = _read_tracked(tracked, odometries, name, config)
    else:
        return _read_streams(topics, name, config)
    kind = TRACKS if tracks else TRACKED
    others = [topic.name for topic in topics if topic.type != kind and topic.name not in used]
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
    bags = file_names([path.resolve() for path in paths])
    offered: list[BagTopic] = []
    for path in paths:
        with open_bag(path, bounds, "log.size_limit") as bag:
            offered += bag.topics()
    types = {topic.name: topic.type for topic in offered}
    is_used = _usable(requested, types)
    window: Span | None = None
    if (config.start or config.end) and sum(topic.count for topic in offered) > LARGE_COUNT:
        window = received_window(paths, is_used, config)
    topics: dict[tuple[str, str], Topic] = {}
    n_rows = 0
    for path, name in zip(paths, bags, strict=True):
        with open_bag(path, bounds, "log.size_limit") as bag:
            for message in bag.messages(is_used, window):
                n_rows += 1
                check_size(str(path), 0, n_rows, config)
                key = message.topic, name
                topic = topics.setdefault(key, Topic(message.topic, message.type, label, name))
                topic.stamps.append(message.stamp_ns)
                topic.data.append(message.data)
    if window:
        for topic in topics.values():
            topic.part = f" from {config.start:g} s on"
    _check_requested(requested, types, paths[0])
    if not topics:
        raise InputError(
            f"{paths[0]}: no topic to read, it has {_listing(types)}. Needed per vehicle: {FIX} "
            f"with {TWIST}, or {ODOMETRY}; or a topic named tracks of {TRACKED} or {TRACKS}; "
            "choose with --set log.topics=…, or convert others with topic_tools"
        )
    return _joined([topics[key] for key in sorted(topics)])


def _usable(requested: Sequence[str], types: Mapping[str, str]) -> Callable[[str, str], bool]:
    """Return a function that chooses topics by name and type.

    Poses count if there are no recordings of other types, and transforms if there are no poses.
    """
    known = [kind for name, kind in types.items() if not _is_other_trajectory(name, kind)]
    poses = [n for n, kind in types.items() if kind in _POSES and not n.endswith(_REQUESTED_POSES)]
    kinds: Sequence[str] = _RECORDINGS
    if not set(known) & set(_RECORDINGS):
        kinds = _POSES if poses else (TRANSFORMS,)

    def is_used(topic: str, kind: str) -> bool:
        if requested:
            return topic in requested and kind in READABLE_TYPES
        is_excluded = _is_other_trajectory(topic, kind) or topic.endswith(_REQUESTED_POSES)
        return kind in kinds and not is_excluded

    return is_used


def _is_other_trajectory(topic: str, kind: str) -> bool:
    return kind == TRACKS and topic.rpartition("/")[2] != "tracks"


def _joined(topics: Sequence[Topic]) -> list[Topic]:
    """Return topics of several bags: one that bags have in turn is one, else each is its bag's."""
    by_name: dict[str, list[Topic]] = {}
    for topic in topics:
        by_name.setdefault(topic.name, []).append(topic)
    joined: list[Topic] = []
    for parts in by_name.values():
        parts.sort(key=lambda part: part.stamps[0])
        overlaps = any(after.stamps[0] < before.stamps[-1] for before, after in pairwise(parts))
        if overlaps and parts[0].type != TRACKS:
            joined += sorted(parts, key=lambda part: part.bag)
            continue
        first = parts[0]
        for part in parts[1:]:
            first.stamps += part.stamps
            first.data += part.data
        first.bag = ""
        joined.append(first)
    return joined


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
    if len({topic.type == FIX for topic in topics if topic.type != TWIST}) > 1:
        raise InputError(
            f"{label} has both {FIX} and {ODOMETRY} ({_listing_of(topics)}); choose with "
            "--set log.topics=…"
        )
    topics, notes = without_duplicates(topics, ODOMETRY)
    owners = find_owners(topics)
    vehicles: dict[str, Rows] = {}
    frames: dict[str, str] = {}
    clocks: list[TopicClock] = []
    segments = []
    n_rows = 0
    for topic, owner in zip(topics, owners, strict=True):
        segments.append(topic.segment(n_rows))
        clock = _collect(topic, owner, vehicles, frames, n_rows, config)
        clocks.append(clock)
        n_rows += len(topic.data)
    if all(topic.type == TRANSFORMS for topic in topics):
        vehicles, frames = base_frames(label, vehicles, frames)
    check_vehicles(label, len(vehicles), config)
    _check_positions(topics, owners, vehicles)
    notes += check_frames(label, frames, vehicles)
    if topics[0].part:
        check_rates(label, clocks, config)
    vehicles, doubts = _checked_clocks(vehicles, clocks, notes, config)
    unstamped = [clock.topic for clock in clocks if not clock.has_stamps]
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
        doubts=doubts,
    )


def _checked_clocks(
    vehicles: dict[str, Rows], clocks: Sequence[TopicClock], notes: list[str], config: LogConfig
) -> tuple[dict[str, Rows], tuple[Doubt, ...]]:
    """Return the vehicles with stamps in seconds, and a doubt if their clocks differ."""
    if config.stamps != "header":
        return vehicles, ()
    factor = stamp_factor(clocks)
    if factor == 1.0:
        doubt = clock_doubt(clocks)
        return vehicles, (doubt,) if doubt else ()
    notes.append(f"header stamps advance {1 / factor:g} times too fast: they are scaled")
    return {name: _scaled(rows, factor) for name, rows in vehicles.items()}, ()


def _scaled(rows: Rows, factor: float) -> Rows:
    """Return rows with scaled stamps."""
    fixes = [(round(fix[0] * factor), *fix[1:]) for fix in rows.fixes]
    speeds = [(round(speed[0] * factor), *speed[1:]) for speed in rows.speeds]
    return Rows(fixes, speeds)


def _check_positions(
    topics: Sequence[Topic], owners: Sequence[str], vehicles: Mapping[str, Rows]
) -> None:
    """Check that each vehicle with speeds has positions.

    Raises:
        InputError: one has none.
    """
    owners_of_speeds = [
        owner for topic, owner in zip(topics, owners, strict=True) if topic.type == TWIST
    ]
    without = [vehicle for vehicle in owners_of_speeds if not vehicles[vehicle].fixes]
    if without:
        raise InputError(
            f"{topics[0].label}: speeds but no positions of {', '.join(without)}; put {FIX} and "
            f"{TWIST} into one namespace"
        )


def _collect(
    topic: Topic,
    owner: str,
    vehicles: dict[str, Rows],
    frames: dict[str, str],
    first_row: int,
    config: LogConfig,
) -> TopicClock:
    """Add the messages of a topic, rows from `first_row` on, to its vehicles.

    Args:
        topic: the messages.
        owner: the vehicle, if all messages have one child frame; else child frames name vehicles.
        vehicles: receives the rows.
        frames: receives the first frame of each vehicle with a pose.
        first_row: number of rows of other topics.
        config: chooses stamps.

    Returns:
        The stamps of the headers against the time of reception.

    Raises:
        InputError: a message is damaged.
    """
    clock = TopicClock(topic.name, owner, max(len(topic.data) // _CLOCK_SAMPLES_COUNT, 1))
    by_child = topic.type == TRANSFORMS or _has_several_children(topic)
    for number, (received_ns, data) in enumerate(zip(topic.stamps, topic.data, strict=True)):
        for sample in decode_samples(data, topic.type, topic.where(number + 1)):
            name = child_vehicle(sample.child) if by_child else owner
            clock.add(number, sample.stamp_ns, received_ns)
            uses_header = sample.stamp_ns and config.stamps == "header"
            stamp_ns = sample.stamp_ns if uses_header else received_ns
            _add_sample(vehicles.setdefault(name, Rows()), sample, stamp_ns, first_row + number)
            if sample.frame:
                frames.setdefault(name, sample.frame)
        topic.data[number] = b""  # bounds the memory
    return clock


def _has_several_children(topic: Topic) -> bool:
    """Return whether the first odometries of a topic are those of several body frames."""
    if topic.type != ODOMETRY:
        return False
    first = enumerate(topic.data[:_FIRST_MESSAGES_COUNT], 1)
    samples = [s for k, data in first for s in decode_samples(data, topic.type, topic.where(k))]
    return len({sample.child for sample in samples}) > 1


def _add_sample(vehicle: Rows, sample: Sample, stamp_ns: int, row: int) -> None:
    """Add a state to a vehicle."""
    if sample.position is not None:
        vehicle.fixes.append((stamp_ns, row, *sample.position, sample.heading))
    if sample.speed is not None:
        vehicle.speeds.append((stamp_ns, row, sample.speed))


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


def _read_tracked(
    topics: Sequence[Topic], odometries: Sequence[Topic], name: str, config: LogConfig
) -> tuple[RawLog, set[str]]:
    """Read the objects that a perception tracks, and the ego by its odometry in the same frame.

    Returns:
        The log, and the topics of odometry that were read.

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
        check_fixed_frame(frame, where)
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
    observations = [vehicle.observations(key) for key, vehicle in vehicles.items()]
    notes = [f"read from {topic.name} in frame {first_frame!r}"]
    segments = [topic.segment(0)]
    n_rows = len(topic.data)
    used = set()
    for odometry in odometries:
        rows: dict[str, Rows] = {}
        frames: dict[str, str] = {}
        owner = "ego" if len(odometries) == 1 else find_owners([odometry])[0]
        _collect(odometry, owner, rows, frames, n_rows, config)
        if frames.get(owner) != first_frame:
            continue
        used.add(odometry.name)
        observations.append(rows[owner].observations(owner))
        segments.append(odometry.segment(n_rows))
        n_rows += len(odometry.data)
        notes.append(
            f"vehicle {owner} is read from {odometry.name}: positions are those of its child frame"
        )
    log = RawLog(name, False, (*observations,), n_rows, (*segments,), (*notes,))
    return log, used
