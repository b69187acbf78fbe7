# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Projection on a curve: only the edges that matter are looked at, and the answer is that of looking at all, to the bit."""

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from scenario_gen.numerics.curve import Curve


def over_all_edges(curve, xy):
    """The nearest point among all edges at once; as many numbers as positions times edges."""
    ends = curve.at(np.array([-1e4, curve.length + 1e4]))
    line = np.vstack((ends[:1], curve.points, ends[1:]))[:, :2]
    at = np.concatenate(([-1e4], curve.station, [curve.length + 1e4]))
    edge = np.diff(line, axis=0)
    size = np.hypot(edge[:, 0], edge[:, 1])
    along = edge / size[:, None]
    rel = xy[:, None, :] - line[None, :-1, :]
    t = np.clip(rel[..., 0] * along[:, 0] + rel[..., 1] * along[:, 1], 0.0, size)
    across, over = rel[..., 0] - t * along[:, 0], rel[..., 1] - t * along[:, 1]
    gap = np.sqrt(across * across + over * over)
    best, rows = np.argmin(gap, axis=1), np.arange(len(xy))
    side = along[best, 0] * rel[rows, best, 1] - along[best, 1] * rel[rows, best, 0]
    return at[best] + t[rows, best], np.sign(side) * gap[rows, best]


@given(st.integers(0, 2**32 - 1), st.floats(-1.0, 3.5), st.booleans())
def test_the_same_as_over_all_edges(seed, scale, whole):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(rng.integers(2, 80), 2)).cumsum(axis=0) * 5.0
    xy = rng.normal(size=(rng.integers(1, 300), 2)).cumsum(axis=0) * 10.0**scale
    if whole:  # ties: the first of several nearest edges counts
        points, xy = (
            np.column_stack((np.arange(len(points)), np.round(points[:, 1]))),
            np.round(xy),
        )
    curve = Curve(np.column_stack((points, np.zeros(len(points)))))
    for one, other in zip(curve.project(xy), over_all_edges(curve, xy), strict=True):
        assert one.tobytes() == other.tobytes()


def test_long_curve_is_projected_piecewise():
    """Ten kilometres in half metres: over all edges it would be a table of 3 GB."""
    s = np.arange(0.0, 10_000.0, 0.5)
    curve = Curve(np.column_stack((s, 5.0 * np.sin(s / 50.0), np.arctan(0.1 * np.cos(s / 50.0)))))
    station, offset = curve.project(curve.points[:, :2])
    assert station == pytest.approx(curve.station, abs=1e-6)
    assert np.abs(offset).max() < 1e-9 and len(curve.project(np.zeros((0, 2)))[0]) == 0
