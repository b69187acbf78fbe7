# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What moves while a bag is played: frames `vehicle_<id>` on /tf, and the footprints in them; the player alone publishes them.

They follow one motion: the `tracks` of a bag, or one of its `scenarios`. Its first sample is at the bag's time of the message,
and each sample is a message of its own, so that what listens has the very poses of the trajectory and fills in between.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node

from msg_conventions.frames import decode_frames, encode_frames
from msg_conventions.pictures import encode_footprint
from msg_conventions.topics import vehicle_topic
from msg_conventions.tracks import FRAME
from msg_conventions.trajectory import decode, Trajectory, TYPE
from scenario_gen.bags.storage.bag import bag_topics, read_messages
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError
from scenario_gen.ros.plumbing.topics import create_publisher, create_subscription, publish
from scenario_gen.types import tokens

MAP = "map"
OWN = 100  # transforms of ours that may be underway


@dataclass(frozen=True, eq=False)
class Motion:
    """A trajectory of a bag: of which topic, and at which of the bag's times its message lies."""

    topic: str
    begin_ns: int
    trajectory: Trajectory


@dataclass(frozen=True)
class Instant:
    """Sample `k` of a motion, at a time of the bag: what is to be published there depends on the clock then."""

    k: int
    stamp_ns: int


def find_motion(bag: Path, wanted: str, number: int, config: BagConfig) -> Motion | None:
    """Return the motion of a topic's message `number`, from 0; None if the bag has no such topic.

    Args:
        bag: its folder or one of its files.
        wanted: the topic's name; its end is enough where no other topic ends so.
        number: which of its messages.
        config: what is read at most.

    Raises:
        InputError: several topics end so, there are less messages, or the message is damaged.
    """
    end = f"/{wanted.lstrip('/')}"
    found = [t for t in bag_topics(bag, config) if t.type == TYPE and t.count and f"/{t.name.lstrip('/')}".endswith(end)]
    exact = [topic for topic in found if f"/{topic.name.lstrip('/')}" == wanted]
    if len(found) > 1 and not exact:
        raise InputError(f"{', '.join(topic.name for topic in found)}: name one of them with the parameter frames")
    if not found:
        return None
    topic = (exact or found)[0]
    for k, message in enumerate(read_messages(bag, lambda name: name == topic.name, config)):
        if k == number:
            return Motion(f"/{topic.name.lstrip('/')}", message.stamp_ns, decode(message.data, topic.name))
    raise InputError(f"parameter scenario is {number}; {topic.name} has {topic.count} messages, counted from 0")


class Frames:
    """Publishes one motion, unless another publisher publishes the same frames: then who has published less of them gives in."""

    def __init__(self, node: Node, motion: Motion) -> None:
        self._node, self._motion = node, motion
        names = tokens(vehicle.id for vehicle in motion.trajectory.vehicles)
        self._children = tuple(f"vehicle_{name}" for name in names)
        space = motion.topic.rpartition("/tracks")[0] or motion.topic.rpartition("/scenarios")[0]
        self._tf, tie, *self._footprints = (
            create_publisher(node, topic)
            for topic in ("/tf", "/tf_static", *(f"{space}/{vehicle_topic(n, 'footprint')}" for n in names))
        )
        self.publishers = (self._tf, tie, *self._footprints)
        self._own: deque[bytes] = deque(maxlen=OWN)
        self._published = 0
        self._given_in = False
        create_subscription(node, "/tf", self._yield_to_others)
        # The suite's maps and tracks have no place on the earth in common but where a map is the template's own.
        publish(node, tie, encode_frames(np.zeros((1, 3)), [FRAME], MAP, 0))

    def instants(self) -> Iterator[Instant]:
        """Yield the samples, each at its time of the bag."""
        for k, time_ns in enumerate(self._motion.trajectory.time_ns.tolist()):
            yield Instant(k, self._motion.begin_ns + time_ns)

    def publish(self, instant: Instant, stamp_ns: int) -> None:
        """Publish one sample's frames, and the footprints in them."""
        if self._given_in:
            return
        motion = self._motion.trajectory
        here = np.ones(len(self._children), dtype=bool) if motion.there is None else motion.there[:, instant.k]
        poses = np.column_stack((motion.position[:, instant.k], motion.heading[:, instant.k]))[here]
        children = [child for child, there in zip(self._children, here, strict=True) if there]
        data = encode_frames(poses, children, motion.frame_id, stamp_ns)
        self._own.append(data)
        self._published += 1
        publish(self._node, self._tf, data)
        for publisher, vehicle, frame, there in zip(self._footprints, motion.vehicles, self._children, here, strict=True):
            if there:
                publish(self._node, publisher, encode_footprint(vehicle, stamp_ns, frame))

    def _yield_to_others(self, data: bytes, info: dict[str, Any]) -> None:
        """Give in to whoever publishes one of these frames and has published more on /tf."""
        if self._given_in or data in self._own:
            return
        try:
            others = {child for _, _, child, _ in decode_frames(data)} & set(self._children)
        except InputError:
            return
        if others and info["publication_sequence_number"] >= self._published:
            self._given_in = True
            self._node.get_logger().error(
                f"another publisher of /tf publishes {', '.join(sorted(others))}: this player publishes no frames any more; "
                "play one motion at a time in a ROS domain, or set the parameter frames to ''"
            )
