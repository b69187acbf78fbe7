# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of exports."""

from dataclasses import dataclass

from scenario_gen.base.parameters import parameter, Parameters


@dataclass(frozen=True)
class ExportConfig(Parameters):
    """Parameters of `scenario-gen export`."""

    ego: str = parameter("", "id of a vehicle that becomes the ego: of a set without an ego slot")
    map: str = parameter(
        "",
        "OpenSCENARIO: the map that the scenarios were made on (.xodr, .osm); it is copied and named as their road",
    )
    projection: str = parameter(
        "mgrs",
        "Autoware, OpenSCENARIO with a Lanelet2 map: the frame in which others load a map in latitude and longitude: its MGRS "
        "square, UTM, or metres about its middle",
        choices=("mgrs", "utm", "local"),
    )
    projection_origin: str = parameter(
        "", "latitude, longitude that are 0, 0 of projection utm or local"
    )
    run_out: float = parameter(
        50.0,
        "how far lanes are continued straight on beyond the road, so that a planner sees road ahead",
        unit="m",
        low=0.0,
        high=1000.0,
    )
    step: float = parameter(
        0.1,
        "time step of a CommonRoad file whose scenario has uneven ones",
        unit="s",
        low=0.01,
        high=1.0,
    )
    goal_length: float = parameter(
        6.0, "length of an ego's goal region", unit="m", low=0.5, high=50.0
    )
    goal_width: float = parameter(
        3.5, "width of an ego's goal region", unit="m", low=0.5, high=20.0
    )
    goal_late: float = parameter(
        2.0,
        "until when an ego may reach its goal, in durations of its track; from the first step on it may",
        low=1.0,
        high=10.0,
    )
    late: str = parameter(
        "refused",
        "CommonRoad: a scenario in which a vehicle arrives late is refused, or written with the time step at which it arrives, "
        "which CommonRoad's software reads and its schema does not allow",
        choices=("refused", "written"),
    )
    following: str = parameter(
        "position",
        "OpenSCENARIO's followingMode: the simulator puts vehicles on the trajectory, or its controllers follow it",
        choices=("position", "follow"),
    )
