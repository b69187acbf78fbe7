# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Oriented rectangles against shapely's."""

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
import shapely

from scenario_gen.method.evaluation import footprint_distance
from scenario_gen.numerics.boxes import corners, footprint_gaps
from scenario_gen.types import Motion, Vehicle

NUMBER = st.floats(-100.0, 100.0)
NEAR = st.floats(-6.0, 6.0)


@given(NUMBER, NUMBER, NUMBER, st.floats(1.0, 20.0), st.floats(1.0, 5.0))
def test_corners_form_a_ccw_rectangle(x, y, yaw, length, width):
    ring = shapely.LinearRing(corners(np.array([[x, y, yaw]]), length, width)[0])
    box = shapely.Polygon(ring)
    assert ring.is_ccw and box.area == pytest.approx(length * width)
    assert (box.centroid.x, box.centroid.y) == pytest.approx((x, y), abs=1e-9)


@given(NEAR, NEAR, NUMBER, NUMBER)
def test_gaps_are_those_of_polygons(x, y, yaw, other_yaw):
    cars, poses = (
        (Vehicle("a"), Vehicle("b", 7.0, 2.4)),
        np.array([[x, y, yaw], [0.0, 0.0, other_yaw]]),
    )
    boxes = [
        shapely.Polygon(corners(pose[None], car.length, car.width)[0])
        for car, pose in zip(cars, poses, strict=True)
    ]
    true = boxes[0].distance(boxes[1])
    gap, axis = footprint_gaps(cars[0].half, poses[:1], cars[1].half, poses[1:])
    assert (gap[0] < 0.0) == (true == 0.0) or abs(gap[0]) < 1e-9
    assert gap[0] <= true + 1e-9 and np.hypot(*axis[0]) == pytest.approx(1.0)
    twice = poses[:, None].repeat(2, axis=1)
    motion = Motion.sampled(cars, 0.1, twice[..., :2], twice[..., 2], np.zeros((2, 2)))
    # A motion stores headings to nine decimals.
    assert footprint_distance(motion, 0, 1)[0] == pytest.approx(true, abs=1e-8)
