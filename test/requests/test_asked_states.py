# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Start and end states: met as asked, or refused with the reason and with what nearby is possible."""

import re

import numpy as np
import pytest
from support.given import answer
from support.lengths import LONG

from scenario_gen.base.errors import RefusedError
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
    """The reason why a request is impossible."""
    with pytest.raises(RefusedError) as caught:
        answer(chain, Request(**texts), count=COUNT)
    return str(caught.value)


@pytest.mark.parametrize(
    "vehicle", [0, pytest.param(1, marks=pytest.mark.long)]
)  # the second needs a search along its way
def test_a_goal_off_the_road(chain, plain, vehicle):
    texts = {"goals": state(plain, "end", vehicle, left=-4.0)}
    reason = refused(chain, **texts)
    assert "off the road" in reason
    name, asked = texts["goals"].split(": ")
    pose = re.search(r"the nearest pose with room is '([^']*)'", reason)[1]
    off = np.subtract([float(value) for value in pose.split()], np.array(asked.split()[:3], float))
    assert 0.0 < np.hypot(*off[:2]) < 4.5 and off[2] == pytest.approx(0.0, abs=1e-3)
    speed = "".join(asked.split()[3:])
    outcome = answer(chain, Request(goals=f"{name}: {pose} {speed}"), count=COUNT)
    assert len(outcome.generated.scenarios) == COUNT


def test_start_on_top_of_another_vehicle(following):
    """Two cars drive the same way."""
    made = answer(following, Request(), count=1)
    x, y, yaw, speed = made.fit.requested.start[0]
    texts = {"starts": f"2: {x + 1.0:.2f} {y:.2f} {yaw:.4f} {speed:.2f}"}
    reason = refused(following, **texts)
    assert "at the requested start vehicles 1 and 2 overlap by" in reason


def test_goal_too_far_for_the_scale(chain, plain):
    texts = {"goals": state(plain, "end", 0, ahead=-70.0)}
    reason = refused(chain, **texts)
    assert "scale" in reason
