# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags of rosbag2 and ROS 1: fixes, speeds, odometry, tracked objects or encounters."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.bags.storage.bag import open_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.definitions import TRACKED
from scenario_gen.bags.storage.messages import BagMessage, BagTopic
from scenario_gen.bags.vehicles import (
    decode_samples,
    decode_tracks,
    FIX,
    ODOMETRY,
    POSE,
    POSE_WITH_COVARIANCE,
    Samples,
    TRACKS,
    TRANSFORMS,
    TWIST,
)
from scenario_gen.base.errors import InputError
from scenario_gen.logs.bag_names import (
    clock_doubts,
    find_owners,
    LARGE_COUNT,
    received_window,
    TopicClock,
    without_duplicates,
)
from scenario_gen.logs.config import listed, LogConfig
from scenario_gen.logs.file_names import file_names
from scenario_gen.logs.frames import (
    bodies_of,
    by_vehicle,
    FrameTree,
    in_one_frame,
    Recording,
    recordings_of,
)
from scenario_gen.logs.growing import Span
from scenario_gen.logs.quality import Doubt
from scenario_gen.logs.raw import (
    check_size,
    check_vehicles,
    Observations,
    RawLog,
    Segment,
)
from scenario_gen.types import Encounter

_POSES = (POSE, POSE_WITH_COVARIANCE)
READABLE_TYPES = (FIX, TWIST, ODOMETRY, TRACKS, TRACKED, *_POSES, TRANSFORMS)
_REQUESTED_POSES = ("goal", "goal_pose", "initialpose", "clicked_point")  # not of a vehicle


@dataclass
class Topic:
    """The messages of one topic in the order of the log.

    Attributes:
        name: full name.
        type: of the messages.
        label: the log's name in messages to the user.
        bag: name of the bag, if several have the topic at one time; else "".
        stamps: log stamps [ns].
        data: CDR bytes; empty once `samples` are read.
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

    @cached_property
    def samples(self) -> list[Samples]:
        """The states in its messages, whose bytes are given up to bound the memory.

        Raises:
            InputError: a message is damaged.
        """
        samples = decode_samples(self.data, self.type, lambda row: self.where(row + 1))
        self.data.clear()
        return samples

    def segment(self, first_row: int) -> Segment:
        """Return the place of its messages, which are rows of the log from `first_row` on."""
        return Segment(first_row, f"{self.label}, topic {self.name}{self.part}", "message", 1)


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the known topics; several bags are one log.

    Raises:
        InputError: a bag is damaged or too large, or its topics do not give positions.
    """
    name = paths[0].stem if paths[0].is_file() else paths[0].name
    topics, missing = _read_topics(paths, config)
    log = log_of(topics, name, config)
    return replace(log, notes=(*missing, *log.notes))


def log_of(topics: Sequence[Topic], name: str, config: LogConfig) -> RawLog:
    """Return the log that the messages of known topics make up.

    Raises:
        InputError: a message is damaged, or the topics do not give positions.
    """
    tracks = [topic for topic in topics if topic.type == TRACKS]
    used = {topic.name for topic in tracks}
    if tracks:
        log = _read_encounters(tracks, name)
    else:
        log, used = _read_streams(topics, name, config)
    others = [topic.name for topic in topics if topic.name not in used]
    if not others:
        return log
    note = f"not read: {', '.join(others)}; choose topics with --set log.topics=…"
    return replace(log, notes=(*log.notes, note))


def _read_topics(paths: Sequence[Path], config: LogConfig) -> tuple[list[Topic], tuple[str, ...]]:
    """Read the messages of all usable topics, by name, and what is missing in the bags.

    Raises:
        InputError: a file is damaged or too large, or no topic can be used.
    """
    requested = listed(config.topics)
    label = str(paths[0]) if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} more"
    bounds = BagConfig(most_bytes=config.size_limit << 20)
    bags = file_names([path.resolve() for path in paths])
    offered: list[BagTopic] = []
    missing: list[str] = []
    for path in paths:
        with open_bag(path, bounds, "log.size_limit") as bag:
            offered += bag.topics()
            missing += bag.warnings()
    types = {topic.name: topic.type for topic in offered}
    is_used = _usable(requested)
    window: Span | None = None
    if (config.start or config.end) and sum(topic.count for topic in offered) > LARGE_COUNT:
        window = received_window(paths, is_used, config)
    topics: dict[tuple[str, str], Topic] = {}
    n_rows = 0
    for path, name in zip(paths, bags, strict=True):
        with open_bag(path, bounds, "log.size_limit") as bag:
            n_rows += _add_messages(topics, bag.messages(is_used, window), label, name)
            check_size(str(path), 0, n_rows, config)
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
    return _joined([topics[key] for key in sorted(topics)]), tuple(missing)


