# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where lanes are too short for a recording, they tell which part of it they hold."""

import numpy as np
import pytest
from support.map_builders import ARM, FORMATS, write
from test_rules import drive, DT

from scenario_gen.roads import windows_on_map
from scenario_gen.types import Encounter, Vehicle

LENGTH_M, SPEED_MPS, BEGIN_M = 4.0, 10.0, -90.0


@pytest.mark.parametrize("suffix", FORMATS)
def test_windows_end_where_lanes_do(tmp_path, suffix):
    steps = np.full(190, SPEED_MPS)
    drives = [drive(arm, steps, BEGIN_M) for arm in "ws"]
    position, heading, speed = (np.stack(part) for part in zip(*drives, strict=True))
    vehicles = (Vehicle("1", LENGTH_M, 1.8), Vehicle("2", LENGTH_M, 1.8))
    encounter = Encounter.sampled(vehicles, DT, position, heading, speed, "long")
    path = write(tmp_path, suffix)
    best = next(windows_on_map(str(path), encounter))
    reach = ARM - LENGTH_M / 2.0 - 1.0
    ends = (np.array([-reach, reach]) - BEGIN_M) / SPEED_MPS
    assert best == pytest.approx(np.tile(ends, (2, 1)), abs=0.15)
    assert not list(windows_on_map("four_way", encounter))
    short = encounter.select((0, 1), 40, 140)
    assert all(np.ptp(each, axis=1).max() < short.duration for each in windows_on_map(path, short))
