# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Topics of a bag: vehicles by name, frames and clocks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np

from scenario_gen.bags.storage.bag import open_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.growing import Span
from scenario_gen.logs.quality import Doubt, Quantity
from scenario_gen.numerics import Ints

BODY_FRAMES = ("base_link", "base_footprint", "base", "body", "chassis")
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
    for body in BODY_FRAMES:
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


LARGE_COUNT = 200_000
"""Messages above which a window is read alone; a smaller log is read whole, and cut afterwards."""

_RECEPTION_SLACK_S = 10.0
_LATEST_NS = 2**63 - 1
_MIN_CLOCK_DIFFERENCE_S = 0.2  # of two topics; latencies differ by less
_MAX_CLOCK_DIFFERENCE_S = 1.0  # above, the reading stops
_MAX_RATE_ERROR_RATIO = 0.01
_MAX_JITTER_S = 0.25  # of the latency; with more, the time of reception tells nothing
_MIN_MESSAGES_COUNT = 5
_OTHER_UNIT_RATIO = 100.0  # of the rates; no simulation is so fast


@dataclass(frozen=True, eq=False)
class TopicClock:
    """Stamps (F,) [ns] of a topic's headers, 0 if they have none, and of their reception.

    Attributes:
        topic: its name.
        vehicle: its owner.
        header: stamps of the headers.
        received: stamps of the same messages.
    """

    topic: str
    vehicle: str
    header: Ints
    received: Ints

    @property
    def has_stamps(self) -> bool:
        """Whether all headers have stamps."""
        return bool(self.header.all())

    @property
    def rate(self) -> float:
        """How fast the headers' clock runs against the recorder's; NaN if unknown."""
        if len(self.header) < _MIN_MESSAGES_COUNT or not self.has_stamps:
            return np.nan
        header, received = (int(ns[-1] - ns[0]) for ns in (self.header, self.received))
        return header / received if received > 0 else np.nan

    def ahead_s(self) -> tuple[float, float]:
        """Return how far the headers are ahead of the reception [s] at begin and end, or NaN.

        It varies with the latency, so each is the median of a tenth of the messages.
        """
        if len(self.header) < _MIN_MESSAGES_COUNT or not self.has_stamps:
            return np.nan, np.nan
        ahead = (self.header - self.received) * 1e-9
        count = max(len(ahead) // 10, _MIN_MESSAGES_COUNT)
        parts = ahead[:count], ahead[-count:]
        if max(float(np.ptp(np.percentile(part, [20.0, 80.0]))) for part in parts) > _MAX_JITTER_S:
            return np.nan, np.nan
        return float(np.median(parts[0])), float(np.median(parts[1]))


def clock_doubts(clocks: Sequence[TopicClock], *, is_part: bool) -> list[Doubt]:
    """Return doubts if the clocks of two topics differ, or one is not as fast as the recorder's.

    Latencies differ by less than .2 s; by a second, vehicles are metres away from their places.
    A part of a large log is cut by the time of reception, so its headers must be as fast.
    """
    ahead = {clock.vehicle: clock.ahead_s() for clock in clocks}
    ahead = {name: ends for name, ends in ahead.items() if np.isfinite(ends).all()}
    doubts = []
    if len(ahead) > 1:
        values = np.array(list(ahead.values()))
        difference = float(np.ptp(values, axis=0).max())
        if difference >= _MIN_CLOCK_DIFFERENCE_S:
            listed = ", ".join(f"{name} {begin:+.2f} s" for name, (begin, _) in ahead.items())
            cause = f"clocks differ by {difference:.1f} s (header minus reception: {listed})"
            doubts.append(_clock_doubt(cause, difference))
    for clock in clocks:
        if abs(clock.rate - 1.0) > _MAX_RATE_ERROR_RATIO:
            cause = (
                f"clock of {clock.vehicle} runs {clock.rate:.3g} times as fast as the recorder's"
            )
            doubt = _clock_doubt(cause, clock.rate)
            doubts.append(replace(doubt, stops=is_part or clock.rate > _OTHER_UNIT_RATIO))
    return doubts


def _clock_doubt(cause: str, size: float) -> Doubt:
    return Doubt(
        Quantity.CLOCK,
        size,
        f"the header {cause}",
        "--set log.stamps=received uses the recorder's clock",
        unit="s",
        stops=size >= _MAX_CLOCK_DIFFERENCE_S,
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
