# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Recorded encounters through the whole chain: valid sets, limits kept, the clock kept, waits kept, without changepoints too."""

from dataclasses import replace

import numpy as np
import pytest
from support.lengths import LOGS, VEHICLES

from scenario_gen.logs import read_log
from scenario_gen.method.fitting import fit_template
from scenario_gen.method.routing import plan_routes
from scenario_gen.method.sampling import draw_scenarios, Plan, SamplingConfig
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import Checker
from scenario_gen.roads import build_road
from scenario_gen.situation import (
    find_conflicts,
    find_waits,
    Situation,
    STANDSTILL_SPEED_MPS,
    WAIT_SPEED_MPS,
)


@pytest.mark.parametrize("path", [one for one in LOGS if VEHICLES[one.values[0]] == 2])
@pytest.mark.parametrize("ablation", [False, True])
def test_recorded_encounter(path, ablation):
    encounter = read_log(path).encounters[0]
    segmentation = segment(encounter)
    if ablation:
        labels, changes = np.zeros_like(segmentation.labels), np.zeros(0, dtype=np.int64)
        segmentation = replace(
            segmentation, labels=labels, changepoints=changes, descriptions=("",)
        )
    waits = () if ablation else find_waits(encounter)
    road = build_road("corridor", encounter)
    fit = fit_template(encounter, segmentation, road)
    routes = plan_routes(road, fit)
    conflicts = find_conflicts(encounter)
    checker, config = (
        Checker(road, fit.requested, conflicts, waits),
        SamplingConfig(drivers=0.0),
    )
    plan = Plan(Situation.of(encounter), segmentation, road, routes, fit.requested, waits)
    found = draw_scenarios(plan, checker.check, config, count=30, seed=2)
    assert len(found.scenarios) == 30
    assert found.acceptance > 0.6
    assert found.candidates == 30 + found.refused.total()
    for s in found.scenarios:
        assert s.acceleration.max() <= 5.0 + 1e-6  # the checker's limit
        assert s.acceleration.min() >= -9.0 - 1e-6
        assert (
            abs(s.time[-1] / encounter.duration - 1.0)
            <= (1.0 + config.max_stretch) * 1.1 - 1.0 + 1e-9
        )
        for wait in waits:
            inside = (encounter.time >= wait.start) & (encounter.time <= wait.end)
            stood = (
                encounter.speed[wait.vehicle, inside] <= STANDSTILL_SPEED_MPS
            ).sum() * encounter.dt
            assert (s.speed[wait.vehicle] == 0.0).sum() * 0.1 > 0.7 * stood
            assert (s.speed[wait.vehicle] < WAIT_SPEED_MPS).sum() * 0.1 > 0.7 * (
                wait.end - wait.start
            )
