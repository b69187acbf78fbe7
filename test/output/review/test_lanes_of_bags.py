# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The lanes of a vector map travel in its bag, so that `evaluate` sees who drives against them."""

from dataclasses import replace

import numpy as np
import pytest
from support.bag_examples import hand_made_run

from scenario_gen.bags.recordings.read import read_recording
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.types.lanes import Lane, LaneNetwork
from scenario_gen.types.scenario import Cause


def run_on(*directions):
    """The run by hand on two lanes side by side, y from -4 m to 0 and to 4 m, each driven east (1) or west (-1)."""
    lanes = []
    for k, direction in enumerate(directions):
        x = np.array([-10.0, 50.0])[::direction]
        low, high = (np.column_stack((x, np.full(2, 4.0 * (k - 1) + y))) for y in (0.0, 4.0))
        lanes.append(
            Lane(str(k), *((high, low) if direction > 0 else (low, high)), speed_limit=8.5)
        )
    run = hand_made_run()
    return replace(run, road=replace(run.road, lanes=LaneNetwork("two lanes", tuple(lanes))))


@pytest.mark.parametrize(("directions", "wrong"), [((1, -1), 0), ((1, 1), 5), ((-1, -1), 5)])
def test_wrong_way_driver_is_seen(tmp_path, directions, wrong):
    run = run_on(*directions)
    bag = write_recording(tmp_path / "bag", run)
    (found,) = evaluate_bag(bag)
    assert len(found.causes.get(Cause.WRONG_WAY, ())) == wrong
    road = read_recording(bag).namespaces[""].road
    assert [lane.id for lane in road.lanes.lanes] == ["0", "1"] and road.lanes.lanes[
        0
    ].speed_limit == 8.5


def test_grid_bag_has_no_lanes(tmp_path):
    bag = write_recording(tmp_path / "bag", hand_made_run())
    assert read_recording(bag).namespaces[""].road.lanes is None
