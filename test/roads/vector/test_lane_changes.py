# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""When a recorded drive across two parallel lanes is a lane change."""

from itertools import pairwise

import numpy as np
import pytest
from support.motions import encounter_of

from scenario_gen.roads import lane_graph
from scenario_gen.roads.vector.hypotheses import hypothesis_at
from scenario_gen.roads.vector.match import match
from scenario_gen.situation import clean_tracks, find_conflicts
from scenario_gen.types import Lane, LaneNetwork

WIDTH_M, STEPS, DT = 3.5, 100, 0.1
SAMPLES, GAIN_M2 = 24, 1.5  # of a recorded path; that justifies a change


def lane(name, left_m, neighbours):
    x = np.linspace(-60.0, 260.0, 161)
    left, right = (np.column_stack((x, np.full_like(x, y))) for y in (left_m, left_m - WIDTH_M))
    return Lane(name, left, right, neighbours=neighbours)


def drifting(end_m):
    """One vehicle drifts from y = 0 to `end_m` within 40 m; another one drives far ahead."""
    x = np.linspace(0.0, 100.0, STEPS)
    share = np.clip((x - 30.0) / 40.0, 0.0, 1.0)
    y = end_m * share**2 * (3.0 - 2.0 * share)
    heading = np.arctan(np.gradient(y, x))
    speed = np.hypot(*np.gradient(np.column_stack((x, y)), axis=0).T) / DT
    ahead = np.column_stack((x + 60.0, np.zeros(STEPS)))
    position = np.stack((np.column_stack((x, y)), ahead))
    return encounter_of(position, np.stack((heading, 0.0 * x)), speed)


def gain(encounter):
    """Decrease of the mean squared distance from a lane's centre that the best change brings [m²]."""
    x, y = encounter.position[0].T
    y = np.interp(np.linspace(0.0, 100.0, SAMPLES), x, y)
    here, there = y**2, (y - WIDTH_M) ** 2
    changed = [here[:k].sum() + there[k:].sum() for k in range(SAMPLES + 1)]
    return (min(here.sum(), there.sum()) - min(changed)) / SAMPLES


def lanes_of(encounter, neighbours=True):
    network = LaneNetwork(
        "street",
        (
            lane("right", 0.5 * WIDTH_M, (1,) if neighbours else ()),
            lane("left", 1.5 * WIDTH_M, (0,) if neighbours else ()),
        ),
    )
    tracks = clean_tracks(encounter)
    graph = lane_graph(network)
    home = hypothesis_at(graph, tracks, np.zeros(3))
    found = next(match(graph, tracks, find_conflicts(encounter), home))
    return found.paths[0].lanes


def test_change_must_gain_one_and_half():
    ends = np.arange(1.0, 3.5, 0.02)
    gains = np.array([gain(drifting(end)) for end in ends])
    worth = gains > GAIN_M2
    ((first, second),) = [
        pair for pair in pairwise(ends) if not worth[ends == pair[0]] and worth[ends == pair[1]]
    ]
    assert np.ptp(gains[np.searchsorted(ends, [first, second])]) < 0.1
    assert lanes_of(drifting(first - 0.02)) == (0,)
    assert lanes_of(drifting(second + 0.02)) == (0, 1)


@pytest.mark.parametrize("end", [0.5, 3.5])
def test_only_neighbours_are_changed_to(end):
    assert lanes_of(drifting(end), neighbours=False) == (0,)
    assert lanes_of(drifting(end)) == ((0, 1) if end > 2.0 else (0,))
