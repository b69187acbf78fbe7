# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a set covers: figures, the matrix of manoeuvres and PET, the scenarios that stand out."""

from dataclasses import replace
import json

import numpy as np
import pytest
from support.motions import encounter_of, scenario_of, straight

from scenario_gen.method.evaluation import coverage_of
from scenario_gen.method.evaluation.measures import measure
from scenario_gen.types import Facts, OrderChange, PassingOrder, Vehicle
from scenario_gen.types.scenario import Scenario

TIME = np.arange(101) * 0.1
CARS = (Vehicle("a", 4.0, 2.0), Vehicle("b", 4.0, 2.0))


def crossing(behind, index=0):
    """Two cars of 4 x 2 m at 10 m/s on crossing axes, the second so many metres behind the first."""
    tracks = [
        straight(-30.0, 0.0, 0.0, 10.0, TIME),
        straight(0.0, -30.0 - behind, 0.5 * np.pi, 10.0, TIME),
    ]
    return replace(scenario_of(tracks, TIME, CARS), index=index)


@pytest.fixture
def template():
    one = crossing(20.0)
    return encounter_of(one.position, one.heading, one.speed, CARS)


def test_figures_matrix_and_picks(template):
    """20 m behind at 10 m/s: 2 s from entry to entry, and 0.6 s less from exit to entry (6 m of 4 + 2)."""
    found = coverage_of(
        template, [crossing(8.0, 5), crossing(19.0, 6), crossing(21.0, 7), crossing(50.0, 8)]
    )
    assert found.spreads["pet"].values == pytest.approx((0.2, 1.3, 1.5, 4.4), abs=0.02)
    assert found.spreads["pet"].template == pytest.approx(1.4, abs=0.02)
    assert found.pairs == {"straight and straight": (0, 1, 0, 2, 0, 1, 0)}
    assert found.picks["most critical"] == 5
    assert found.picks["most different"] == 8
    assert found.picks["most typical"] in (6, 7)
    document = json.loads(json.dumps(found.document(), allow_nan=False))
    assert document["figures"]["ttc"]["values"] == [None] * 4 and document["index"] == [5, 6, 7, 8]


def test_order_outcomes_are_counted(template):
    kept, swapped = (PassingOrder("a", "b", change) for change in list(OrderChange)[:2])
    named = [
        replace(crossing(15.0, k), facts=Facts(order="free", passing_order=(order,)))
        for k, order in enumerate((kept, kept, swapped))
    ]
    assert coverage_of(template, named).orders == {str(kept): 2, str(swapped): 1}
    assert coverage_of(template, []).picks == {}


@pytest.mark.parametrize("behind", [8.0, 20.0, 35.0])
def test_centres_close_as_first_enters(behind):
    """The first one's front is 1 m before the other's path when its centre is 3 m before it, after 2.7 s."""
    a, b = 3.0, 3.0 + behind
    assert measure(crossing(behind), "closing_speed") == pytest.approx(
        10.0 * (a + b) / np.hypot(a, b), rel=1e-3
    )


def test_parallel_drives_close_at_their_fastest():
    """Both drive east, one from 30 m behind at 14 m/s until it brakes to 8 m/s."""
    speed = np.stack([np.full(101, 10.0), np.where(TIME < 5.0, 14.0, 8.0)])
    x = np.cumsum(0.1 * speed, axis=1) + np.array([[30.0], [0.0]])
    position = np.stack([x, np.full(x.shape, 0.0)], axis=-1)
    drive = Scenario(CARS, TIME, position, 0.0 * x, speed, 0.0 * x, 0, 0)
    assert measure(drive, "closing_speed") == pytest.approx(4.0)
