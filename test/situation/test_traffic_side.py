# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""On which side a template drives, and its mirror image."""

from dataclasses import replace

import numpy as np
import pytest

from scenario_gen.situation.traffic_side import mirrored, traffic_side
from scenario_gen.types import Encounter, Vehicle


def oncoming(side):
    """Two vehicles that pass each other, each on its own `side` of the road: 1 for the right."""
    time = np.arange(101) * 0.1
    there = np.column_stack([10.0 * time - 50.0, np.full(101, -1.75 * side)])
    back = np.column_stack([50.0 - 10.0 * time, np.full(101, 1.75 * side)])
    heading = np.stack([np.zeros(101), np.full(101, np.pi)])
    return Encounter.sampled(
        (Vehicle("1"), Vehicle("2")),
        0.1,
        np.stack([there, back]),
        heading,
        np.full((2, 101), 10.0),
        "o",
    )


@pytest.mark.parametrize(("side", "name"), [(1.0, "right"), (-1.0, "left")])
def test_side_is_that_of_passing(side, name):
    assert traffic_side(oncoming(side)) == name
    assert traffic_side(mirrored(oncoming(side))) == {"right": "left", "left": "right"}[name]


def test_who_passes_nobody_has_no_side():
    one = oncoming(1.0)
    position = one.position[[0, 0]] + np.array([[[0.0, 0.0]], [[20.0, 0.0]]])
    assert traffic_side(replace(one, position=position, heading=one.heading[[0, 0]])) == ""
