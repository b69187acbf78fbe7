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
from pathlib import Path

from scenario_gen.errors import InputError
from scenario_gen.storage.bag import BagTopic, open_bag
from scenario_gen.storage.bag import StoredMessage as BagMessage
from scenario_gen.storage.config import BagConfig

__all__ = ["BagMessage", "BagTopic", "bag_topics", "read_messages", "within"]

DEFAULT = BagConfig()


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
    with open_bag(path, config) as bag:
        return bag.topics()


def read_messages(
    path: Path, wanted: Callable[[str], bool] = lambda _: True, config: BagConfig = DEFAULT
) -> Iterator[BagMessage]:
    """Yield the messages of the topics that are `wanted`, in the order they were logged; those of all files of a bag together.

    Raises:
        InputError: the bag is missing or damaged, or larger than `config` allows.
    """
    with open_bag(path, config) as bag:
        yield from bag.messages(lambda topic, _: wanted(topic))
