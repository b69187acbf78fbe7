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

"""The lanes of a bag's road: the true ones of a built-in road, drawn again, which must be the same grid; else derived ones."""

from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np

from scenario_gen import exact
from scenario_gen.errors import InputError, RefusedError
from scenario_gen.exchange.derived_lanes import derived_lanes
from scenario_gen.exchange.junction_lanes import Crossing, crossing_lanes
from scenario_gen.exchange.lanes import LaneMap
from scenario_gen.recordings.provenance import read_parameters
from scenario_gen.roads import RoadConfig
from scenario_gen.roads.build import build_road
from scenario_gen.roads.builtin import BUILT_IN
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import Scenario

_AXIS = 1e-6  # of a unit vector: arms of built-in roads lie along the axes
_ARM_NAMES = {(1, 0): "east", (-1, 0): "west", (0, 1): "north", (0, -1): "south"}


def lane_map_of(
    road: Road | None,
    name: str,
    tracks: Encounter | None,
    values: Mapping[str, str],
    scenarios: Sequence[Scenario],
    run_out: float,
) -> LaneMap:
    """Return the lanes of a road.

    Args:
        road: as the bag has it; None if it has none.
        name: of the road; "" where the bag does not say.
        tracks: the template, to which a built-in road was sized.
        values: the request's parameters, `road.…` among them; where one is missing all have their defaults.
        scenarios: all of the case, for lanes that are derived.
        run_out: metres by which lanes are continued straight on.
    """
    config = RoadConfig()
    with suppress(InputError):  # a bag of others says nothing of our parameters
        config = read_parameters(config, values, "road.", "export")
    if road is not None and not config.paper:
        for candidate in (name,) if name in BUILT_IN else () if name else BUILT_IN:
            found = true_lanes(road, candidate, tracks, config, run_out)
            if found is not None:
                return found
    return derived_lanes(scenarios, road, config.lane_width, run_out)


def true_lanes(road: Road, name: str, tracks: Encounter | None, config: RoadConfig, run_out: float) -> LaneMap | None:
    """Return the lanes of the built-in road `name`; None if that, drawn again, is not this grid or has no known lanes."""
    try:
        drawn = build_road(name, tracks, config)
    except (InputError, RefusedError):
        return None
    if not np.array_equal(drawn.drivable, road.drivable) or not np.array_equal(drawn.origin, road.origin):
        return None
    made = _crossing(drawn, config, run_out)
    return None if made is None else crossing_lanes(name, *made)


def _crossing(road: Road, config: RoadConfig, run_out: float) -> tuple[Crossing, np.ndarray] | None:
    """Return the sizes of a built-in road and its centre (2,) [m], by its entries and exits; None if its arms are no cross."""
    arms: dict[str, list[np.ndarray]] = {}
    for poses, inward in ((road.entries, -1.0), (road.exits, 1.0)):
        for x, y, yaw in poses:
            out = inward * np.array([exact.cos(yaw), exact.sin(yaw)])
            axis = np.rint(out)
            if np.abs(out - axis).max() > _AXIS:
                return None
            arms.setdefault(_ARM_NAMES[int(axis[0]), int(axis[1])], []).append(np.array([x, y]))
    if not {"west", "east"} <= set(arms):
        return None
    ends = {name: np.mean(points, axis=0) for name, points in arms.items()}  # the middle of each arm's end
    lanes = len(arms["west"]) // 2
    centre = np.array([(ends["west"][0] + ends["east"][0]) / 2.0, ends["west"][1]])
    if any(len(points) != 2 * lanes for points in arms.values()):
        return None
    outward = {"west": np.pi, "east": 0.0, "south": -np.pi / 2.0, "north": np.pi / 2.0}
    reach = {name: float(np.abs(ends[name] - centre).max()) for name in arms}
    sizes = {name: (outward[name], reach[name]) for name in outward if name in arms}
    return Crossing(sizes, lanes, config.lane_width, config.corner_radius, config.traffic_side, run_out, road.resolution), centre
