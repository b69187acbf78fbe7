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

"""The nodes under storms: 10⁵ scenarios in a request, hostile messages on every input, 8 clients for 30 min, an end at load 16.

Each storm is a module: `ros_many`, `ros_hostile`, `ros_load`.
"""

from collections.abc import Iterator
from pathlib import Path

from figures import Figure
import ros_hostile
import ros_load
import ros_many


def run(state: Path) -> Iterator[Figure]:
    """Run one storm after the other; each keeps what it measured in a folder of its own."""
    for storm in (ros_load, ros_many, ros_hostile):
        folder = state / storm.__name__
        folder.mkdir(parents=True, exist_ok=True)
        yield from storm.run(folder)