def _add_messages(
    topics: dict[tuple[str, str], Topic], messages: Iterable[BagMessage], label: str, bag: str
) -> int:
    """Add messages to their topics, and return their number."""
    count = 0
    for count, message in enumerate(messages, 1):  # noqa: B007
        key = message.topic, bag
        topic = topics.get(key)
        if topic is None:
            topic = topics[key] = Topic(message.topic, message.type, label, bag)
        topic.stamps.append(message.stamp_ns)
        topic.data.append(message.data)
    return count


def _usable(requested: Sequence[str]) -> Callable[[str, str], bool]:
    """Return a function that chooses topics by name and type; transforms are always read."""

    def is_used(topic: str, kind: str) -> bool:
        if kind not in READABLE_TYPES or kind == TRANSFORMS or requested:
            return kind == TRANSFORMS or (topic in requested and kind in READABLE_TYPES)
        return not (_is_other_trajectory(topic, kind) or topic.endswith(_REQUESTED_POSES))

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


def _read_streams(
    topics: Sequence[Topic], name: str, config: LogConfig
) -> tuple[RawLog, set[str]]:
    """Collect positions, speeds and headings per vehicle, in one frame.

    Returns:
        The log, and the topics that were read.

    Raises:
        InputError: a message is damaged, or the topics do not give positions.
    """
    label = topics[0].label
    tree = _frame_tree(topics)
    transforms = {topic.name for topic in topics if topic.type == TRANSFORMS}
    topics, notes = without_duplicates(_with_positions(topics), ODOMETRY)
    recordings, clocks, segments = _collect_all(topics, config)
    _check_positions(label, recordings)
    recordings, frame_notes, frame_doubts = in_one_frame(label, recordings, tree)
    vehicles = {key: _observed(key, group) for key, group in by_vehicle(recordings).items()}
    check_vehicles(label, len(vehicles), config)
    doubts: list[Doubt] = []
    if config.stamps == "header":
        doubts = clock_doubts(clocks, is_part=bool(topics[0].part))
    log = RawLog(
        name=name,
        geographic=any(topic.type == FIX for topic in topics),
        vehicles=tuple(vehicles.values()),
        rows=sum(len(topic.stamps) for topic in topics),
        segments=tuple(segments),
        notes=(*notes, *frame_notes, *_notes(vehicles, clocks)),
        doubts=(*frame_doubts, *doubts),
    )
    return log, transforms | {topic.name for topic in topics}


def _collect_all(
    topics: Sequence[Topic], config: LogConfig
) -> tuple[list[Recording], list[TopicClock], list[Segment]]:
    """Return what topics recorded, their clocks, and the places of their rows.

    Raises:
        InputError: a message is damaged, or two topics are of one vehicle.
    """
    owners = find_owners(topics)
    types = [topic.type for topic in topics]
    if TRACKED in types and len(topics) == 2:
        owners = ["" if kind == TRACKED else "ego" for kind in types]
    recordings: list[Recording] = []
    clocks: list[TopicClock] = []
    segments = []
    n_rows = 0
    for topic, owner in zip(topics, owners, strict=True):
        segments.append(topic.segment(n_rows))
        recorded, clock = _collect(topic, owner, n_rows, config)
        recordings += recorded
        clocks.append(clock)
        n_rows += len(topic.stamps)
    if set(types) == {TRANSFORMS}:
        recordings = bodies_of(recordings)
    return recordings, clocks, segments


def _notes(vehicles: Mapping[str, Observations], clocks: Sequence[TopicClock]) -> Iterator[str]:
    """Yield notes on missing stamps and speeds."""
    unstamped = [clock.topic for clock in clocks if not clock.has_stamps]
    if unstamped:
        names = ", ".join(unstamped)
        yield f"no header stamps, so the time of reception is used: topics {names}"
    for name, vehicle in vehicles.items():
        if not len(vehicle.speed_ns):
            yield f"vehicle {name} has no speeds: derived from its positions"


