# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.numerics.arrays import canonical_heading
from scenario_gen.types import Encounter, Vehicle


def encounter(**changes):
    arguments = {
        "name": "test",
        "vehicles": (Vehicle("a"), Vehicle("b")),
        "time": np.arange(5) * 0.1,
        "position": np.zeros((2, 5, 2)),
        "heading": np.zeros((2, 5)),
        "speed": np.zeros((2, 5)),
    }
    return Encounter(**(arguments | changes))


def test_arrays_cannot_be_changed():
    position = np.zeros((2, 5, 2))
    made = encounter(position=position)
    position[:] = 1.0
    assert not made.position.any()
    with pytest.raises(ValueError, match="read-only"):
        made.position[0, 0, 0] = 1.0


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"speed": np.full((2, 5), -1.0)}, "negative speed"),
        ({"speed": np.full((2, 5), np.nan)}, "not finite"),
        ({"position": np.zeros((2, 4, 2))}, "disagree in shape"),
        ({"vehicles": (Vehicle("a"), Vehicle("a"))}, "not unique"),
        ({"speed": np.zeros((1, 5))}, "at least 2"),
    ],
)
def test_bad_encounters_are_refused(changes, said):
    with pytest.raises(InputError, match=said):
        encounter(**changes)


@given(st.lists(st.floats(-0.5, 0.5), min_size=2, max_size=50), st.floats(-10.0, 10.0))
def test_canonical_heading_is_continuous_and_idempotent(steps, start):
    heading = canonical_heading(start + np.cumsum(steps))
    assert np.abs(np.diff(heading)).max() <= 0.5 + 1e-8
    assert (canonical_heading(heading) == heading).all()
