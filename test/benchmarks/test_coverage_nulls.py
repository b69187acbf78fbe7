# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Coverage at one precision, about drawn features of which the right answer is known."""

from dataclasses import replace
import json

import numpy as np
import pytest
from support.textbook_motions import labelled

from benchmarks._coverage_members import Members
from benchmarks._coverage_nulls import (
    at_precision,
    joint_gain,
    kinds_with,
    nearest,
    RADIUS_SHARES,
    shares_by_kind,
    shifted,
    speed_spread,
)
from benchmarks.coverage import PAIRS
from scenario_gen.method.evaluation.law import EncounterFeatures, FEATURES
from scenario_gen.types import Cause, Verdict, Violation

WIDTH = len(FEATURES)


def members(spread):
    """Return forty encounters of eight sessions, and ten members of each with a spread."""
    rng = np.random.default_rng(7)
    recorded = [
        EncounterFeatures("crossing", rng.standard_normal(WIDTH), f"{n // 5}", n, (0, 1))
        for n in range(40)
    ]
    made = [
        replace(member, features=member.features + spread * rng.standard_normal(WIDTH))
        for member in recorded
        for _ in range(10)
    ]
    return Members(recorded, made, radius_share=RADIUS_SHARES[0])


def test_the_radius_makes_the_precision_of_the_recorded():
    found = members(0.3)
    shares = found.shares(10)
    assert shares[3].value == pytest.approx(RADIUS_SHARES[0], abs=0.1)


def test_of_the_wilder_members_those_nearest_to_their_template_are_kept_at_one_precision():
    (wild,), (tame,) = kinds_with(members(0.3), 10), kinds_with(members(0.05), 10)
    precision = shares_by_kind([tame], 10).precision.value
    assert shares_by_kind([wild], 10).precision.value < precision
    kept = at_precision([wild], 10, precision)
    assert 0.0 < kept.kept < 1.0 and kept.precision.value >= precision
    assert at_precision([tame], 10, precision).kept == 1.0
    assert len(nearest(tame, 0.5).made) == 200


def test_speeds_spread_by_the_share_that_was_drawn():
    assert speed_spread(members(0.3)) == pytest.approx(0.3, abs=0.05)


def test_what_is_not_mixed_is_more_precise_than_what_is():
    found = members(0.3)
    assert joint_gain(found, found, 10) == {"crossing": 0.0}
    assert joint_gain(found, members(3.0), 10)["crossing"] > 0.2


def test_windows_of_a_session_are_one_recording():
    files = {}
    for row in json.loads(PAIRS.read_text()):
        for file in row["files"]:
            files.setdefault(file, set()).add(row["name"])
    assert all(len(sessions) == 1 for sessions in files.values())


def test_shifted_records_are_cut_at_their_ends_and_valid():
    encounter = labelled("crossing, rolls", 3).encounter
    checked = []

    def check(scenarios):
        checked.extend(scenarios)
        order = Cause.PASSING_ORDER
        return [Verdict((Violation(order, 0.0, (0, 1), ""),) * (len(checked) % 2))]

    made = shifted(encounter, check, np.random.default_rng(0), 10)
    assert made == checked[1:20:2]
    for scenario in made:
        assert scenario.time[-1] < encounter.duration
        moved = np.hypot(*np.diff(scenario.position, axis=1).T) > 0.0
        assert (moved[-1] | (scenario.speed[:, -1] < 0.1)).all(), "nobody freezes at an end"


def test_a_draw_that_leaves_few_or_one_session_unseen_does_not_count():
    found = members(0.3)
    few = [replace(each, recording="0") for each in found.recorded[:35]]
    assert kinds_with(replace(found, recorded=[*few, *found.recorded[35:]]), 5) == []
    two = [replace(each, recording=str(each.template // 20)) for each in found.recorded]
    assert kinds_with(replace(found, recorded=two), 5) == []