def _with_positions(topics: Sequence[Topic]) -> list[Topic]:
    """Return the topics with vehicles; transforms only if there are no others.

    Raises:
        InputError: positions have two types.
    """

    def of(*kinds: str) -> list[Topic]:
        return [topic for topic in topics if topic.type in kinds]

    tracked = of(TRACKED)
    if len(tracked) > 1:
        raise _ambiguous(tracked, tracked[:1])
    if tracked:
        return of(TRACKED, ODOMETRY if of(ODOMETRY) else POSE)
    if of(FIX) and of(ODOMETRY, *_POSES):
        raise _ambiguous(topics, of(FIX, TWIST))
    return of(FIX, TWIST, ODOMETRY, *_POSES) or list(topics)


def _ambiguous(topics: Sequence[Topic], usable: Sequence[Topic]) -> InputError:
    """Return the error on topics that cannot be read together, with those that can."""
    names = ",".join(topic.name for topic in usable)
    return InputError(
        f"{topics[0].label} has several kinds of positions ({_listing_of(topics)}); choose "
        f"with --set log.topics={names}"
    )


def _frame_tree(topics: Sequence[Topic]) -> FrameTree:
    """Return the frames that the transforms of a bag tie to each other.

    Raises:
        InputError: a message is damaged.
    """
    tree = FrameTree()
    for topic in topics:
        if topic.type == TRANSFORMS:
            for each in topic.samples:
                assert each.fix is not None
                place = each.fix[:, 0] + 1j * each.fix[:, 1]
                tree.add(each.frame, each.child, each.stamp_ns, place, each.heading)
    return tree


def _observed(name: str, recordings: Sequence[Recording]) -> Observations:
    """Return what topics recorded of one vehicle: positions of one, speeds of all."""
    observed = [recording.observed for recording in recordings]

    def joined(quantity: str) -> Any:
        return np.concatenate([getattr(each, quantity) for each in observed])

    return replace(
        next(each for each in observed if len(each.fix_ns)),
        id=name,
        speed_ns=joined("speed_ns"),
        speed=joined("speed"),
        speed_row=joined("speed_row"),
        course=joined("course"),
    )


def _check_positions(label: str, recordings: Sequence[Recording]) -> None:
    """Check that each vehicle with speeds has positions.

    Raises:
        InputError: one has none.
    """
    without = [
        vehicle
        for vehicle, group in by_vehicle(recordings).items()
        if not any(recording.has_fixes for recording in group)
    ]
    if without:
        raise InputError(
            f"{label}: speeds but no positions of {', '.join(without)}; put {FIX} and "
            f"{TWIST} into one namespace"
        )


def _collect(
    topic: Topic, owner: str, first_row: int, config: LogConfig
) -> tuple[list[Recording], TopicClock]:
    """Return what a topic recorded of each vehicle, in rows of the log from `first_row` on.

    Args:
        topic: the messages.
        owner: the vehicle, if all messages have one child frame; else these name vehicles.
        first_row: number of rows of other topics.
        config: chooses stamps.

    Returns:
        The recordings, and the stamps of the headers against the time of reception.

    Raises:
        InputError: a message is damaged.
    """
    samples = topic.samples
    received = np.array(topic.stamps, dtype=np.int64)
    header = np.zeros_like(received)
    for each in samples:
        header[each.row] = each.stamp_ns
    clock = TopicClock(topic.name, owner or topic.name, header, received)
    if config.stamps == "header":
        stamps = [np.where(each.stamp_ns, each.stamp_ns, received[each.row]) for each in samples]
    else:
        stamps = [received[each.row] for each in samples]
    timed = [replace(each, stamp_ns=ns) for each, ns in zip(samples, stamps, strict=True)]
    recordings = recordings_of(topic.name, timed, first_row)
    names = {recording.vehicle for recording in recordings}
    if topic.type not in (TRACKED, TRANSFORMS) and len(names) == 1:
        recordings = [replace(recording, vehicle=owner) for recording in recordings]
    return recordings, clock


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
