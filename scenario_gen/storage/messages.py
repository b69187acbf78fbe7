# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Any rosbag2 bag, MCAP or SQLite, as raw messages."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from scenario_gen.errors import InputError
from scenario_gen.storage.bag import open_bag
from scenario_gen.storage.bag import StoredMessage as BagMessage
from scenario_gen.storage.config import BagConfig
from scenario_gen.storage.metadata import quality_of
from scenario_gen.types.qos import Quality

__all__ = ["BagMessage", "BagTopic", "bag_topics", "read_messages", "within"]

DEFAULT = BagConfig()


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag: its full name, type, what its (first) publisher offered, and its number of messages."""

    name: str
    type: str
    quality: Quality
    count: int


@contextmanager
def within(path: Path) -> Iterator[None]:
    """Name the bag in errors about what lies in it: a decoder knows the topic only.

    Raises:
        InputError: as raised inside, with the bag's name.
    """
    try:
        yield
    except InputError as error:
        if str(path) in str(error):
            raise
        raise InputError(f"{path}: {error}") from error


def bag_topics(path: Path, config: BagConfig = DEFAULT) -> tuple[BagTopic, ...]:
    """Return the topics of a bag, sorted by name.

    Args:
        path: a bag's folder, or one of its files.
        config: what is read at most.

    Raises:
        InputError: the bag is missing, damaged or empty of metadata.
    """
    found: dict[str, BagTopic] = {}
    with open_bag(path, config) as bag:
        for stored in bag.topics():
            topic = BagTopic(stored.name, stored.type, quality_of(stored.qos), stored.count)
            earlier = found.get(topic.name)
            found[topic.name] = replace(earlier, count=earlier.count + topic.count) if earlier else topic
    return tuple(found[name] for name in sorted(found))


def read_messages(
    path: Path, wanted: Callable[[str], bool] = lambda _: True, config: BagConfig = DEFAULT
) -> Iterator[BagMessage]:
    """Yield the messages of the topics that are `wanted`, in the order they were logged; those of all files of a bag together.

    Raises:
        InputError: the bag is missing or damaged, or larger than `config` allows.
    """
    with open_bag(path, config) as bag:
        yield from bag.messages(lambda topic, _: wanted(topic))
