# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""On every CPU the same decisions, and places within a centimetre: one encounter under the settings that other CPUs would choose.

The long form takes the settings one by one; `make soak PART=cpu` every recorded encounter on two roads, and numba's target too.
"""

from functools import cache

from cpu_settings import apart, AT_ONCE, MOST_APART_M, results_under, SETTINGS
from lengths import LONG
import pytest

from scenario_gen.logs.synthetic import bundled

CASE = (str(bundled("a")), "t_intersection")


@cache
def found(name: str):
    """The results under one setting."""
    return results_under((SETTINGS | AT_ONCE)[name], 8, 7, *CASE)


@pytest.mark.parametrize("name", list(SETTINGS)[1:] if LONG else AT_ONCE)
def test_decisions_are_the_same_and_places_within_a_centimetre(name):
    (one,), (other,) = found("as it is").values(), found(name).values()
    assert len(one["decided"]["indices"]) == 8
    assert apart(one, other) < MOST_APART_M


def test_what_was_decided_otherwise_is_seen():
    (one,) = found("as it is").values()
    assert apart(one, one | {"decided": one["decided"] | {"candidates": 9}}) == float("inf")
    assert apart(one, one | {"places": [[[1e3] * len(each) for each in group] for group in one["places"]]}) > MOST_APART_M
