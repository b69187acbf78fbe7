# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The synthetic turning case on a T-intersection: what every request here starts from."""

import numpy as np
import pytest
from support.given import answer, Given
from support.reaction_scenes import lane_encounter

from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import build_road
from scenario_gen.types.request import Request


@pytest.fixture(scope="session")
def chain():
    encounter = read_log([bundled("b")]).encounters[0]
    return Given(encounter, segment(encounter, seed=7), build_road("t_intersection", encounter), 7)


@pytest.fixture(scope="session")
def following():
    """Two cars that follow each other, 20 m apart, on a straight road."""
    speed = np.full(201, 8.0)
    encounter = lane_encounter(speed, speed, gap=20.0)
    return Given(encounter, segment(encounter, seed=7), build_road("straight", encounter), 7)


@pytest.fixture(scope="session")
def plain(chain):
    """What comes of it when nothing is asked."""
    return answer(chain, Request(), count=5)
