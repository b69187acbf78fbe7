# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.types import Encounter, Vehicle
from scenario_gen.types.motion import ALWAYS, canonical_presence, cut, held, mask, together

VEHICLES = (Vehicle("a"), Vehicle("b"))


@st.composite
def presences(draw, count=3, samples=9):
    rows = st.tuples(st.integers(0, samples - 2), st.integers(1, samples - 1)).filter(
        lambda row: row[0] < row[1]
    )
    return np.array(draw(st.lists(rows, min_size=count, max_size=count)))


def encounter(present=ALWAYS):
    clock = np.arange(9.0)
    position = np.stack((np.tile(clock, (2, 1)), np.zeros((2, 9))), axis=-1)
    return Encounter.sampled(
        VEHICLES, 0.1, position, np.zeros((2, 9)), np.ones((2, 9)), "test", present=present
    )


@given(presences())
def test_held_values_are_the_nearest(present):
    values = np.arange(27.0).reshape(3, 9)
    rows = held(values, present)
    there = mask(present, 9)
    assert (rows[there] == values[there]).all()
    for row, own, (first, last) in zip(rows, values, present, strict=True):
        assert (row[:first] == own[first]).all()
        assert (row[last:] == own[last]).all()


@given(presences())
def test_together_means_both_present(present):
    there = mask(present, 9)
    for a, b in ((0, 1), (0, 2), (1, 2)):
        assert (
            np.arange(9)[together(present, a, b)].tolist()
            == np.flatnonzero(there[a] & there[b]).tolist()
        )


@given(presences(), st.integers(0, 4), st.integers(5, 9))
def test_window_presence_is_its_samples(present, first, last):
    there = mask(present, 9)[:, first:last]
    for (begin, end), row in zip(cut(present, first, last), there, strict=True):
        assert list(range(begin, end + 1)) == np.flatnonzero(row).tolist()


def test_encounter_holds_its_edge_values():
    made = encounter(np.array([[0, 6], [2, 8]]))
    assert made.position[0, :, 0].tolist() == [0, 1, 2, 3, 4, 5, 6, 6, 6]
    assert made.position[1, :, 0].tolist() == [2, 2, 2, 3, 4, 5, 6, 7, 8]
    assert not made.all_present
    assert made.is_present.sum() == 14


@pytest.mark.parametrize(
    ("present", "said"),
    [
        ([[0, 8]], "2 rows"),
        ([[0, 8], [3, 3]], "row 1 is present from sample 3 to 3 of 9"),
        ([[0, 9], [0, 8]], "row 0"),
        ([[-1, 8], [0, 8]], "row 0"),
        ([[1, 8], [2, 8]], "nobody is present at its first"),
    ],
)
def test_impossible_presence_is_refused(present, said):
    with pytest.raises(InputError, match=said):
        encounter(np.array(present))
    if "nobody" not in said:
        with pytest.raises(InputError, match=said):
            canonical_presence(np.array(present), 2, 9, "test")
