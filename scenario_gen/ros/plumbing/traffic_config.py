# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the node `traffic`."""

from dataclasses import dataclass, field

from msg_conventions.autoware import EGO, OBJECTS
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.closed_loop.config import ClosedLoopConfig


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
