# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A car that turns right beside a bicycle keeps its distance to the side on a map without cycle lanes."""

from dataclasses import replace

import numpy as np
import pytest
from support.map_builders import write
from support.motions import encounter_of
from support.textbook_motions import driven, line, ramps

from scenario_gen import generate
from scenario_gen.method.fitting import fit_template, LostEncounterError
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.sampling.plan import Plan
from scenario_gen.method.sampling.stage import checker_of
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import Limits
from scenario_gen.numerics import unit_left
from scenario_gen.roads import build_road
from scenario_gen.situation import abreast_in_lane, clean_tracks, path_offsets
from scenario_gen.types import Cause, Encounter, Request, Vehicle


def right_hook(gap: float = 2.55) -> Encounter:
    """A car stops for a bicycle on its right [m, between centres], and turns right behind it."""
    count = 150
    car, speed = driven(
        line((-38.0, -1.75), (-4.0, -1.75), (-4.0, -40.0)),
        ramps(count, (0.0, 9.0), (5.0, 0.0), (7.5, 0.0), (10.0, 5.0), (15.0, 6.0)),
        0.0,
        0.0,
    )
    bicycle, own = driven(
        line((-38.0, -1.75 - gap), (60.0, -1.75 - gap)), np.full(count, 5.0), 0.0, 4.0
    )
    vehicles = (Vehicle("a", 4.6, 1.85), Vehicle("b", 1.8, 0.6, type="bicycle"))
    poses = np.stack([car, bicycle])
    return encounter_of(poses[..., :2], poses[..., 2], np.stack([speed, own]), vehicles)


def side_distance(encounter: Encounter) -> float:
    """Return how far [m] the centres are apart to the side."""
    offsets = path_offsets(*clean_tracks(encounter))
    return float(np.nanmedian(np.abs(offsets[np.abs(offsets) < 4.0])))


def test_car_beside_bicycle_keeps_distance(tmp_path) -> None:
    encounter = right_hook()
    (abreast,) = abreast_in_lane(clean_tracks(encounter))
    assert abreast.offset == pytest.approx(-2.55, abs=0.1)
    assert abreast.clearance == pytest.approx(1.32, abs=0.1)
    road = str(write(tmp_path, ".xodr"))
    result = generate(encounter, road, count=2, seed=1)
    assert not [loss for loss in result.fit.losses if loss.kind != "arm"]
    for scenario in result:
        made = replace(
            result.encounter,
            **{
                name: getattr(scenario, name)
                for name in ("time", "present", *encounter.array_names)
            },
        )
        assert side_distance(made) == pytest.approx(2.55, abs=0.3)


def test_scenarios_losing_side_distance_are_refused(tmp_path) -> None:
    encounter = right_hook()
    result = generate(encounter, "four_way", count=2, seed=1)
    assert not [loss for loss in result.fit.losses if loss.kind != "arm"]
    plan = Plan.of(result, SamplingConfig(), Limits(), Request())
    check = checker_of(plan, SamplingConfig(), Limits(), Request()).check
    scenario = result[0]
    assert check([scenario])[0].valid
    left = unit_left(scenario.heading[1])
    for shift in (0.6, -0.6):
        position = scenario.position.copy()
        position[1] += shift * left
        causes = [
            each.cause for each in check([replace(scenario, position=position)])[0].violations
        ]
        assert Cause.SIDE_CLEARANCE in causes


def test_narrow_lane_for_distance_is_refused(tmp_path) -> None:
    encounter = right_hook(2.95)
    car, bicycle = encounter.vehicles
    encounter = replace(encounter, vehicles=(replace(car, width=2.5), bicycle))
    road = build_road(str(write(tmp_path, ".xodr")), encounter)
    with pytest.raises(LostEncounterError, match=r"drives 1.4 m beside vehicle a in the record"):
        fit_template(encounter, segment(encounter), road)
