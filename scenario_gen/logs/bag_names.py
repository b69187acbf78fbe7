# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Topics of a bag: vehicles by name, frames and clocks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
import math
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np

from scenario_gen.bags.storage.bag import open_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.vehicles import ODOMETRY, POSE
from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.growing import Span
from scenario_gen.logs.quality import Doubt, Quantity
from scenario_gen.logs.raw import Rows

_BODY_FRAMES = ("base_link", "base_footprint", "base", "body", "chassis")
_BETTER_NAMES = (
    "filtered",
    "fused",
    "global",
    "kinematic_state",
)  # of two odometries of a vehicle


class _Named(Protocol):
    """A topic with its type, the log's name for messages, and the bag if that names it."""

    name: str
    type: str
    label: str
    bag: str


AnyTopic = TypeVar("AnyTopic", bound=_Named)


def child_vehicle(frame: str) -> str:
    """Return the vehicle of a body frame: `car_a/base_link` and `car_a_base_link` are car_a."""
    name = frame.strip("/")
    for body in _BODY_FRAMES:
        shorter = name.removesuffix(f"/{body}").removesuffix(f"_{body}")
        if shorter != name:
            return shorter
    return name


def without_duplicates(topics: Sequence[AnyTopic], kind: str) -> tuple[list[AnyTopic], list[str]]:
    """Return the topics with one of each namespace of `kind`, and a note on the others.

    A robot often has two odometries, raw and filtered: the filtered one is read.
    """
    roots: dict[str, set[tuple[str, str]]] = {}
    for topic in topics:
        if topic.type == kind:
            root, _, rest = topic.name.strip("/").partition("/")
            roots.setdefault(rest, set()).add((topic.bag, root))
    robots = set().union(*roots.values())
    are_doubled = len(roots) > 1 and len(robots) > 1 and "" not in roots
    if not are_doubled or any(each != robots for each in roots.values()):
        return list(topics), []
    chosen = max(roots, key=_preference)
    left_out = [t for t in topics if t.type == kind and not t.name.endswith(f"/{chosen}")]
    names = ", ".join(topic.name for topic in left_out)
    note = f"second odometries are not read: {names}; choose with --set log.topics=…"
    return [topic for topic in topics if topic not in left_out], [note]


def _preference(name: str) -> tuple[bool, str]:
    return any(word in name for word in _BETTER_NAMES), name


def find_owners(topics: Sequence[_Named]) -> list[str]:
    """Return the vehicle of each topic.

    It is its bag if several have it at one time; else its namespace, or the first level in which
    topics differ.

    Raises:
        InputError: two topics of one type share a namespace.
    """
    by_name = _owners_by_name(topics)
    in_bag: dict[str, set[str]] = {}
    for topic in topics:
        in_bag.setdefault(topic.bag, set()).add(by_name[topic.name])
    owners = []
    taken: dict[tuple[str, str], str] = {}
    for topic in topics:
        owner = by_name[topic.name]
        if topic.bag:
            owner = topic.bag if len(in_bag[topic.bag]) == 1 else f"{topic.bag}_{owner}"
        other = taken.setdefault((owner, topic.type), topic.name)
        if other != topic.name:
            raise InputError(
                f"{topic.label}: {other} and {topic.name} are both {topic.type} of vehicle "
                f"{owner}; choose one with --set log.topics=…, or record each vehicle in its own "
                "namespace"
            )
        owners.append(owner)
    return owners


def _owners_by_name(topics: Sequence[_Named]) -> dict[str, str]:
    """Return the vehicle of each topic by its name alone."""
    by_name = {topic.name: _vehicle_of(topic.name) for topic in topics}
    if any(topic.bag for topic in topics):
        return by_name
    levels = {topic.name: topic.name.strip("/").split("/")[:-1] for topic in topics}
    for level in range(min(map(len, levels.values()))):
        if len({(by_name[topic.name], topic.type) for topic in topics}) == len(topics):
            break
        by_name = {
            name: parts[level].removeprefix("vehicle_") or name for name, parts in levels.items()
        }
    return by_name


def _vehicle_of(topic: str) -> str:
    """Return the namespace of a topic, without the prefix `vehicle_` that this project writes."""
    namespace = topic.strip("/").rpartition("/")[0]
    return namespace.rpartition("/")[2].removeprefix("vehicle_") or topic.strip("/")


