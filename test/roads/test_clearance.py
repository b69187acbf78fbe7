# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The clearance field and the tests against it, re-checked by brute force and by shapely."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from shapely import area, intersection
from shapely.geometry import box, LineString, Point
from shapely.ops import unary_union
from support import motions
from support.oracle import footprints

from scenario_gen.roads.clearance import footprint_fits, nearest_pose_with_room, segments_free
from scenario_gen.roads.connectivity import free_cells, free_space, FreeSpace


def road_of(drivable, resolution=1.0, origin=(0.0, 0.0)):
    return motions.road_of(np.asarray(drivable, dtype=bool), resolution, origin)


def random_road(rng, shape=(12, 15), density=0.25, resolution=0.5, origin=(-3.0, 2.0)):
    drivable = rng.random(shape) > density
    drivable[0, 0] = True
    return road_of(drivable, resolution, origin)


def blocked_space(road):
    """All that is not drivable, as a shapely geometry, with a wide frame around the grid."""
    height, width = road.drivable.shape
    x, y = road.origin
    r = road.resolution
    whole = box(x, y, x + width * r, y + height * r)
    cells = [
        box(x + j * r, y + i * r, x + (j + 1) * r, y + (i + 1) * r)
        for i, j in zip(*np.nonzero(~road.drivable), strict=True)
    ]
    return unary_union([*cells, whole.buffer(100.0).difference(whole)])


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("density", [0.0, 0.02, 0.3, 0.8])
def test_field_is_distance_to_blocked_squares(seed, density):
    rng = np.random.default_rng([seed, int(density * 100)])
    road = random_road(rng, (rng.integers(1, 20), rng.integers(1, 20)), density)
    blocked = blocked_space(road)
    expected = np.array(
        [
            [
                blocked.distance(Point(road.origin + (np.array([j, i]) + 0.5) * road.resolution))
                for j in range(road.drivable.shape[1])
            ]
            for i in range(road.drivable.shape[0])
        ]
    )
    np.testing.assert_allclose(road.clearance_cells * road.resolution, expected, atol=1e-12)


@pytest.mark.parametrize("radius", [0.0, 0.3, 0.9])
def test_segments_against_shapely(radius):
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(8):
        road = random_road(rng, density=0.08)
        blocked = blocked_space(road)
        core = blocked.buffer(-1e-7)
        a = rng.uniform((-3.5, 1.5), (5.0, 8.5), (400, 2))
        b = a + rng.normal(0.0, 2.0, (400, 2))
        for start, end, free in zip(a, b, segments_free(road, a, b, radius), strict=True):
            line = LineString([start, end])
            gap = line.distance(blocked)
            if abs(gap - radius) > 1e-9 or (gap == 0.0 and line.intersects(core)):
                assert free == (gap > radius)
                seen.add(bool(free))
    assert seen == {True, False}


def test_segment_does_not_slip_through_corners():
    road = road_of([[1, 0], [0, 1]])
    assert not segments_free(road, np.array([[0.5, 0.5]]), np.array([[1.5, 1.5]]), 0.0)[0]


def test_footprints_against_shapely():
    rng = np.random.default_rng(4)
    seen = set()
    for _ in range(8):
        road = random_road(rng, density=0.05)
        blocked = blocked_space(road)
        poses = np.column_stack(
            [rng.uniform((-3.0, 2.0), (4.5, 8.0), (300, 2)), rng.uniform(-4.0, 4.0, 300)]
        )
        shapes = footprints(poses[:, :2], poses[:, 2], 1.7, 0.8)
        overlaps = area(intersection(shapes, blocked))
        is_clear = (overlaps == 0.0) | (overlaps > 1e-7)
        fits = footprint_fits(road, poses, 1.7, 0.8)[is_clear]
        np.testing.assert_array_equal(fits, overlaps[is_clear] == 0.0)
        seen |= set(fits.tolist())
    assert seen == {True, False}


def test_footprint_may_touch_but_not_leave():
    road = road_of(np.ones((4, 10)), resolution=0.5)
    assert footprint_fits(road, np.array([[2.5, 1.0, 0.0]]), 5.0, 2.0)[0]
    assert not footprint_fits(road, np.array([[2.5, 1.0, 0.0]]), 5.0, 2.001)[0]
    assert not footprint_fits(road, np.array([[2.6, 1.0, 0.0]]), 5.0, 2.0)[0]


def test_components_need_the_width():
    drivable = np.ones((9, 20), dtype=bool)
    drivable[:, 10] = False
    drivable[4, 10] = True  # a gap one cell wide
    road = road_of(drivable)
    left, right = np.array([4.5, 4.5]), np.array([15.5, 4.5])
    assert FreeSpace(road, 0.0).common_component(left, right) is not None
    assert FreeSpace(road, 0.49).common_component(left, right) is not None
    assert FreeSpace(road, 0.51).common_component(left, right) is None
    assert FreeSpace(road, 0.0).component_at(np.array([10.5, 0.5])) == 0
    assert FreeSpace(road, 0.51).labels.max() == 2


def test_free_space_is_cached_per_radius():
    open_road = road_of(np.ones((9, 20), dtype=bool))
    drivable = np.ones((9, 20), dtype=bool)
    drivable[:, 10] = False
    divided = road_of(drivable)
    assert free_space(open_road, 0.4) is free_space(open_road, 0.4)
    assert [free_space(road, 0.4).labels.max() for road in (open_road, divided)] == [1, 2]
    assert len(free_cells(free_space(open_road, 2.4), 1)) == 5 * 16
    assert len(free_cells(free_space(open_road, 0.4), 1)) == 9 * 20


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), yaw=st.floats(-3.2, 3.2))
def test_repair_finds_the_nearest_pose(seed, yaw):
    rng = np.random.default_rng(seed)
    road = random_road(rng, (30, 30), 0.02, 0.2, (0.0, 0.0))
    pose = np.array([*rng.uniform(-0.5, 6.5, 2), yaw])
    found = nearest_pose_with_room(road, pose, 1.2, 0.6, max_distance=1.5)
    offsets = rng.uniform(-1.5, 1.5, (4000, 2))
    offsets = offsets[np.hypot(*offsets.T) < 1.5]
    play = 0.1 * np.sqrt(2.0)  # the lattice comes so near to every pose
    fitting = footprint_fits(
        road, pose + np.pad(offsets, ((0, 0), (0, 1))), 1.2 + 2.0 * play, 0.6 + 2.0 * play
    )
    nearest = np.hypot(*offsets[fitting].T).min(initial=np.inf)
    if found is None:
        assert nearest > 1.5 - play
        return
    repaired, moved = found
    assert footprint_fits(road, repaired[None], 1.2, 0.6)[0]
    assert repaired[2] == pose[2]
    assert moved == pytest.approx(np.hypot(*(repaired - pose)[:2]))
    assert moved <= nearest + play
