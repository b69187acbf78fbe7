# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""When the quantities of vehicles contradict each other: from which share on, and by how much."""

import numpy as np
import pytest

from scenario_gen.logs.comparison import Comparison

NAMES = tuple(Comparison.__dataclass_fields__)


def compared(**values):
    """Of 20 vehicles; what is not given is unknown."""
    return Comparison(**dict.fromkeys(NAMES, np.full(20, np.nan)) | values)


@pytest.mark.parametrize("name", ["speed_off", "heading_off", "course_off"])
@pytest.mark.parametrize(
    ("count", "share", "contradicts"),
    [(2, 0.5, False), (3, 0.5, True), (3, 0.11, True), (20, 0.1, False), (0, 0.5, False)],
)
def test_more_than_a_tenth_contradicts(name, count, share, contradicts):
    """Of the vehicles, each with more than a tenth of its displacements."""
    made = compared(**{name: np.where(np.arange(20) < count, share, 0.0)})
    assert made.contradicts(name) == contradicts
    assert made.disagreement == pytest.approx(count * share / 20)
    assert not compared().contradicts(name) and compared().disagreement == np.inf


def test_unknown_vehicles_do_not_count():
    values = np.full(20, np.nan)
    values[:4] = (0.5, 0.0, 0.0, 0.0)
    assert compared(speed_off=values).contradicts("speed_off")
    assert compared(speed_off=values).disagreement == pytest.approx(0.125)


def test_deviation_is_the_same_both_ways():
    ratio = np.array([2.0, 0.5, 1.0] + [1.25] * 17)
    np.testing.assert_allclose(compared(ratio=ratio).deviation[:4], [2.0, 2.0, 1.0, 1.25])
