# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two planners on the same scenarios: nothing for one against itself, and no more false alarms than said."""

from dataclasses import dataclass, replace
import math

import numpy as np
import pandas as pd
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.bars import FIGURES
from scenario_gen.closed_loop.comparison import compared, Earlier
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.origin import Origin
from scenario_gen.closed_loop.results import Drives

PARAMETERS = Drives([], "", ClosedLoopConfig()).document()["parameters"]


@dataclass
class Said:
    passed: bool
    min_ttc: float = 3.0
    min_pet: float = math.nan
    imposed_braking: float = 0.0


@dataclass
class Driven:
    """As much of an outcome as a comparison asks for."""

    name: str
    verdict: Said
    origin: Origin


def driven(failed, encounters):
    return [
        Driven(str(k), Said(not bad), Origin(f"encounter {k % encounters}", f"digest {k}"))
        for k, bad in enumerate(failed.tolist())
    ]


def earlier(failed, **figures):
    rows = {
        "scenario": [f"digest {k}" for k in range(len(failed))],
        "passed": ~failed,
        **dict.fromkeys(FIGURES, math.nan),
        **figures,
    }
    names = pd.Index(map(str, range(len(failed))), name="name")
    return Earlier("before", PARAMETERS, pd.DataFrame(rows, index=names))


def test_the_same_verdicts_give_exactly_nothing():
    failed = np.arange(1000) % 7 == 0
    found = compared(driven(failed, 20), ClosedLoopConfig(), earlier(failed))
    assert found.difference.value == 0.0 and found.difference.low < 0.0 < found.difference.high
    assert (found.now_fail, found.now_pass, found.worse) == ((), (), False)


@pytest.mark.parametrize("encounters", [1, 25])
def test_false_alarms_are_rare_as_stated(encounters):
    """Labels of both are permuted in each scenario, so neither is better; 200 pairs, either side counts."""
    rng = np.random.default_rng(11)
    alarms = 0
    for _ in range(200):
        alike = rng.random(encounters) < 0.3  # some encounters are harder
        rate = np.where(alike[np.arange(400) % encounters], 0.4, 0.1)
        one, two = rng.random(400) < rate, rng.random(400) < rate + 0.1
        swap = rng.random(400) < 0.5
        a, b = np.where(swap, two, one), np.where(swap, one, two)
        found = compared(driven(a, encounters), ClosedLoopConfig(), earlier(b))
        alarms += not found.difference.low <= 0.0 <= found.difference.high
    assert 6 <= alarms <= 16


def test_worse_planner_is_found_and_named():
    before = np.arange(300) % 10 == 0
    now = before | (np.arange(300) % 10 == 1)
    found = compared(driven(now, 13), ClosedLoopConfig(), earlier(before))
    assert found.worse
    assert found.difference.value == pytest.approx(0.1)
    assert len(found.now_fail) == 30
    assert not found.now_pass
    better = compared(driven(before, 13), ClosedLoopConfig(), earlier(now))
    assert not better.worse and better.difference.high < 0.0 and len(better.now_pass) == 30


def test_figures_are_compared_per_drive():
    """Times to collision with noise: the same ones alarm in 2.5 % at most, shorter ones always."""
    rng, failed = np.random.default_rng(5), np.zeros(120, dtype=np.bool_)
    alarms, found = 0, 0
    for _ in range(200):
        known, ttc = rng.uniform(0.0, 8.0, 120), rng.normal(0.0, 0.5, (2, 120))
        for shift in (0.0, -0.3):
            now = driven(failed, 1)
            for k, outcome in enumerate(now):
                outcome.verdict.min_ttc = known[k] + ttc[1, k] + shift
            compare = compared(now, ClosedLoopConfig(), earlier(failed, min_ttc=known + ttc[0]))
            assert list(compare.figures) == ["min_ttc"] and compare.difference.value == 0.0
            alarms = alarms + (compare.worse and not shift)
            found = found + (compare.worse and shift < 0.0)
    assert alarms <= 7 and found >= 180  # more have a probability of 0.01 at 1.7 %
    mean = compare.document()["figures"]["min_ttc"]
    assert f"mean min_ttc {mean['value']:+.2f} s" in compare.sentence() and mean["high"] < 0.0


def test_other_scenarios_or_parameters_are_refused():
    failed = np.zeros(4, dtype=np.bool_)
    known = earlier(failed)
    with pytest.raises(InputError, match=r"1 of 4 scenarios are not the same \(first: 2\)"):
        compared(
            driven(failed, 1),
            ClosedLoopConfig(),
            replace(known, drives=known.drives.replace({"scenario": {"digest 2": "other"}})),
        )
    with pytest.raises(InputError, match=r"1 of 4 scenarios are not the same \(first: 3\)"):
        compared(driven(failed[:3], 1), ClosedLoopConfig(), known)
    with pytest.raises(InputError, match=r"other parameters \(step\)"):
        compared(driven(failed, 1), ClosedLoopConfig(step=0.05), known)
    assert not compared(driven(failed, 1), ClosedLoopConfig(drive_time=3.0), known).worse
