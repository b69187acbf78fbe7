# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Texts of several pieces parted by `;`."""

from hypothesis import given
from hypothesis import strategies as st
import pytest

from scenario_gen.types import join_pieces, read_numbers, split_pieces

WORD = st.text(st.characters(exclude_characters=";", exclude_categories=("Z", "C")), min_size=1)


@given(st.lists(WORD))
def test_what_is_joined_is_split_again(words):
    assert split_pieces(join_pieces(words)) == words


def test_empty_pieces_are_none():
    assert split_pieces(" ; a b;;c ; ") == ["a b", "c"]


@pytest.mark.parametrize(
    ("text", "numbers"),
    [("1 -2.5,3e1", (1.0, -2.5, 30.0)), ("", ()), ("1 two", ()), ("1 nan", ()), ("inf", ())],
)
def test_numbers_are_finite_or_none(text, numbers):
    assert read_numbers(text) == numbers
