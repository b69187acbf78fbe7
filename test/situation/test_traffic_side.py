# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""On which side a template drives, and its mirror image."""

from dataclasses import replace

import numpy as np
import pytest
from support.motions import oncoming

from scenario_gen.situation.traffic_side import mirrored, traffic_side


@pytest.mark.parametrize(("side", "name"), [(1.0, "right"), (-1.0, "left")])
def test_side_is_that_of_passing(side, name):
    assert traffic_side(oncoming(side)) == name
    assert traffic_side(mirrored(oncoming(side))) == {"right": "left", "left": "right"}[name]


def test_who_passes_nobody_has_no_side():
    one = oncoming(1.0)
    position = one.position[[0, 0]] + np.array([[[0.0, 0.0]], [[20.0, 0.0]]])
    assert traffic_side(replace(one, position=position, heading=one.heading[[0, 0]])) == ""
