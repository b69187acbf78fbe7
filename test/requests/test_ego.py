# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The ego slot: one vehicle is left out, and its own motion, certified together with the others, is the witness."""

import numpy as np
import pytest
from support.given import answer
from support.small_scenarios import moving

from msg_conventions.scenarios import encode_scenario
from scenario_gen.types import join_ego, Vehicle, with_witness
from scenario_gen.types.request import Request


@pytest.mark.parametrize("ego", ["1", "2"])
def test_of_two_vehicles_one_is_left(chain, plain, ego):
    made = answer(chain, Request(ego=ego), count=5).generated
    index = int(ego) - 1
    for one, all_of_it in zip(made.scenarios, plain.generated.scenarios, strict=True):
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


def test_parted_and_together_again():
    """Of vehicles that come and go: whoever is alone at the end leaves the others' clock shorter, and it is whole again."""
    rows = [[10.0 * n, 0.0, 0.0, 1.0, 0.0, 0.0] for n in range(3)]
    present = [[0, 30], [5, 49], [2, 40]]
    whole = moving(rows, vehicles=list(map(Vehicle, "abc")), count=50, present=present)
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
