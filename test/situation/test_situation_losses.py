# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From which distance, side and time on a placement loses what was recorded: each bound from both sides."""

import numpy as np
import pytest
from support.motions import encounter_of

from scenario_gen.situation import clean_tracks, find_losses
from scenario_gen.types import Vehicle


def pair(beside, ahead=20.0, faster=0.0, until=149, width=2.5):
    """The tracks of two that go east, one at 10 m/s, another so far beside and ahead of it, until a sample."""
    time = 0.1 * np.arange(150)
    speed = np.array([[10.0], [10.0 + faster]])
    position = np.zeros((2, 150, 2))
    position[..., 0] = speed * time + np.array([[0.0], [ahead]])
    position[1, :, 1] = beside
    vehicles = (Vehicle("1", width=width), Vehicle("2", width=width))
    present = np.array([[0, 149], [0, until]])
    return clean_tracks(encounter_of(position, 0.0, speed, vehicles, present=present))


def lost(template, road):
    return [loss.kind for loss in find_losses(template, road)]


@pytest.mark.parametrize(
    ("recorded", "on_road", "kinds"),
    [
        (1.35, 1.95, []),
        (1.35, 2.05, ["following"]),
        (1.45, 2.05, []),
        (2.25, 1.35, []),
        (2.35, 1.45, []),
        (2.35, 1.35, ["lanes"]),
        (2.35, -1.45, ["lanes"]),
        (5.95, 1.35, ["lanes"]),
        (6.05, 1.35, ["new conflict"]),
    ],
)
def test_lane_is_told_from_offset(recorded, on_road, kinds):
    assert lost(pair(recorded), pair(on_road)) == kinds


@pytest.mark.parametrize(("ahead", "kinds"), [(29.8, []), (30.2, ["following"])])
def test_lanes_lead_on_for_30_m(ahead, kinds):
    assert lost(pair(0.0), pair(0.0, ahead)) == kinds


@pytest.mark.parametrize(("samples", "kinds"), [(9, []), (10, ["beside"])])
def test_vehicles_are_beside_for_a_second(samples, kinds):
    template, road = (pair(side, 0.0, until=samples - 1, width=1.9) for side in (2.0, -2.0))
    assert lost(template, road) == kinds


@pytest.mark.parametrize(("ahead", "kinds"), [(3.25, []), (3.45, ["beside"])])
def test_half_the_time_beside_is_kept(ahead, kinds):
    """Of 3 s; on the road 1 m/s faster, and farther ahead than a length of 4.8 m after 1.6 s or 1.4 s."""
    template = pair(2.0, 0.0, until=29, width=1.9)
    assert lost(template, pair(2.0, ahead, faster=1.0, until=29, width=1.9)) == kinds


@pytest.mark.parametrize(
    ("beside", "ahead", "on_road", "kinds"),
    [
        (5.9, -20.0, 7.4, []),
        (5.9, -20.0, 7.6, ["overtaking"]),
        (6.1, -20.0, 7.6, []),
        (3.5, -2.2, 7.6, ["overtaking"]),
        (3.5, -1.8, 7.6, ["beside"]),
        (3.5, -27.9, 7.6, ["beside"]),
        (3.5, -27.5, 7.6, ["overtaking"]),
    ],
)
def test_passing_reaches_from_behind_to_ahead(beside, ahead, on_road, kinds):
    """Of one that is 2 m/s faster for 14.9 s: from 2 m behind to 2 m ahead, a lane's width aside."""
    template, road = (pair(side, ahead, faster=2.0, width=1.9) for side in (beside, on_road))
    assert lost(template, road) == kinds
