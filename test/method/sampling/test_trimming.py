# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What scenarios leave out before the first conflict and after the last one."""

from dataclasses import replace
import math

import numpy as np
import pytest
from support.textbook_motions import labelled

from scenario_gen import generate, PipelineConfig
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.sampling.trimming import AFTER_CONFLICT_S, Trimming, trimming_of
from scenario_gen.numerics.rounding import ROUNDING_S
from scenario_gen.situation import conflict_of, find_conflicts, Situation
from scenario_gen.types import Request

FREE = np.zeros(2, dtype=np.bool_)


@pytest.fixture(scope="module")
def encounter():
    return labelled("crossing, rolls", 3).encounter


def drawn(encounter, leave_out, request=Request(), count=30):
    sampling = SamplingConfig(leave_out=leave_out, pace_sigma=0.05, arrival_sigma=1.0)
    config = PipelineConfig(sampling=sampling)
    return generate(encounter, "corridor", config, count=count, seed=2, request=request)


def before_and_after(scenarios):
    """Seconds before the first entry of the conflict, and after the second one's (S, 2)."""
    found = [conflict_of(scenario, 0, 1) for scenario in scenarios]
    return np.array(
        [
            [own.entry_first, one.time[-1] - own.entry_second]
            for own, one in zip(found, scenarios, strict=True)
        ]
    )


def test_trimmed_scenarios_are_nearer(encounter):
    whole, cut = (before_and_after(drawn(encounter, share)) for share in (0.0, 0.8))
    assert (cut.mean(axis=0) < 0.85 * whole.mean(axis=0)).all()
    assert (cut.std(axis=0) > whole.std(axis=0)).all()
    assert (cut > 0.0).all()


def test_ego_states_prevent_trimming(encounter):
    request = Request(ego=encounter.vehicles[0].id)
    whole, cut = (drawn(encounter, share, request, 8) for share in (0.0, 0.8))
    assert all(
        one.position.tobytes() == other.position.tobytes()
        for one, other in zip(whole, cut, strict=True)
    )


def test_conflict_and_a_second_stay(encounter):
    (conflict,) = find_conflicts(encounter)
    window = trimming_of(Situation.of(encounter), 0.5, FREE)
    assert window.core[0] == pytest.approx(min(conflict.entry_first, conflict.entry_second))
    last = max(conflict.entry_second, conflict.exit_first)
    assert window.core[1] >= last + AFTER_CONFLICT_S - ROUNDING_S
    assert trimming_of(Situation.of(encounter), 0.0, FREE) is None
    assert trimming_of(Situation.of(encounter), 0.5, ~FREE) is None
    position = encounter.position.copy()
    position[0] += 1000.0
    assert trimming_of(Situation.of(replace(encounter, position=position)), 0.5, FREE) is None


def test_trimming_is_bounded_by_room():
    window = Trimming(np.array([4.0, 8.0]), np.array([0.5, 1.0]))
    kept, span = np.array([[4.0, 8.0], [1.0, 9.0]]), np.array([[0.0, 10.0], [2.0, 8.0]])
    np.testing.assert_allclose(
        window.apply(np.full((2, 2), 9.0), kept, span), [[2.0, 8.0], [2.0, 8.0]]
    )
    np.testing.assert_allclose(window.apply(np.full((2, 2), -9.0), kept, span), span, atol=1e-9)


@pytest.mark.parametrize(("kind", "seed"), [("crossing, stops", 3), ("crossing, rolls", 2)])
@pytest.mark.parametrize("drivers", [0.5, 1.0])
def test_last_sample_keeps_the_conflict(kind, seed, drivers):
    """The record ends as the second one enters, and the drive without deviations ends before."""
    whole = labelled(kind, seed).encounter
    last = math.ceil(conflict_of(whole, 0, 1).entry_second / whole.dt) + 1
    cut = whole.between(0, last - 1)
    made = generate(
        cut, "corridor", PipelineConfig(sampling=SamplingConfig(drivers=drivers)), count=10, seed=1
    )
    assert len(made) == 10 and all(conflict_of(scenario, 0, 1) is not None for scenario in made)
    assert not made.lost_reactions and made.generated.reactions
