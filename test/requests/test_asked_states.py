# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Start and end states: met as asked, or refused with the reason and with what nearby is possible."""

from dataclasses import replace
import re

import numpy as np
import pytest
from support.given import answer
from support.lengths import LONG

from scenario_gen.base.errors import RefusedError
from scenario_gen.base.road_users import Dynamics
from scenario_gen.method.nearest import ImpossibleError
from scenario_gen.method.validity import Limits
from scenario_gen.numerics.arrays import wrap_angle
from scenario_gen.types.request import Request

COUNT = 5 if LONG else 1
pytestmark = pytest.mark.spread


def achieved(outcome):
    """Largest distances [m] and [m/s] from the states asked of the scenarios."""
    asked = outcome.fit.requested
    far = [
        (
            np.hypot(*(s.position[:, k] - states[:, :2]).T).max(),
            np.abs(s.speed[:, k] - states[:, 3]).max(),
        )
        for s in outcome.generated.scenarios
        for k, states in ((0, asked.start), (-1, asked.end))
    ]
    return np.max(far, axis=0)


def state(plain, end, vehicle, ahead=0.0, left=0.0, speed=None):
    """A state of the plain fit, moved: as text."""
    x, y, yaw, v = getattr(plain.fit.requested, end)[vehicle]
    x, y = (
        x + ahead * np.cos(yaw) - left * np.sin(yaw),
        y + ahead * np.sin(yaw) + left * np.cos(yaw),
    )
    return f"{vehicle + 1}: {x:.3f} {y:.3f} {yaw:.6f} {v if speed is None else speed:.3f}"


CHANGES = [
    {"goals": (1, 2.0, 0.2, 3.0)},
    {"starts": (1, -3.0, 0.0, 12.0), "goals": (0, 3.0, 0.0, 0.0)},
]
CHANGES += [{"starts": (0, 5.0, 0.0, 9.0)}, {"starts": (0, 0.0, 0.0, 0.2)}]


@pytest.mark.parametrize("change", CHANGES)
def test_what_is_asked_is_met(chain, plain, change):
    ends = {"starts": "start", "goals": "end"}
    texts = {name: state(plain, ends[name], *values) for name, values in change.items()}
    request = Request(**texts)
    outcome = answer(chain, request, count=COUNT)
    assert len(outcome.generated.scenarios) == COUNT
    assert (achieved(outcome) <= (0.1, 0.1)).all()
    for name, own in ends.items():
        rows, met = request.rows(name, chain.encounter), getattr(outcome.fit.requested, own)
        asked = np.isfinite(rows)
        off = np.where(asked, met - rows, 0.0)
        off[:, 2] = wrap_angle(off[:, 2])
        assert np.abs(off).max() < 1e-6, "asked states are those of the checker"
        untouched = ~asked.any(axis=1) & ~np.isfinite(request.rows("starts", chain.encounter)).any(
            axis=1
        )
        untouched &= ~np.isfinite(request.rows("goals", chain.encounter)).any(axis=1)
        assert np.array_equal(met[untouched], getattr(plain.fit.requested, own)[untouched]), (
            "others are as they were"
        )


def refused(chain, **texts):
    """The error of an impossible request; its suggestions (short: the first) are taken, from the text alone, and work."""
    with pytest.raises(ImpossibleError) as caught:
        answer(chain, Request(**texts), count=COUNT)
    error = caught.value
    assert error.suggestions, str(error)
    offers = str(error).partition("Nearest possible: ")[2].split("; or ")
    assert len(offers) == len(error.suggestions)
    for offer in offers if LONG else offers[:1]:
        taken = dict(re.findall(r"(starts|goals):='([^']*)'", offer))
        longer = re.search(r"max_stretch:=([0-9.]+)", offer)
        own = (
            chain
            if longer is None
            else replace(chain, sampling=replace(chain.sampling, max_stretch=float(longer[1])))
        )
        outcome = answer(own, Request(**(texts | taken)), count=COUNT)
        assert len(outcome.generated.scenarios) == COUNT
        assert (achieved(outcome) <= (0.1, 0.1)).all()
    return error


def moved(error, chain, texts, end):
    """How far [m] the first suggestion is from what was asked."""
    before, after = (
        request.rows(end, chain.encounter)[:, :2]
        for request in (Request(**texts), error.suggestions[0].request)
    )
    return float(np.nanmax(np.hypot(*(after - before).T)))


@pytest.mark.parametrize(
    "vehicle", [0, pytest.param(1, marks=pytest.mark.long)]
)  # the second needs a search along its way
def test_a_goal_off_the_road(chain, plain, vehicle):
    texts = {"goals": state(plain, "end", vehicle, left=-4.0)}
    error = refused(chain, **texts)
    assert "off the road" in str(error)
    assert 0.0 < moved(error, chain, texts, "goals") < 4.5


def test_a_start_on_top_of_another_vehicle(following):
    """Two cars drive the same way: the nearest start without overlap lies behind or in front."""
    made = answer(following, Request(), count=1)
    x, y, yaw, speed = made.fit.requested.start[0]
    texts = {"starts": f"2: {x + 1.0:.2f} {y:.2f} {yaw:.4f} {speed:.2f}"}
    error = refused(following, **texts)
    assert "at the requested start vehicles 1 and 2 overlap by" in str(error)
    assert 3.8 <= moved(error, following, texts, "starts") < 10.0


def test_a_goal_too_far_for_the_scale(chain, plain):
    texts = {"goals": state(plain, "end", 0, ahead=-70.0)}
    error = refused(chain, **texts)
    assert "scale" in str(error)
    assert moved(error, chain, texts, "goals") < 50.0


def test_a_goal_too_far_for_the_time(chain, plain):
    slow = replace(
        chain,
        sampling=replace(chain.sampling, max_stretch=0.0),
        limits=Limits(car=Dynamics(max_acceleration=0.7 if LONG else 0.9)),
    )
    texts = {
        "starts": state(plain, "start", 0, speed=0.0),
        "goals": state(plain, "end", 0, ahead=10.0),
    }
    error = refused(slow, **texts)
    assert "cannot drive" in str(error)
    assert any(one.max_stretch is not None for one in error.suggestions), (
        "a longer clock is offered"
    )
    assert any(one.max_stretch is None for one in error.suggestions), "and another state"


@pytest.mark.long
def test_a_start_too_fast_to_stop(chain, plain):
    weak = replace(chain, limits=Limits(car=Dynamics(max_deceleration=4.5)))
    texts = {
        "starts": state(plain, "start", 0, speed=38.0),
        "goals": state(plain, "end", 0, speed=0.0),
    }
    error = refused(weak, **texts)
    assert "cannot drive" in str(error)
    slower = error.suggestions[0].request.states("starts")["1"]
    assert (
        25.0 < slower[3] < 38.0
        and slower[:2] == error.suggestions[0].request.states("starts")["1"][:2]
    )


@pytest.mark.long
def test_a_speed_above_the_limit(chain, plain):
    error = refused(chain, starts=state(plain, "start", 1, speed=60.0))
    assert "at most 40 m/s is planned, 8/9 of limits.car.max_speed" in str(error)
    assert 20.0 < error.suggestions[0].request.states("starts")["2"][3] <= 40.0


def test_a_cancelled_search_suggests_nothing(chain, plain):
    with pytest.raises(ImpossibleError) as caught:
        answer(
            chain,
            Request(goals=state(plain, "end", 1, left=-4.0)),
            count=COUNT,
            cancelled=lambda: True,
        )
    assert issubclass(ImpossibleError, RefusedError)
    assert caught.value.suggestions == ()
