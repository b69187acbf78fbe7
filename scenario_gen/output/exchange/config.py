# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of exports."""

from dataclasses import dataclass

from scenario_gen.base.parameters import parameter, Parameters


@dataclass(frozen=True)
class ExportConfig(Parameters):
    """Parameters of `scenario-gen export`."""

    ego: str = parameter("", "id of the vehicle that becomes the ego, for sets without an ego")
    map: str = parameter(
        "",
        "OpenSCENARIO: the map of the scenarios (.xodr, .osm), which becomes their road",
    )
    projection: str = parameter(
        "mgrs",
        "Autoware, and OpenSCENARIO with a Lanelet2 map: frame of a map in latitude and "
        "longitude: its MGRS square, UTM, or metres about its centre",
        choices=("mgrs", "utm", "local"),
    )
    projection_origin: str = parameter(
        "", "latitude, longitude of the origin of projection utm or local"
    )
    run_out: float = parameter(
        50.0,
        "length by which lanes are extended straight beyond the road, so that a planner sees road "
        "ahead",
        unit="m",
        low=0.0,
        high=1000.0,
    )
    step: float = parameter(
        0.1,
        "CommonRoad and ScenarioNet: time step for scenarios with uneven time steps",
        unit="s",
        low=0.01,
        high=1.0,
    )
    goal_length: float = parameter(
        6.0, "length of the ego's goal region", unit="m", low=0.5, high=50.0
    )
    goal_width: float = parameter(
        3.5, "width of the ego's goal region", unit="m", low=0.5, high=20.0
    )
    goal_late: float = parameter(
        2.0,
        "latest time at which the ego may reach its goal, in durations of its track",
        low=1.0,
        high=10.0,
    )
    late: str = parameter(
        "refused",
        "CommonRoad: scenarios in which a vehicle arrives late: refused, or written with its "
        "arrival as initial time step, which CommonRoad's software reads but its schema forbids",
        choices=("refused", "written"),
    )
    following: str = parameter(
        "position",
        "OpenSCENARIO's followingMode: the simulator sets positions on the trajectory, or "
        "controllers follow it",
        choices=("position", "follow"),
    )
