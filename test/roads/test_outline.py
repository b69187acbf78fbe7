# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads from an array of cells and from a polygon."""

import numpy as np
import pytest
from shapely import box, MultiPolygon, Point, Polygon, union

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.roads import build_road, RoadConfig

CROSS = union(box(-30.0, -3.6, 30.0, 3.6), box(-3.6, -20.0, 3.6, 20.0))


def test_polygon_is_drivable_with_open_ends():
    road = build_road(CROSS)
    assert road.origin.tolist() == [-30.0, -20.0] and road.drivable.shape == (200, 300)
    assert road.drivable.sum() * 0.04 == pytest.approx(CROSS.area)
    assert road.drivable_at(np.array([[29.0, 3.0], [3.0, -19.0], [29.0, 10.0]])).tolist() == [
        True,
        True,
        False,
    ]
    assert len(road.entries) == len(road.exits) == 0 and road.lanes is None


def test_array_is_taken_as_it_is():
    cells = np.zeros((40, 300), dtype=bool)
    cells[5:40] = True
    road = build_road(cells, None, RoadConfig(resolution=0.1, obstacles="10 2 0 2 1"))
    assert np.array_equal(road.drivable | road.obstructed, cells)
    assert road.resolution == pytest.approx(0.1)
    assert road.origin.tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (np.ones((3, 3)), "not float64"),
        (np.ones(3, dtype=bool), r"\(3,\)"),
        (np.zeros((3, 3), dtype=bool), "a drivable cell is needed"),
        (Polygon(), "empty"),
        (MultiPolygon(), "empty"),
        (Polygon([(0, 0), (10, 10), (10, 0), (0, 10)]), "make_valid"),
        (Point(0.0, 0.0).buffer(0.01), "no drivable cell"),
        (Point(0.0, 0.0), "array or a polygon"),
    ],
)
def test_what_is_no_road_is_refused(shape, message):
    with pytest.raises(InputError, match=message):
        build_road(shape)


def test_what_fills_the_memory_is_refused():
    with pytest.raises(RefusedError, match=r"road\.max_cells"):
        build_road(box(0.0, 0.0, 1e5, 1e5))
    with pytest.raises(InputError, match="finite"):
        build_road(box(0.0, 0.0, np.inf, 1.0))
