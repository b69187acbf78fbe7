# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The lanes of a bag's road: the true ones of a built-in road, drawn again, which must be the same grid; else derived ones."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.provenance import read_parameters
from scenario_gen.output.exchange.derived_lanes import derived_lanes, with_all_vehicles, with_network
from scenario_gen.output.exchange.drawn_lanes import drawn_lanes
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.roads import bent_axis, build_road, BUILT_IN, RoadConfig
from scenario_gen.template import clean_tracks
from scenario_gen.types import Encounter, Road, Scenario


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
        scenarios: all of the case, which lanes that are derived, and ways through a junction, hold.
        run_out: metres by which lanes are continued straight on.
    """
    config = RoadConfig()
    with suppress(InputError):  # a bag of others says nothing of our parameters
        config = read_parameters(config, values, "road.", "export")
    if road is not None and not config.paper:
        for candidate in (name,) if name in BUILT_IN else () if name else BUILT_IN:
            lanes = true_lanes(road, candidate, tracks, config, scenarios, run_out)
            if lanes is not None:
                return lanes
    result = derived_lanes(scenarios, road, config.lane_width, run_out)
    if road is None or road.lanes is None:
        return result
    return with_network(result, road.lanes, scenarios, road, config.lane_width)


def true_lanes(
    road: Road, name: str, tracks: Encounter | None, config: RoadConfig, scenarios: Sequence[Scenario], run_out: float
) -> LaneMap | None:
    """Return the lanes of the built-in road `name`; None if that, drawn again, is not this grid or has no lanes in arms."""
    try:
        drawn = build_road(name, tracks, config)
    except (InputError, RefusedError):
        return None
    if not np.array_equal(drawn.drivable, road.drivable) or not np.array_equal(drawn.origin, road.origin):
        return None
    axis = None if tracks is None else bent_axis(name, clean_tracks(tracks), config)
    result = drawn_lanes(drawn, axis, config.traffic_side, scenarios, run_out)
    if result is None:
        return None
    return with_all_vehicles(replace(result, origin=f"the true lanes of {name}"), scenarios, road, config.lane_width)
