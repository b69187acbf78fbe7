# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Obstacles: text, cells by shapely, the way there and back in a map's message, and what is refused by name."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from shapely import affinity
from shapely.geometry import box, LineString, Point, Polygon
from support import map_builders

from msg_conventions.roads import decode_map, encode_description, encode_map
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import updated
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.roads.obstacles import read_obstacles, with_obstacles
from scenario_gen.types import Obstacle


def test_text():
    assert read_obstacles(" 1 2 0.5 4 2 ; 3,4,0,1,1;") == (
        Obstacle(1, 2, 0.5, 4, 2),
        Obstacle(3, 4, 0, 1, 1),
    )
    assert read_obstacles("") == ()


@pytest.mark.parametrize(
    "text",
    [
        "1 2 3 4",
        "1 2 3 4 x",
        "1 2 3 4 inf",
        "1 2 3 0 1",
        "1 2 3 4 -1",
        "1 2 0 1 2; nonsense",
        "1 2 0 1e9 2",
    ],
)
def test_bad_text_is_refused_by_name(text):
    with pytest.raises(InputError, match="obstacles: '"):
        RoadConfig(obstacles=text)


@settings(max_examples=30)
@given(
    x=st.floats(0, 20), y=st.floats(0, 10), yaw=st.floats(-7, 7), length=st.floats(0.3, 8), width=st.floats(0.3, 3)
)  # fmt: skip
def test_cells_that_overlap_are_closed(x, y, yaw, length, width):
    road = build_road(
        "straight", config=RoadConfig(resolution=0.5, arm_length=10.0, lane_width=5.0)
    )
    there = Obstacle(x + road.origin[0], y + road.origin[1] + 1.0, yaw, length, width)
    made = with_obstacles(road, (there,)) if _area(road, there).max() > 0.0 else road
    area = _area(road, there)
    assert not made.drivable[area > 1e-6].any()
    np.testing.assert_array_equal(made.drivable[area == 0.0], road.drivable[area == 0.0])
    np.testing.assert_array_equal(made.cleared.drivable, road.drivable)


def _area(road, obstacle):
    """The overlap of each drivable cell with the rectangle [m²]."""
    half = (obstacle.length / 2, obstacle.width / 2)
    shape = affinity.rotate(
        box(-half[0], -half[1], *half), obstacle.yaw, origin=(0, 0), use_radians=True
    )
    shape = affinity.translate(shape, obstacle.x, obstacle.y)
    area = np.zeros(road.drivable.shape)
    for i, j in np.argwhere(road.drivable):
        low = road.origin + np.array([j, i]) * road.resolution
        area[i, j] = shape.intersection(box(*low, *(low + road.resolution))).area
    return area


def test_a_map_carries_them():
    plain = build_road("straight")
    road = build_road("straight", config=RoadConfig(obstacles="20 3 0.1 4 2"))
    assert 8.0 < (plain.drivable & ~road.drivable).sum() * 0.04 < 12.0
    _, again = decode_map(encode_map(road, 0))
    np.testing.assert_array_equal(again.drivable, road.drivable)
    np.testing.assert_array_equal(again.cleared.drivable, plain.drivable)
    assert decode_map(encode_map(plain, 0))[1].obstructed is None
    grid = encode_map(road, 0)
    _, again = decode_map(grid, encode_description(road, grid, 0))
    assert again.obstacles == (Obstacle(20, 3, 0.1, 4, 2),)
    assert [lane.id for lane in again.lanes.lanes] == [lane.id for lane in road.lanes.lanes]


def test_one_that_stands_nowhere_is_refused():
    with pytest.raises(
        InputError, match=r"obstacle `900 0 0 4 2` is not on drivable ground of road 'straight'"
    ):
        build_road("straight", config=RoadConfig(obstacles="900 0 0 4 2"))
    with pytest.raises(InputError, match="leave no drivable cell"):
        build_road("straight", config=RoadConfig(obstacles="0 0 0 900 900"))


@pytest.mark.parametrize("kind", ["straight", "map"])
def test_cars_are_parked_along_lane_edges(tmp_path, kind):
    values = {"parked.count": 3, "parked.begin": 4.0, "parked.gap": 0.5, "parked.width": 1.6}
    name = "straight" if kind == "straight" else map_builders.write(tmp_path, ".xml")
    plain = build_road(name)
    lane = max(plain.lanes.lanes, key=lambda lane: len(lane.centre))
    for side in ("right", "left"):
        config = updated(
            RoadConfig(), values | {"parked.lanes": f" {lane.id},", "parked.side": side}
        )
        road = build_road(name, config=config)
        cars = np.array(road.obstacles)
        edge = LineString(getattr(lane, side))
        assert len(cars) == 3
        assert [edge.project(Point(car[:2])) for car in cars] == pytest.approx(
            [6.25, 11.25, 16.25]
        )
        assert [edge.distance(Point(car[:2])) for car in cars] == pytest.approx(
            [0.8] * 3, abs=0.01
        )
        assert Polygon(lane.outline).buffer(0.01).covers(Polygon(road.obstacles[0].outline))
        np.testing.assert_array_equal(road.cleared.drivable, plain.drivable)
    with pytest.raises(InputError, match=r"road\.parked\.lanes: .* no lane 'nowhere'; it has"):
        build_road(name, config=updated(RoadConfig(), {"parked.lanes": "nowhere"}))
