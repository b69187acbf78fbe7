# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The motion that a bag is played with: its tracks, or one of its scenarios."""

from dataclasses import dataclass
from pathlib import Path

from msg_conventions.trajectory import decode, Trajectory, TYPE
from scenario_gen.bags.storage.bag import bag_topics, read_messages
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError


@dataclass(frozen=True, eq=False)
class Motion:
    """A trajectory of a bag: of which topic, and at which of the bag's times its message lies."""

    topic: str
    begin_ns: int
    trajectory: Trajectory


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
