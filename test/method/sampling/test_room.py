# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Room beside and beyond a route, and deviations within it: closed forms in a straight corridor."""

import numpy as np
import pytest
from support.motions import road_of

from scenario_gen.method.sampling.deviations import lateral_room, road_ahead, soft_clipped
from scenario_gen.method.sampling.path import BasePath
from scenario_gen.method.sampling.routed_vehicle import sharpest_curvature
from scenario_gen.types import Vehicle

ROAD = road_of(np.ones((100, 1000), dtype=bool), 0.1)  # 100 m by 10 m
CAR = Vehicle("a", 4.0, 2.0)


def route(y, start=20.0, end=80.0, turned=False):
    """A straight route along the corridor, or back."""
    x = np.arange(start, end + 0.5)
    node = np.column_stack([x, np.full(len(x), y), np.zeros(len(x))])
    back = node[::-1] + np.array([0.0, 0.0, np.pi])
    return BasePath(back if turned else node, 1.0, np.zeros(0))


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("y", "most", "room"), [(4.05, 9.0, 3.0), (6.05, 9.0, 2.9), (5.0, 1.25, 1.25)]
)
def test_room_is_that_of_nearer_side(y, most, room, turned):
    """The flank is 1 m beside the centre, and moved by 0.1 m."""
    found = lateral_room(route(y, turned=turned), CAR, ROAD, most)
    np.testing.assert_allclose(found, room, atol=1e-9)


def test_both_ends_of_a_flank_count():
    """Where the road narrows, before and behind the same centre."""
    narrow = ROAD.drivable.copy()
    narrow[:20, 499:] = False
    road = road_of(narrow, 0.1)
    there, back = (lateral_room(route(5.0, turned=turned), CAR, road, 9.0) for turned in (0, 1))
    np.testing.assert_allclose(there, back[::-1], atol=1e-9)
    assert there.min() < there.max()


@pytest.mark.parametrize(("start", "end"), [(20.0, 80.0), (3.0, 93.0)])
def test_road_ahead_ends_with_the_map(start, end):
    """From the bumper on, in steps of 0.5 m."""
    found = road_ahead(route(5.0, start, end), CAR, ROAD, np.array([10.0, 12.0]))
    expected = min(start - 2.0, 10.0), min(98.0 - end, 12.0)
    assert (found <= np.array(expected) + 1e-9).all()
    np.testing.assert_allclose(found, expected, atol=1.01)


@pytest.mark.parametrize(
    ("left", "blocked"), [(1.65, False), (1.15, True), (-1.15, True), (-1.65, False)]
)
def test_wall_beside_way_ends_it(left, blocked):
    """Its side is 1 m beside the centre, and 0.3 m are kept; the front is 3 m before the wall."""
    wall = ROAD.drivable.copy()
    cell = int((5.0 + left) / 0.1)
    wall[cell - 2 : cell + 3, 850:862] = False
    ends = [
        road_ahead(route(5.0), CAR, road_of(w, 0.1), np.full(2, 12.0))
        for w in (ROAD.drivable, wall)
    ]
    assert ends[1][0] == ends[0][0] and (ends[1][1] < ends[0][1]) == blocked
    assert not blocked or ends[1][1] == pytest.approx(3.0, abs=1.01)


@pytest.mark.parametrize(("left", "metres"), [(1.3, 3.2), (-1.3, 3.2), (2.0, 12.0), (-2.0, 12.0)])
def test_sides_are_square_to_way(left, metres):
    """The same on a way at 45°: a pillar of 0.7 m, 6 m ahead of the last centre."""
    ahead = np.sqrt(0.5) * np.ones(2)
    centre = 10.0 + np.arange(20.0)[:, None] * ahead
    node = np.column_stack((centre, np.full(20, 0.25 * np.pi)))
    pillar = centre[-1] + 6.0 * ahead + left * np.array([-ahead[1], ahead[0]])
    column, row = (pillar / 0.1).astype(int)
    drivable = np.ones((500, 500), dtype=bool)
    drivable[row - 3 : row + 4, column - 3 : column + 4] = False
    path = BasePath(node, 1.0, np.zeros(0))
    found = road_ahead(path, CAR, road_of(drivable, 0.1), np.full(2, 12.0))
    assert found[1] == pytest.approx(metres, abs=1.01)


def test_deviations_are_bent_within_room():
    """Unchanged up to 0.6 of the room, then bent with the same slope, never beyond."""
    room = np.full(2001, 2.0)
    deviation = np.linspace(-10.0, 10.0, 2001)[None]
    (bent,) = soft_clipped(deviation, room)
    inner = np.abs(deviation[0]) <= 1.2
    np.testing.assert_array_equal(bent[inner], deviation[0, inner])
    assert (np.abs(bent) <= 2.0).all() and np.abs(bent[[0, -1]]) == pytest.approx(2.0, abs=1e-3)
    np.testing.assert_allclose(bent, -bent[::-1], atol=1e-12)
    slope = np.diff(bent) / np.diff(deviation[0])
    assert (slope >= 0.0).all()
    assert (slope <= 1.0 + 1e-9).all()
    assert np.abs(np.diff(slope)).max() < 0.03
    share = (1.8 / 2.0 - 0.6) / 0.4
    assert np.interp(1.8, deviation[0], bent) == pytest.approx(
        2.0 * (0.6 + 0.4 * np.tanh(share)), abs=1e-3
    )


@pytest.mark.parametrize("radius", [10.0, -25.0])
def test_curvature_is_the_sharpest_near(radius):
    """A straight of 30 m, an arc of 20 m, a straight: the arc's curvature from a little before to a little behind it."""
    bend = np.where(np.arange(80) % 80 < 30, 0.0, np.where(np.arange(80) < 50, 1.0 / radius, 0.0))
    yaw = np.concatenate([[0.0], np.cumsum(bend)])
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    step = np.column_stack([np.cos(middle), np.sin(middle)])
    place = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    found = sharpest_curvature(BasePath(np.column_stack([place, yaw]), 1.0, np.zeros(0)))
    np.testing.assert_allclose(found[33:48], 1.0 / abs(radius), rtol=0.02)
    assert found[27] > 0.0 and found[[5, 75]] == pytest.approx([0.0, 0.0], abs=1e-6)
