# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""On every CPU the same decisions, and places within a centimetre: one encounter under the settings that other CPUs would choose.

The long form takes the settings one by one; `make soak PART=cpu` every recorded encounter on two roads, and numba's target too.
"""

import pytest
from support.cpu_settings import apart, AT_ONCE, MOST_APART_M, results_under, SETTINGS
from support.lengths import LONG
from support.results_of_a_run import of_runs

from scenario_gen.logs.synthetic import bundled

RUN = (8, 7, str(bundled("a")), "t_intersection")


@pytest.fixture(scope="module")
def as_it_is():
    return next(iter(of_runs(*RUN).values()))


@pytest.mark.parametrize("name", list(SETTINGS)[1:] if LONG else AT_ONCE)
def test_decisions_are_equal_on_every_cpu(name, as_it_is):
    (other,) = results_under((SETTINGS | AT_ONCE)[name], *RUN).values()
    assert len(other["decided"]["indices"]) == 8
    assert apart(as_it_is, other) < MOST_APART_M
