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

"""Parameters of the node `traffic`."""

from dataclasses import dataclass, field

from msg_conventions.autoware import EGO, OBJECTS
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.parameters import parameter, Parameters


@dataclass(frozen=True)
class Config(Parameters):
    """The node's parameters; those of a drive are called drive.step, drive.policy and so on."""

    bag: str = parameter("", "bag with scenarios; empty: they come live from `scenarios`, its `info` and `map`")
    ego: str = parameter("", "id of the vehicle in whose place the ego drives; empty: the scenario's own ego slot, or its first")
    index: int = parameter(0, "number of the first scenario, from 0, in the order of the bag", low=0)
    rate: float = parameter(1.0, "how many times as fast as real time", low=0.01, high=1000.0)
    lock_step: bool = parameter(False, "go one step for each call of ~/step, and not by a clock")
    wait_for_ego: bool = parameter(True, "begin a drive with the ego's first command; else it brakes until one comes")
    silence: float = parameter(0.5, "a command older than this is no command, and the ego brakes", unit="s", low=0.01)
    patience: float = parameter(5.0, "in lock-step, wait so long for a command, in real time", unit="s", low=0.01)
    follow_on: bool = parameter(True, "go on with the next scenario when one is over")
    autoware: bool = parameter(
        False, f"publish {OBJECTS} and {EGO}, too, as Autoware's planners take them; needs autoware_perception_msgs"
    )
    results: str = parameter("", "folder for drives.json and junit.xml, written anew after each drive; empty: none")
    drive: ClosedLoopConfig = field(default_factory=ClosedLoopConfig)