_AT_ORIGIN_M = 0.5  # within it, two vehicles cannot be at the same time
_SAME_START_NS = 1e9  # a later vehicle may start at the origin, too
_MAX_START_M = 60.0  # from the origin of its own frame, of a vehicle recorded since it began
_MAX_OFF_AXIS_M = 0.5  # such a vehicle is still on the x axis
_MAX_START_TURN_RAD = 0.1


def base_frames(
    label: str, vehicles: dict[str, Rows], frames: dict[str, str]
) -> tuple[dict[str, Rows], dict[str, str]]:
    """Return the vehicles among transforms, and their frames: those whose parents have no parent.

    Raises:
        InputError: an odometry is between a vehicle and the common frame.
    """
    roots = {child_vehicle(frame) for frame in frames.values()} - set(vehicles)
    bodies = [name for name in vehicles if child_vehicle(frames[name]) in roots]
    odometries = [name for name in bodies if name.rpartition("/")[2] == "odom"]
    if odometries:
        raise InputError(
            f"{label}: {', '.join(odometries)} is between a vehicle and its common frame, and "
            "chains of transforms are not read; record the pose of each vehicle in map, as "
            f"{POSE} or {ODOMETRY}"
        )
    return {name: vehicles[name] for name in bodies}, {name: frames[name] for name in bodies}


def check_frames(label: str, frames: Mapping[str, str], vehicles: Mapping[str, Rows]) -> list[str]:
    """Return notes on the frames of odometries, by vehicle.

    Raises:
        InputError: a frame moves, or each odometry starts at its vehicle's start: they have no
            common frame.
    """
    for vehicle, frame in frames.items():
        check_fixed_frame(frame, f"{label}: the odometry of vehicle {vehicle}")
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
    local = _local_odometries(first_fixes, frames)
    if len(local) >= 2 and len(local) == len(frames):
        raise InputError(
            f"{label}: the odometries of {' and '.join(local)} are in frames that begin where "
            f"each vehicle started ({names}): each is on the x axis of its frame and faces along "
            "it; record positions in one frame, such as map, or choose with --set log.topics=…"
        )
    if len(set(frames.values())) > 1:
        return [f"the odometries name several frames ({names}); they are read as one"]
    return []


def _local_odometries(
    first_fixes: Mapping[str, tuple[int, int, float, float, float]], frames: Mapping[str, str]
) -> list[str]:
    """Return the vehicles whose odometry counts from their start, by its frame and first fix."""
    return [
        vehicle
        for vehicle, first in first_fixes.items()
        if _began_at_origin(first) and frames[vehicle].rpartition("/")[2] == "odom"
    ]


def _began_at_origin(first: tuple[int, int, float, float, float]) -> bool:
    """Return whether a first fix is near the origin, on the x axis and in its direction."""
    _, _, x, y, heading = first
    is_on_axis = -_AT_ORIGIN_M < x < _MAX_START_M and abs(y) < _MAX_OFF_AXIS_M
    return is_on_axis and abs(heading) < _MAX_START_TURN_RAD


def check_fixed_frame(frame: str, place: str) -> None:
    """Check that positions are not in the frame of a moving vehicle.

    Raises:
        InputError: they are.
    """
    if frame.rpartition("/")[2].startswith("base_"):
        raise InputError(
            f"{place} is in frame {frame!r}, which moves with its vehicle; record it in a fixed "
            "frame, such as map"
        )


LARGE_COUNT = 200_000
"""Messages above which a window is read alone; a smaller log is read whole, and cut afterwards."""

_RECEPTION_SLACK_S = 10.0
_LATEST_NS = 2**63 - 1
_MAX_CLOCK_DIFFERENCE_S = 0.5  # of two vehicles; latencies differ by less
_MAX_JITTER_S = 0.25  # of the latency; with more, the time of reception tells nothing
_MIN_MESSAGES_COUNT = 5
_SAME_RATE_RATIO = 0.1
_STAMP_UNITS_S = (1e-3, 1e-6, 1e-9)


