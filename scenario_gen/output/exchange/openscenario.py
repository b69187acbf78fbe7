# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenSCENARIO XML 1.2: one file per scenario, next to the OpenDRIVE file of its road.

Every vehicle follows a timed polyline. Its reference point is the centre of its rear axle on the
ground, x ahead, as the standard defines it; its bounding box gives the footprint. Trajectories use
absolute time from the start of the simulation. Their start condition (simulation time at least 0)
has no edge: a rising edge would wait for a change that never happens, or happens a step late. A
vehicle that arrives late is added to the simulation at that time, and one that leaves is deleted.
The ego, if any, has an initial pose and speed and a routing action to its goal; the controller
under test drives it. Each light whose states are known has a controller with its phases; its
signals are those of the OpenDRIVE file that is written beside it.
"""

from typing import Any

from scenario_gen.output.exchange.cases import Case, Exported, scenario_source
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lights import light_of, phases_within
from scenario_gen.output.exchange.opendrive import signal_ids
from scenario_gen.output.exchange.xml import date_of, rendered
from scenario_gen.types import (
    height,
    OBSTACLE_HEIGHT_M,
    rear_axle,
    Scenario,
    shifted,
    token,
    WHEELBASE_SHARE,
)


def write_openscenario(
    case: Case, exported: Exported, road_file: str, export: ExportConfig = ExportConfig()
) -> bytes:
    """Return a scenario as the bytes of an OpenSCENARIO file; `road_file` is its OpenDRIVE file.

    Raises:
        RefusedError: the ego arrives late.
    """
    exported.refuse_late_ego()
    others = exported.others
    return rendered(
        "openscenario.xml.j2",
        date=date_of(case.start_ns),
        road_name=case.road_name,
        source=scenario_source(case, exported),
        road_file=road_file,
        lights=[] if export.map else _lights(case, exported),
        others=[_drive(others, n) for n in range(len(others.vehicles))],
        ego=None if exported.ego is None else _drive(exported.ego, 0),
        obstacles=case.lane_map.network.obstacles,
        duration=exported.duration,
        following=export.following,
        height=height,
        obstacle_height=OBSTACLE_HEIGHT_M,
        rear_axle=rear_axle,
        wheelbase_share=WHEELBASE_SHARE,
    )


def _lights(case: Case, exported: Exported) -> list[dict[str, Any]]:
    """Return id, signals and phases of each light whose states are known."""
    network = case.lane_map.network
    lights = []
    for n, rule in enumerate(network.rules):
        light = light_of(rule, network, exported.others.facts.lights)
        if light is not None:
            phases = phases_within(light.schedule, exported.duration)
            signals = signal_ids(case.lane_map, n)
            lights.append({"id": light.id, "signals": signals, "phases": phases})
    return lights


def _drive(scenario: Scenario, n: int) -> dict[str, Any]:
    """Return times [s], poses of the reference point [m, m, rad] and speeds [m/s] of a vehicle.

    Poses have no z: players find it.
    """
    vehicle = scenario.vehicles[n]
    first, last = scenario.present[n].tolist()
    poses = []
    for k in range(first, last + 1):
        yaw = scenario.heading[n, k]
        axle = shifted(scenario.position[n, k], yaw, -rear_axle(vehicle))
        poses.append((*axle.tolist(), float(yaw)))
    return {
        "name": f"vehicle_{token(vehicle.id)}",
        "vehicle": vehicle,
        "times": scenario.time[first : last + 1].tolist(),
        "poses": poses,
        "speeds": scenario.speed[n, first : last + 1].tolist(),
        "is_late": first > 0,
        "is_early": last < len(scenario.time) - 1,
    }
