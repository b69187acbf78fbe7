# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of nodes that are also arguments of launch files.

`ros2 launch` imports this module in a Python without numba.
"""

from dataclasses import dataclass, field
import re

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.closed_loop.config import ClosedLoopConfig

ROAD_NAMES = (
    "straight",
    "curve",
    "t_intersection",
    "four_way",
    "merge",
    "roundabout",
    "corridor",
)


@dataclass(frozen=True)
class LogPlayerParameters(Parameters):
    """The log player's parameters, without `log.…`."""

    log_path: str = parameter("", "log to read: a file, a bag or a folder of files")
    encounter: int = parameter(0, "which encounter of the log, from 0", low=0)
    stream: bool = parameter(
        False,
        "publish fixes and speeds of each vehicle with /clock instead of tracks",
    )
    rate: float = parameter(
        1.0, "speed of the stream, as a multiple of the recorded one", low=0.01, high=1000.0
    )
    wait_matching_subscriptions: int = parameter(
        0, "subscribers that each stream must have before it begins", low=0
    )


@dataclass(frozen=True)
class RoadServerParameters(Parameters):
    """The road server's parameters, without `road.…`."""

    road_name: str = parameter(
        "t_intersection",
        f"{', '.join(ROAD_NAMES)}, a map_server YAML file, or a vector map (.osm, .xodr, .xml)",
    )
    wait_for_tracks: bool = parameter(False, "publish no road before tracks arrive")
    shorten: bool = parameter(True, "request a part of a recording that does not fit as a whole")


@dataclass(frozen=True)
class SamplerParameters(Parameters):
    """The sampler's parameters, without those of a request and of the stages."""

    count: int = parameter(50, "scenarios to generate", low=1, high=100_000)
    seed: int = parameter(
        0, "seed of the scenarios, and of the planner where states are requested", low=0
    )
    generate_on_input: bool = parameter(
        True, "generate whenever the inputs are complete or change; false: on ~/generate only"
    )
    patience: float = parameter(
        60.0,
        "time without acknowledgement after which a subscriber of scenarios is no longer waited "
        "for; 0: wait for ever",
        unit="s",
        low=0.0,
    )
    pair_map: bool = parameter(
        True,
        "use only a map with the recording's stamp; false: the newest map of any map server",
        fixed=True,
    )


@dataclass(frozen=True)
class RecorderParameters(Parameters):
    """The recorder's parameters."""

    bag: str = parameter(
        "", "folder of the bag; empty: wait for ~/start, and name the bag by the time", fixed=True
    )
    topics: str = parameter(
        "",
        "regular expression of the full names of the topics; empty: those in the node's "
        "namespace, /clock and /tf",
        fixed=True,
    )
    compress: bool = parameter(True, "compress chunks with zstd")
    split_bytes: int = parameter(
        0, "size of the messages after which a new file begins; 0: never", unit="B", low=0
    )
    split_seconds: float = parameter(
        0.0, "time after which a new file begins; 0: never", unit="s", low=0.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            re.compile(self.topics)
        except re.error as error:
            raise InputError(f"parameter topics is no regular expression: {error}") from None
        if re.search(r"\([^()]*[*+}][^()]*\)[*+{]", self.topics):
            raise InputError(
                "parameter topics repeats a repetition, as in (a+)+: matching may take hours; "
                "write it with one repetition"
            )


@dataclass(frozen=True)
class TrafficParameters(Parameters):
    """The parameters of traffic; those of a drive are `drive.step`, `drive.policy`, …."""

    bag: str = parameter(
        "",
        "bag with scenarios; empty: they arrive live on `scenarios`, `scenarios/info` and `map`",
        fixed=True,
    )
    ego: str = parameter(
        "",
        "id of the vehicle that the ego replaces; empty: the scenario's ego slot, or its first "
        "vehicle",
    )
    request: str = parameter(
        "",
        "request whose live scenarios are driven; empty: all that are sent after the start",
        fixed=True,
    )
    index: int = parameter(0, "index of the first scenario in the bag, from 0", low=0, fixed=True)
    rate: float = parameter(
        1.0, "speed as a multiple of real time", low=0.01, high=1000.0, fixed=True
    )
    lock_step: bool = parameter(
        False, "step with each call of ~/step instead of a clock", fixed=True
    )
    wait_for_ego: bool = parameter(
        True, "begin a drive with the ego's first command; false: the ego brakes until one arrives"
    )
    silence: float = parameter(
        0.5, "age after which a command is ignored, and the ego brakes", unit="s", low=0.01
    )
    patience: float = parameter(
        5.0, "longest wait for a command in lock-step, in real time", unit="s", low=0.01
    )
    follow_on: bool = parameter(True, "continue with the next scenario; false: wait for ~/next")
    autoware: bool = parameter(
        False,
        "publish predicted objects and the ego's state for Autoware's planners; needs "
        "autoware_perception_msgs",
        fixed=True,
    )
    results: str = parameter(
        "",
        "folder for drives.json and junit.xml, replaced after each drive; empty: none",
        fixed=True,
    )
    drive: ClosedLoopConfig = field(default_factory=ClosedLoopConfig)