@dataclass
class TopicClock:
    """Stamps [ns] of a topic's headers, and of the reception of its messages.

    Attributes:
        topic: its name.
        vehicle: its owner.
        stride: every how many messages the stamps are kept.
        header: stamps of some messages.
        received: stamps of the same messages.
        has_stamps: whether all headers have stamps.
    """

    topic: str
    vehicle: str
    stride: int = 1
    header: list[int] = field(default_factory=list)
    received: list[int] = field(default_factory=list)
    has_stamps: bool = True

    def add(self, number: int, header_ns: int, received_ns: int) -> None:
        """Add a message by its number."""
        self.has_stamps = self.has_stamps and header_ns != 0
        if number % self.stride == 0:
            self.header.append(header_ns)
            self.received.append(received_ns)

    @property
    def rate(self) -> float:
        """How fast the headers' clock runs against the recorder's; NaN if unknown."""
        header = self.header[-1] - self.header[0] if self.header else 0
        received = self.received[-1] - self.received[0] if self.received else 0
        if len(self.header) < _MIN_MESSAGES_COUNT or received <= 0 or not self.has_stamps:
            return np.nan
        return header / received

    def ahead_s(self) -> float:
        """Return how far the headers are ahead of the reception [s]; NaN if it varies."""
        if len(self.header) < _MIN_MESSAGES_COUNT or not self.has_stamps:
            return np.nan
        ahead = np.array(self.header) - np.array(self.received)
        low, median, high = np.percentile(ahead * 1e-9, [10.0, 50.0, 90.0]).tolist()
        return median if high - low < _MAX_JITTER_S else np.nan


def stamp_factor(clocks: Sequence[TopicClock]) -> float:
    """Return the factor to seconds of headers that have another unit; 1.0 if they have not."""
    rates = np.array([clock.rate for clock in clocks])
    if not len(rates) or not np.isfinite(rates).all():
        return 1.0
    for factor in _STAMP_UNITS_S:
        if (np.abs(rates * factor - 1.0) < _SAME_RATE_RATIO).all():
            return factor
    return 1.0


def clock_doubt(clocks: Sequence[TopicClock]) -> Doubt | None:
    """Return a doubt if the clocks of two vehicles differ; None if they do not, or are unknown."""
    ahead: dict[str, float] = {}
    for clock in clocks:
        seconds = clock.ahead_s()
        if np.isfinite(seconds):
            ahead.setdefault(clock.vehicle, seconds)
    if len(ahead) < 2:
        return None
    difference = max(ahead.values()) - min(ahead.values())
    if difference < _MAX_CLOCK_DIFFERENCE_S:
        return None
    listed = ", ".join(f"{name} {seconds:+.2f} s" for name, seconds in ahead.items())
    return Doubt(
        "",
        0.0,
        0.0,
        Quantity.CLOCK,
        difference,
        "s",
        f"the header clocks differ by {difference:.1f} s (header minus reception: {listed})",
        "--set log.stamps=received uses the recorder's clock",
    )


def check_rates(label: str, clocks: Sequence[TopicClock], config: LogConfig) -> None:
    """Check that a window of the time of reception is one of the headers' time.

    Raises:
        InputError: the clocks of the headers are slower or faster.
    """
    if config.stamps == "header" and any(
        abs(clock.rate - 1.0) > _SAME_RATE_RATIO for clock in clocks
    ):
        raise InputError(
            f"{label}: the clock of the headers is not as fast as that of the recorder, so a "
            "window of a large bag cannot be read by the headers: --set log.stamps=received uses "
            "the recorder's clock"
        )


def received_window(
    paths: Sequence[Path], is_used: Callable[[str, str], bool], config: LogConfig
) -> Span:
    """Return the stamps of reception [ns] between which a large log is read.

    Headers are cut afterwards: their stamps may differ by `_RECEPTION_SLACK_S`.

    Raises:
        InputError: a bag is damaged.
    """
    first_ns = []
    for path in paths:
        with open_bag(
            path, BagConfig(most_bytes=config.size_limit << 20), "log.size_limit"
        ) as bag:
            first_ns += [message.stamp_ns for message in islice(bag.messages(is_used), 1)]
    start_ns = min(first_ns, default=0)
    begin_ns = start_ns + round(1e9 * (config.start - _RECEPTION_SLACK_S))
    if not config.end:
        return begin_ns, _LATEST_NS
    return begin_ns, start_ns + round(1e9 * (config.end + _RECEPTION_SLACK_S))
