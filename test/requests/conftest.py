# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The synthetic turning case on a T-intersection: what every request here starts from."""

import numpy as np
import pytest
from support.given import answer, Given

from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import build_road
from scenario_gen.types import Encounter, Vehicle
from scenario_gen.types.request import Request


@pytest.fixture(scope="session")
def chain():
    encounter = read_log([bundled("b")]).encounters[0]
    return Given(encounter, segment(encounter, seed=7), build_road("t_intersection", encounter), 7)


@pytest.fixture(scope="session")
def following():
    """Two cars that follow each other, 20 m apart, on a straight road."""
    time = np.arange(201) * 0.1
    position = np.stack(
        [np.stack([start + 8.0 * time, 0.0 * time], axis=-1) for start in (20.0, 0.0)]
    )
    vehicles = (Vehicle("1"), Vehicle("2"))
    flat = np.zeros((2, 201))
    encounter = Encounter.sampled(vehicles, 0.1, position, flat, flat + 8.0, "following")
    return Given(encounter, segment(encounter, seed=7), build_road("straight", encounter), 7)


@pytest.fixture(scope="session")
def plain(chain):
    """What comes of it when nothing is asked."""
    return answer(chain, Request(), count=5)


@pytest.fixture(scope="session")
def crossing():
    """Two cars of 4 x 2 m at 10 m/s on crossing axes, the second 20 m behind the first."""
    time = np.arange(101) * 0.1
    along = 10.0 * time
    position = np.stack(
        [
            np.stack([along - 40.0, 0.0 * time], axis=-1),
            np.stack([0.0 * time, along - 60.0], axis=-1),
        ]
    )
    heading = np.stack([0.0 * time, 0.0 * time + 0.5 * np.pi])
    vehicles = (Vehicle("a", 4.0, 2.0), Vehicle("b", 4.0, 2.0))
    return Encounter.sampled(vehicles, 0.1, position, heading, np.full((2, 101), 10.0), "crossing")
