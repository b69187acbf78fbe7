# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The vehicles of a bag's topics: by namespace, bag or child frame."""

from collections.abc import Sequence
from typing import Protocol, TypeVar

from scenario_gen.base.errors import InputError

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
