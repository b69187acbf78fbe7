# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The example drives among the vehicles of the node `traffic`, and stops for what is in its way."""

import importlib.util
import math
from pathlib import Path
import sys

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "ego_consumer.py"
ROUTE = np.column_stack([np.arange(0.0, 60.0, 0.5), np.zeros(120), np.zeros(120)])


@pytest.fixture(scope="module")
def example():
    import scenario_gen.ros.nodes  # noqa: F401  (what the wheels need)

    specification = importlib.util.spec_from_file_location("ego_consumer", EXAMPLE)
    module = importlib.util.module_from_spec(specification)
    sys.modules["ego_consumer"] = module
    specification.loader.exec_module(module)
    return module


def grid_with_car(x):
    """Cells of 0.5 m from (-10, -10), with a car across the route at x."""
    cells = np.zeros((40, 120), dtype=np.int8)
    cells[16:24, int((x + 10.0) * 2) : int((x + 12.0) * 2)] = 100
    return cells, np.array([-10.0, -10.0]), 0.5


def test_planner_stops_and_steers_back(example):
    assert example.free_way(*grid_with_car(30.0), ROUTE, 0) == pytest.approx(30.0, abs=0.5)
    assert example.free_way(*grid_with_car(45.0), ROUTE[:20], 0) == math.inf
    x, speed = 0.0, 8.0
    for _ in range(200):
        wanted, _ = example.decide(np.array([x, 0.0, 0.0]), speed, ROUTE, grid_with_car(30.0), 8.0)
        speed = min(max(wanted, speed - 0.9), speed + 0.4)
        x += 0.1 * speed
    assert speed < 0.1 and 20.0 < x + example.FRONT < 30.0
    _, right = example.decide(np.array([10.0, 1.0, 0.0]), 5.0, ROUTE, None, 8.0)
    _, left = example.decide(np.array([10.0, -1.0, 0.0]), 5.0, ROUTE, None, 8.0)
    assert right < 0.0 < left
