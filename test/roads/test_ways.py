# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Ways: they begin and end where asked, bend as asked, and their curvature is continuous."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from scenario_gen.roads.ways import draw_ring_route, draw_route


@settings(max_examples=60)
@given(
    turn=st.floats(0.2, 2.6).flatmap(lambda t: st.sampled_from((t, -t))),
    before=st.floats(60.0, 120.0),
    after=st.floats(60.0, 120.0),
    yaw=st.floats(-3.0, 3.0),
    sharpness=st.floats(0.03, 0.17),
)
def test_way_joins_lanes_with_continuous_curvature(turn, before, after, yaw, sharpness):
    corner = before * np.array([np.cos(yaw), np.sin(yaw)])
    leave = np.array(
        [*(corner + after * np.array([np.cos(yaw + turn), np.sin(yaw + turn)])), yaw + turn]
    )
    way = draw_route(np.array([0.0, 0.0, yaw]), leave, sharpness=sharpness)
    assert way is not None
    assert way.points[0] == pytest.approx([0.0, 0.0, yaw], abs=1e-6)
    assert way.points[-1] == pytest.approx(leave, abs=1e-4)
    bend = np.diff(way.points[:, 2]) / np.diff(way.station)
    if 1.5 * abs(turn) / sharpness < 50.0:  # there is room for it
        assert np.abs(bend).max() == pytest.approx(sharpness, rel=0.05)
    assert (
        np.abs(np.diff(bend)).max() < 0.5 * np.abs(bend).max()
    )  # the shortest transition has three samples


@pytest.mark.parametrize(
    ("leave", "turn"), [(0.0, 0.0), (np.pi / 2.0, np.pi / 2.0), (-np.pi / 2.0, -np.pi / 2.0)]
)
def test_roundabout_follows_direction_of_traffic(leave, turn):
    out = np.array([np.cos(leave), np.sin(leave)])
    goal = np.array([*(70.0 * out + 1.75 * np.array([out[1], -out[0]])), leave])
    way = draw_ring_route(np.array([-70.0, -1.75, 0.0]), goal, np.zeros(2), 20.0)
    assert way is not None
    assert way.points[-1, 2] - way.points[0, 2] == pytest.approx(turn, abs=0.02)
    assert np.hypot(*way.points[:, :2].T).min() == pytest.approx(20.0, abs=0.3)
    angle = np.unwrap(np.arctan2(way.points[:, 1], way.points[:, 0]))
    assert angle[-1] > angle[0]  # counter-clockwise where traffic keeps right
