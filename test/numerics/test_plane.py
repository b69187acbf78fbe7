# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Directions, frames and polylines in the plane."""

from hypothesis import given
from hypothesis import strategies as st
import numpy as np

from scenario_gen.numerics import (
    ahead_and_left,
    angle_between,
    edge_lengths,
    edge_yaws,
    meeting_shares,
    place,
    polyline_of,
    unit,
    unit_left,
)

NUMBER = st.floats(-100.0, 100.0)


@given(NUMBER, NUMBER, NUMBER, NUMBER, NUMBER)
def test_placed_points_are_seen_there(x, y, yaw, ahead, left):
    at = place(np.array([x, y, yaw]), ahead, left)
    assert np.allclose(ahead_and_left(at - np.array([x, y]), yaw), (ahead, left), atol=1e-9)
    assert np.allclose(at, np.array([x, y]) + ahead * unit(yaw) + left * unit_left(yaw), atol=1e-9)


@given(NUMBER, NUMBER)
def test_wrapped_angle_turns_between_two(angle, other):
    between = angle_between(angle, other)
    assert -np.pi <= between < np.pi
    assert np.allclose(unit(other + between), unit(angle), atol=1e-9)


def test_polyline_is_rebuilt_from_its_directions():
    yaw = np.linspace(0.0, 1.0, 201)
    points = polyline_of(yaw, 0.05)
    assert np.allclose(
        points[-1], (10.0 * np.sin(1.0), 10.0 * (1.0 - np.cos(1.0))), atol=1e-4
    )  # a circle of 10 m
    assert np.allclose(edge_lengths(points), 0.05) and np.allclose(
        edge_yaws(points), (yaw[1:] + yaw[:-1]) / 2.0
    )
    assert np.allclose(polyline_of(yaw, edge_lengths(points)), points)


def test_lines_meet_at_their_shares():
    p, u, v = np.zeros(2), np.array([4.0, 0.0]), np.array([0.0, 2.0])
    t, s, cross = meeting_shares(p, u, np.array([1.0, -1.0]), v)
    assert (t, s, cross) == (0.25, 0.5, 8.0)
    t, s, cross = meeting_shares(p, u, np.array([0.0, 1.0]), u)
    assert cross == 0.0 and not np.isfinite([t, s]).any()
