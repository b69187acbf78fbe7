# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The independent re-check of the benchmark sees what it must: as brute force does, and on scenarios that are spoilt."""

from dataclasses import replace

import numpy as np
from support.lengths import LONG
from support.motions import encounter_of, FREE, open_road, road_of, scenario_of, straight, wander
from support.oracle import off_road, overlapping
from test_validity_presence import random_case

from benchmarks._recheck import Account, Recheck
from scenario_gen.types import ALWAYS, Vehicle
from scenario_gen.types.scenario import BoundaryStates

TIME = np.arange(101) * 0.1


def crossing(delay=3.0):
    """Two cars that cross: the one from the west first, the other `delay` seconds later."""
    return scenario_of(
        (
            straight(-50.0, 0.0, 0.0, 10.0, TIME),
            straight(0.0, -50.0 - 10.0 * delay, np.pi / 2, 10.0, TIME),
        ),
        TIME,
    )


def recheck_of(scenario, road=None, changepoints=True):
    arrays = (scenario.position, scenario.heading, scenario.speed, scenario.vehicles)
    encounter = encounter_of(*arrays, present=scenario.present)
    ends = (
        np.column_stack([scenario.position[:, k], scenario.heading[:, k], scenario.speed[:, k]])
        for k in (0, -1)
    )
    return Recheck(encounter, road or open_road(), BoundaryStates(*ends), changepoints)


def found(recheck, *scenarios):
    account = Account()
    recheck.check(scenarios, account)
    return account


def test_a_sound_scenario_is_sound():
    scenario = crossing()
    account = found(recheck_of(scenario), scenario, scenario)
    assert account.found == {}
    assert (account.scenarios, account.vehicles, account.orders) == (2, 4, 2)


def test_overlaps_agree_with_brute_force():
    """Overlap and off-road at 1 ms; grazing by less than a micrometre aside."""
    rng = np.random.default_rng(3)
    drivable = np.ones((300, 300), dtype=bool)
    drivable[rng.integers(0, 300, 40), rng.integers(0, 300, 40)] = False
    road, time, agreed = road_of(drivable, 0.25, (-37.5, -37.5)), np.arange(31) * 0.1, 0
    for _ in range(12):
        scenario = scenario_of(
            [wander(rng, time, 15.0) for _ in range(2)],
            time,
            (Vehicle("a", 4.0, 1.8), Vehicle("b", 4.0, 1.8)),
        )
        meet, off = len(overlapping(scenario, FREE, 1e-3)), len(off_road(scenario, road, 1e-3))
        account = found(recheck_of(scenario, road), scenario)
        assert (account.found["overlap"], account.found["off_road"]) == (meet, off)
        agreed += meet + off
    assert agreed > 5, "some of them do collide or leave the road"


def test_presence_agrees_with_brute_force():
    met, seeds = 0, range(500) if LONG else (2, 3, 6, 8)  # of these four the margin decides three
    for seed in seeds:
        scenario, limits = random_case(seed)
        recheck = recheck_of(replace(scenario, present=ALWAYS))
        recheck.limits = replace(FREE, presence_margin=limits.presence_margin)
        expected = len(overlapping(scenario, limits, 0.02))
        assert found(recheck, scenario).found["overlap"] == expected, seed
        met += expected > 0
    assert 0.25 * len(seeds) <= met <= 0.9 * len(seeds)
