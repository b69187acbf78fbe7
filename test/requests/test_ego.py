# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The ego slot: one vehicle is left out, and its own motion, certified together with the others, is the witness."""

from dataclasses import replace

import numpy as np
import pytest
from support.given import answer, Given
from support.lengths import LONG

from msg_conventions.scenarios import encode_scenario
from scenario_gen.base.errors import RefusedError
from scenario_gen.logs import bundled, read_log
from scenario_gen.method.chain import Chain
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import Checker
from scenario_gen.roads import build_road
from scenario_gen.situation import find_conflicts, Situation
from scenario_gen.types import join_ego, Vehicle, with_witness
from scenario_gen.types.request import Request
from scenario_gen.types.scenario import BoundaryStates, Scenario


@pytest.mark.parametrize("ego", ["1", "2"])
def test_of_two_vehicles_one_is_left(chain, plain, ego):
    made = answer(chain, Request(ego=ego), count=5).generated
    index = int(ego) - 1
    whole = answer(chain, Request(), count=5).generated
    for one, all_of_it in zip(made.scenarios, whole.scenarios, strict=True):
        assert one.index == all_of_it.index, (
            "the model of all vehicles is drawn and checked, then parted"
        )
        assert encode_scenario(join_ego(one), 0) == encode_scenario(
            join_ego(with_witness(all_of_it, index)), 0
        )
    assert [v.id for s in made.scenarios for v in s.vehicles] == ["2" if ego == "1" else "1"] * 5
    asked = plain.fit.requested
    for s in made.scenarios:
        assert s.position[0, 0] == pytest.approx(asked.start[1 - index, :2], abs=1e-5)
        assert s.position[0, -1] == pytest.approx(asked.end[1 - index, :2], abs=1e-5)
    slot = made.ego
    assert slot.vehicle.id == ego
    assert np.array_equal([slot.start, slot.goal], [asked.start[index], asked.end[index]])
    for track in (s.reference_drive for s in made.scenarios):
        assert [v.id for v in track.vehicles] == [ego]
        for k, state in ((0, slot.start), (-1, slot.goal)):
            assert track.position[0, k] == pytest.approx(state[:2], abs=1e-5)
            assert np.cos(track.heading[0, k] - state[2]) == pytest.approx(1.0)
            assert track.speed[0, k] == pytest.approx(state[3], abs=1e-9)
    assert len({s.reference_drive.position.tobytes() for s in made.scenarios}) == 5, (
        "each has its own"
    )


def test_a_slot_that_cannot_be_driven_is_refused(chain):
    """What is asked of the ego must exist, too: there is no scenario without a witness."""
    request = Request(ego="1", goals="1: 16.0 8.07 3.14159 40.0")
    with pytest.raises(RefusedError):
        Chain(
            Situation.of(chain.encounter),
            chain.segmentation,
            chain.road,
            chain.config,
            request,
            2,
            chain.seed,
        ).run()


def test_parted_and_together_again():
    """Of vehicles that come and go: whoever is alone at the end leaves the others' clock shorter, and it is whole again."""
    time = np.arange(50) * 0.1
    position = np.stack([np.stack([10.0 * n + time, 0.0 * time], axis=1) for n in range(3)])
    rest = (np.zeros((3, 50)), np.ones((3, 50)), np.zeros((3, 50)))
    whole = Scenario(
        tuple(map(Vehicle, "abc")),
        time,
        position,
        *rest,
        present=np.array([[0, 30], [5, 49], [2, 40]]),
    )
    parted = with_witness(whole, 1)
    assert len(parted.time) == 41 and [v.id for v in parted.vehicles] == ["a", "c"]
    back = join_ego(parted)
    assert [v.id for v in back.vehicles] == ["a", "c", "b"]
    assert encode_scenario(join_ego(with_witness(back, 1)), 0) == encode_scenario(
        join_ego(with_witness(whole, 2)), 0
    )
    assert np.array_equal(back.time, whole.time) and np.array_equal(
        back.present[[0, 2, 1]], whole.present
    )
    assert np.array_equal(back.position[[0, 2, 1]], whole.position)


@pytest.mark.parametrize("ego", range(3) if LONG else [1])
def test_the_others_stay_valid_among_themselves(ego):
    encounter = read_log(bundled("ngsim_two_left_turns")).encounters[0]
    chain = Given(encounter, segment(encounter), build_road("t_intersection", encounter), 0)
    outcome = answer(chain, Request(ego=encounter.vehicles[ego].id), count=3)
    kept = [n for n in range(len(encounter.vehicles)) if n != ego]
    assert len(outcome.generated.scenarios) == 3
    conflicts = find_conflicts(encounter.select(kept))
    kept_waits = Situation.of(chain.encounter).waits_to_keep(chain.segmentation)
    waits = [
        replace(wait, vehicle=kept.index(wait.vehicle))
        for wait in kept_waits
        if wait.vehicle != ego
    ]
    asked = BoundaryStates(outcome.fit.requested.start[kept], outcome.fit.requested.end[kept])
    checker = Checker(chain.road, asked, conflicts, waits)
    assert all(verdict.valid for verdict in checker.check(outcome.generated.scenarios))
    everybody = Checker.of_template(
        Situation.of(encounter), chain.road, outcome.fit.requested, kept_waits
    )
    place = np.argsort([*kept, ego]).tolist()
    for scenario in map(join_ego, outcome.generated.scenarios):
        arrays = {
            name: getattr(scenario, name)[place]
            for name in ("position", "heading", "speed", "acceleration", "present")
        }
        whole = replace(scenario, vehicles=tuple(scenario.vehicles[k] for k in place), **arrays)
        (verdict,) = everybody.check([whole])
        lost = [
            tuple(encounter.vehicles[n].id for n in violation.vehicles)
            for violation in verdict.violations
        ]
        assert set(lost) <= set(scenario.facts.lost_reactions), (
            "the witness is certified together with the others"
        )
