# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Nulls of the coverage benchmark, about drawn features of which the right answer is known."""

import numpy as np
import pytest

from benchmarks._coverage_nulls import (
    at_precision,
    deviations,
    jitters,
    joint_gain,
    scaled,
    speed_spread,
)
from scenario_gen.method.evaluation.encounter_features import EncounterFeatures, FEATURES
from scenario_gen.method.evaluation.population import Members

WIDTH = len(FEATURES)


@pytest.fixture(scope="module")
def found():
    """Forty recorded encounters of eight recordings, and ten members of each that differ by 0.3 standard deviations."""
    rng = np.random.default_rng(7)
    recorded = [
        EncounterFeatures("crossing", rng.standard_normal(WIDTH), f"{n // 5}", n, (0, 1))
        for n in range(40)
    ]
    made = [
        EncounterFeatures(
            "crossing",
            own.features + 0.3 * rng.standard_normal(WIDTH),
            own.recording,
            own.template,
            (0, 1),
        )
        for own in recorded
        for _ in range(10)
    ]
    return Members(recorded, made)


def test_deviations_are_scaled_about_each_template(found):
    np.testing.assert_allclose(
        deviations(scaled(found, 0.5), "crossing"), 0.5 * deviations(found, "crossing")
    )


def test_a_null_becomes_as_precise_as_is_asked(found):
    wild = scaled(found, 5.0)
    wanted = found.shares(10)[2].value
    assert wild.shares(10)[2].value < wanted - 0.2
    assert at_precision(wild, wanted, 10)[1].value == pytest.approx(wanted, abs=0.1)


def test_jitters_have_the_spread_of_the_generated(found):
    own = deviations(found, "crossing")
    for name, null in jitters(found, np.random.default_rng(3)):
        assert deviations(null, "crossing").std() == pytest.approx(own.std(), rel=0.1), name


def test_speeds_spread_by_the_share_that_was_drawn(found):
    assert speed_spread(found) == pytest.approx(0.3, abs=0.05)


def test_what_is_not_mixed_is_more_precise_than_what_is(found):
    assert joint_gain(found, found, 10) == {"crossing": 0.0}
    assert joint_gain(found, scaled(found, 5.0), 10)["crossing"] > 0.2
