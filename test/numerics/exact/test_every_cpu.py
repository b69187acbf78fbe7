# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The same bytes on every CPU: one encounter under the settings that other CPUs would choose, all of them at once.

The long form takes the settings one by one; `make soak PART=cpu` every recorded encounter on two roads, and numba's target too.
"""

from functools import cache
import json

from cpu_settings import AT_ONCE, digests, SETTINGS
from lengths import LONG
import pytest

from scenario_gen.logs.synthetic import bundled

CASE = (str(bundled("a")), "t_intersection")


@cache
def found(name: str) -> dict[str, dict[str, str]]:
    """The digests under one setting."""
    result: dict[str, dict[str, str]] = json.loads(digests((SETTINGS | AT_ONCE)[name], 8, 7, *CASE))
    return result


@pytest.mark.parametrize("name", list(SETTINGS)[1:] if LONG else AT_ONCE)
def test_every_stage_gives_the_same_bytes(name):
    (one,), (two,) = found("as it is").values(), found(name).values()
    assert set(one) == {"encounter", "changepoints", "routes", "scenarios", "evaluation"}
    assert two == one
