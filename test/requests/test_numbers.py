# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""As many vehicles as there are, and what is said when not all scenarios can be had."""

from dataclasses import replace

import numpy as np
import pytest
from support.given import answer, Given
from support.lengths import LONG

from scenario_gen.logs import bundled, read_log
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.sampling.sampler import LEVEL_CANDIDATES
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import Limits
from scenario_gen.roads import build_road
from scenario_gen.types import Encounter, NoteKind, Vehicle
from scenario_gen.types.request import Request
from scenario_gen.types.scenario import Cause


def platoons(count):
    """Half of `count` vehicles drive east in a queue that slows down and speeds up again, the others come towards them."""
    time = np.arange(161) * 0.1
    speed = 8.0 + 2.5 * np.cos(0.4 * time)
    way = np.concatenate([[0.0], np.cumsum(0.05 * (speed[1:] + speed[:-1]))])
    position, heading = [], []
    for k in range(count):
        row, east = k // 2, k % 2 == 0
        x = way - 16.0 * row if east else 130.0 - way + 16.0 * row
        position.append(np.column_stack([x, np.full(time.size, -1.75 if east else 1.75)]))
        heading.append(np.full(time.size, 0.0 if east else np.pi))
    vehicles = tuple(Vehicle(f"car_{k}", 4.5 + 0.1 * k, 1.8) for k in range(count))
    return Encounter.sampled(
        vehicles,
        0.1,
        np.array(position),
        np.array(heading),
        np.tile(speed, (count, 1)),
        "platoons",
    )


@pytest.mark.parametrize("count", range(2, 9) if LONG else (6,))
def test_two_to_eight_vehicles(count):
    encounter = platoons(count)
    chain = Given(encounter, segment(encounter, seed=1), build_road("corridor", encounter), 1)
    outcome = answer(chain, Request(), count=5)
    assert len(outcome.generated.scenarios) == 5
    assert {len(s.vehicles) for s in outcome.generated.scenarios} == {count}
    left = answer(chain, Request(ego=f"car_{count - 1}"), count=2).generated
    assert {len(s.vehicles) for s in left.scenarios} == {count - 1}


@pytest.fixture(scope="module")
def tight():
    """A wait and a turn on a T-intersection, checked without any tolerance for accelerations."""
    encounter = read_log(bundled("a")).encounters[0]
    config = SamplingConfig(
        drivers=0.0,
        lateral_sigma=0.3,
        observation_sigma=0.3,
        longitudinal_sigma=0.5,
        time_sigma=2.0,
        bend_acceleration=2.0,
    )
    limits = Limits(acceleration_tolerance=0.0)
    return Given(
        encounter,
        segment(encounter),
        build_road("t_intersection", encounter),
        0,
        sampling=config,
        limits=limits,
    )


def test_variance_adapts_where_validity_is_hard(tight):
    """Few candidates at full variance keep to the limit; with smaller deviations the set is had, and it is said."""
    made = answer(tight, Request(), count=30).generated
    assert len(made.scenarios) == 30
    assert NoteKind.LESS_VARIATION in {note.kind for note in made.adaptations}
    assert max(s.index for s in made.scenarios) >= LEVEL_CANDIDATES, (
        "candidates of another level are among them"
    )
    assert made.candidates == len(made.scenarios) + made.refused.total()


def test_a_short_set_says_how_many_and_why(tight):
    made = answer(
        replace(tight, sampling=replace(tight.sampling, attempts=3)), Request(), count=80
    ).generated
    assert 0 < len(made.scenarios) < made.requested == 80
    assert made.candidates == 240 == len(made.scenarios) + made.refused.total()
    assert set(made.refused) == {Cause.LONGITUDINAL_ACCELERATION}
    limits = replace(tight.limits, slip=0.0, slip_share=0.0)
    impossible = answer(replace(tight, limits=limits), Request(), count=10).generated
    assert impossible.scenarios == ()
    assert impossible.refused.total() == impossible.candidates == 200
    assert NoteKind.FEW_VALID in {note.kind for note in impossible.adaptations}
