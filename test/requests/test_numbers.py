# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""As many vehicles as there are, and what is said when not all scenarios can be had."""

from dataclasses import replace

import pytest
from support.given import answer, Given

from scenario_gen.logs import bundled, read_log
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.sampling.sampler import LEVEL_CANDIDATES
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import Limits
from scenario_gen.roads import build_road
from scenario_gen.types import NoteKind
from scenario_gen.types.request import Request
from scenario_gen.types.scenario import Cause


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


def test_short_set_says_why(tight):
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
