# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of nodes that are arguments of the launch files, too: `ros2 launch` imports this in a Python without numba."""

from dataclasses import dataclass, field

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.closed_loop.config import ClosedLoopConfig


@dataclass(frozen=True)
class LogPlayerParameters(Parameters):
    """Of the log player; beside them `log.…`."""

    log_path: str = parameter("", "log to read: a file, a bag or a folder of files")
    encounter: int = parameter(0, "which encounter of the log, from 0", low=0)
    stream: bool = parameter(
        False,
        "play the encounter as fixes and speeds of each vehicle, with /clock, and not as tracks",
    )
    rate: float = parameter(
        1.0, "how many times as fast as it was recorded the stream is", low=0.01, high=1000.0
    )
    wait_matching_subscriptions: int = parameter(
        0, "do not begin to stream before each stream has so many listeners", low=0
    )


@dataclass(frozen=True)
class RoadServerParameters(Parameters):
    """Of the road server; beside them `road.…`."""

    road_name: str = parameter(
        "t_intersection",
        "straight, curve, t_intersection, four_way, merge, roundabout, corridor, a map_server YAML file, or a vector map "
        "(.osm, .xodr, .xml)",
    )
    wait_for_tracks: bool = parameter(
        False, "publish nothing until tracks say what the road is sized to"
    )


@dataclass(frozen=True)
class SamplerParameters(Parameters):
    """Of the sampler; beside them those of a request, `fitting.…`, `planning.…`, `sampling.…` and `limits.…`."""

    count: int = parameter(50, "scenarios to generate", low=1, high=100_000)
    seed: int = parameter(
        0, "seed of the scenarios, and of the planner where states are requested", low=0
    )
    generate_on_input: bool = parameter(
        True, "generate whenever the inputs are complete or change; false: on ~/generate only"
    )
    patience: float = parameter(
        60.0,
        "wait so long for subscribers of scenarios that acknowledge none, then go on and warn; 0: for ever",
        unit="s",
        low=0.0,
    )
    pair_map: bool = parameter(
        True, "take only a map with the recording's stamp; false: any map server's newest one"
    )


@dataclass(frozen=True)
class RecorderParameters(Parameters):
    """Of the recorder."""

    bag: str = parameter(
        "", "folder of the bag to begin at once; empty waits for ~/start and names it by the time"
    )
    topics: str = parameter(
        "",
        "regular expression of the full names of the topics to record; empty: those of the node's namespace, /clock and /tf",
    )
    compress: bool = parameter(True, "compress chunks with zstd")
    split_bytes: int = parameter(
        0, "begin a new file after so many bytes of messages; 0 never", unit="B", low=0
    )
    split_seconds: float = parameter(
        0.0, "begin a new file after so long; 0 never", unit="s", low=0.0
    )


@dataclass(frozen=True)
class TrafficParameters(Parameters):
    """Of traffic; those of a drive are called drive.step, drive.policy and so on."""

    bag: str = parameter(
        "", "bag with scenarios; empty: they come live from `scenarios`, its `info` and `map`"
    )
    ego: str = parameter(
        "",
        "id of the vehicle in whose place the ego drives; empty: the scenario's own ego slot, or its first",
    )
    index: int = parameter(
        0, "number of the first scenario, from 0, in the order of the bag", low=0
    )
    rate: float = parameter(1.0, "how many times as fast as real time", low=0.01, high=1000.0)
    lock_step: bool = parameter(False, "go one step for each call of ~/step, and not by a clock")
    wait_for_ego: bool = parameter(
        True, "begin a drive with the ego's first command; else it brakes until one comes"
    )
    silence: float = parameter(
        0.5, "a command older than this is no command, and the ego brakes", unit="s", low=0.01
    )
    patience: float = parameter(
        5.0, "in lock-step, wait so long for a command, in real time", unit="s", low=0.01
    )
    follow_on: bool = parameter(
        True, "go on with the next scenario when one is over; else it waits for ~/next"
    )
    autoware: bool = parameter(
        False,
        "publish predicted objects and the ego's state, as Autoware's planners take them; needs autoware_perception_msgs",
    )
    results: str = parameter(
        "", "folder for drives.json and junit.xml, written anew after each drive; empty: none"
    )
    drive: ClosedLoopConfig = field(default_factory=ClosedLoopConfig)
