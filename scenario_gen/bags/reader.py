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
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
import sqlite3
from typing import Any

from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader, ReaderError

from msg_conventions.topics import Quality
from scenario_gen.errors import InputError
from scenario_gen.logs.files import bag_files


@dataclass(frozen=True)
class BagTopic:
    """A topic of a bag: its full name, type, what its (first) publisher offered, and its number of messages."""

    name: str
    type: str
    quality: Quality
    count: int


@dataclass(frozen=True)
class BagMessage:
    """One message as it lies in the bag: CDR bytes and the time it was logged, nanoseconds."""

    topic: str
    type: str
    data: bytes
    stamp_ns: int


@contextmanager
def _opened(path: Path) -> Iterator[list[Any]]:
    if not path.exists():
        raise InputError(f"{path}: no such bag")
    files = bag_files(path)
    if not files:
        raise InputError(f"{path}: no bag; name a folder that holds .mcap or .db3 files, or one of them")
    try:
        with ExitStack() as stack:
            yield [stack.enter_context(Reader(file)) for file in files]
    except (ReaderError, OSError, sqlite3.Error, ValueError, TypeError, KeyError, EOFError) as error:
        raise InputError(f"{path}: cannot be read as a bag ({error}); `reindex` saves what is whole in an MCAP file") from error


def bag_topics(path: Path) -> tuple[BagTopic, ...]:
    """Return the topics of a bag, sorted by name.

    Args:
        path: a bag's folder, or one of its files.

    Raises:
        InputError: the bag is missing, damaged or empty of metadata.
    """
    found: dict[str, BagTopic] = {}
    with _opened(path) as readers:
        for connection in chain.from_iterable(reader.connections for reader in readers):
            offered = connection.ext.offered_qos_profiles
            quality = Quality(depth=10, transient_local=False)
            if offered:
                quality = Quality(
                    depth=max(1, offered[0].depth),
                    reliable=offered[0].reliability is not QosReliability.BEST_EFFORT,
                    transient_local=offered[0].durability is QosDurability.TRANSIENT_LOCAL,
                )
            topic = BagTopic(connection.topic, connection.msgtype, quality, connection.msgcount)
            earlier = found.get(topic.name)
            found[topic.name] = replace(earlier, count=earlier.count + topic.count) if earlier else topic
    return tuple(found[name] for name in sorted(found))


def read_messages(path: Path, wanted: Callable[[str], bool] = lambda _: True) -> Iterator[BagMessage]:
    """Yield the messages of the topics that are `wanted`, in the order they were logged.

    Raises:
        InputError: the bag is missing or damaged.
    """
    with _opened(path) as readers:
        for reader in readers:
            connections = [connection for connection in reader.connections if wanted(connection.topic)]
            for connection, stamp_ns, data in reader.messages(connections) if connections else ():
                yield BagMessage(connection.topic, connection.msgtype, bytes(data), stamp_ns)
