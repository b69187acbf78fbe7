# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Copies and encounters of a set, and intervals that know of them."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks._driving_worlds import draw_scenario
from scenario_gen.closed_loop.origin import Origin, origins_of, Trial, units_of
from scenario_gen.closed_loop.trials import rates, run_trials, with_origins
from scenario_gen.method.evaluation import clustered_wilson, wilson


def moved(scenario, x, y, yaw):
    c, s = np.cos(yaw), np.sin(yaw)
    position = scenario.position @ np.array([[c, s], [-s, c]]) + np.array([x, y])
    return replace(scenario, position=position, heading=scenario.heading + yaw)


def test_copies_move_all_vehicles_alike():
    one, other = draw_scenario(1), draw_scenario(2)
    scenarios = [one, moved(one, 30.0, -4.0, 1.2), other, moved(one, 5.0, 0.0, 0.0), one]
    found = origins_of(
        [
            Trial(*each)
            for each in zip("abcde", scenarios, [0, 0, 0, 0, 1], [None] * 5, "xxxyx", strict=True)
        ]
    )
    assert [each.copy_of for each in found] == ["", "a", "", "", ""]
    assert len({each.digest for each in found}) == 5


@pytest.mark.parametrize(("shift_m", "original"), [(0.098, "a"), (0.102, "")])
def test_copies_are_within_ten_centimetres(shift_m, original):
    """Only the other vehicle is moved, straight ahead in the frame of the ego."""
    scenario = draw_scenario(1)
    position = scenario.position.copy()
    position[1] += shift_m * np.array(
        [np.cos(scenario.heading[0, 0]), np.sin(scenario.heading[0, 0])]
    )
    trials = [
        Trial(name, each, 0, None, "x")
        for name, each in (("a", scenario), ("b", replace(scenario, position=position)))
    ]
    assert origins_of(trials)[1].copy_of == original


def test_drives_count_by_encounter_copies_once():
    names = ["a", "b", "c"]
    unit, encounters = units_of(names, [Origin("x"), Origin("x", "", "a"), Origin("x")])
    assert unit[0] == unit[1] != unit[2] and encounters == 1
    unit, encounters = units_of(names, [Origin("x"), Origin("y"), Origin("x")])
    assert unit[0] == unit[2] != unit[1] and encounters == 2


def test_copies_have_interval_of_one_each():
    scenarios = [draw_scenario(seed, 2) for seed in range(6)]
    trials = [
        Trial(str(k), moved(s, 9.0 * (k // 6), 0.0, 0.3 * (k // 6)), 0, None, "x")
        for k, s in enumerate(scenarios * 2)
    ]
    outcomes = with_origins(
        run_trials(trials, "scenario_gen.closed_loop.planners:IdmFollower"), trials
    )
    assert sum(bool(one.origin.copy_of) for one in outcomes) == 6
    goals = rates(outcomes)["off_road"]
    assert (goals.count, goals.of) == (0, 12)
    assert goals.share.high == pytest.approx(wilson(0, 6, 0.95).high)


@pytest.mark.parametrize(
    ("rate", "alike", "encounters", "least"),
    [
        (0.1, 0.2, 20, 0.92),
        (0.2, 0.0, 12, 0.92),
        (0.02, 0.3, 40, 0.87),
    ],
)
def test_intervals_hold_rate_of_clustered_drives(rate, alike, encounters, least):
    """Rates of encounters are beta distributed around `rate`; plain intervals miss it far more often than 5 %."""
    rng = np.random.default_rng(3)
    unit = np.repeat(np.arange(encounters), 20)
    held, plain, runs = 0, 0, 250
    for _ in range(runs):
        spread = 1.0 / alike - 1.0 if alike else None
        own = (
            rng.beta(rate * spread, (1.0 - rate) * spread, encounters)
            if spread
            else np.full(encounters, rate)
        )
        hits = rng.random(len(unit)) < own[unit]
        found, other = clustered_wilson(hits, unit, 0.95), wilson(int(hits.sum()), len(hits), 0.95)
        held += found.low <= rate <= found.high
        plain += other.low <= rate <= other.high
    assert held >= least * runs
    assert plain <= 0.87 * runs if alike else plain >= 0.92 * runs
