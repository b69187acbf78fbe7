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

"""Save what is whole in the MCAP files of a bag whose recorder was killed, and write its metadata.yaml."""

from collections.abc import Iterator
from pathlib import Path

from mcap.exceptions import McapError
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader

from scenario_gen.bags.writer import AtomicBag
from scenario_gen.errors import InputError
from scenario_gen.folders import Kind

REINDEXED = Kind("reindexed bag")


def whole_records(path: Path) -> Iterator[Schema | Channel | Message]:
    """Yield the schemas, channels and messages of an MCAP file up to where it breaks off."""
    with path.open("rb") as stream:
        try:
            for record in StreamReader(stream, record_size_limit=None).records:
                if isinstance(record, Schema | Channel | Message):
                    yield record
        except (McapError, EOFError, OSError, ValueError, RuntimeError):
            return


def reindex(folder: Path, target: Path) -> int:
    """Write the messages that can still be read in `folder` to the bag `target`; return how many.

    Raises:
        InputError: there is no MCAP file in `folder`, or none holds a whole message.
    """
    files = sorted(folder.glob("*.mcap"), key=lambda path: (len(path.name), path.name))
    if not files:
        raise InputError(f"{folder}: no .mcap file here; name the folder of a recorded bag")
    saved = 0
    with AtomicBag(target, REINDEXED, [folder]) as bag:
        for path in files:
            schemas: dict[int, Schema] = {}
            channels: dict[int, Channel] = {}
            for record in whole_records(path):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                    qos, type_hash = (record.metadata.get(key, "") for key in ("offered_qos_profiles", "topic_type_hash"))
                    bag.add_topic(record.topic, schemas[record.schema_id].name, qos, type_hash)
                else:
                    bag.write(channels[record.channel_id].topic, record.data, record.log_time)
                    saved += 1
        if not saved:
            raise InputError(f"{folder}: not one whole message is left in {', '.join(path.name for path in files)}")
    return saved
