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

"""What a bag says of the conventions' topics, by namespace; for all that reads whole bags."""

from collections import defaultdict
from collections.abc import Collection
from pathlib import Path

from scenario_gen.bags.reader import DEFAULT, read_messages
from scenario_gen.storage import BagConfig

Contents = dict[str, list[bytes]]  # topic without its namespace -> messages, in order


def read_namespaces(path: Path, topics: Collection[str], config: BagConfig = DEFAULT) -> dict[str, Contents]:
    """Return the messages of `topics` (one name may end with another, e.g. `scenarios/info`) by namespace, sorted.

    Raises:
        InputError: the bag is missing or damaged, or larger than `config` allows.
    """
    found: dict[str, Contents] = defaultdict(lambda: {topic: [] for topic in topics})
    longest_first = sorted(topics, key=len, reverse=True)

    def own(name: str) -> str | None:
        return next((topic for topic in longest_first if f"/{name}".endswith(f"/{topic}")), None)

    for message in read_messages(path, lambda name: own(name) is not None, config):
        topic = own(message.topic) or ""
        found[message.topic.removesuffix(topic).removesuffix("/")][topic].append(message.data)
    return dict(sorted(found.items()))
