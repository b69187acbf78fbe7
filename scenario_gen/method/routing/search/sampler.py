# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Random samples: free poses through which a better path is possible."""

from typing import NamedTuple

import numpy as np

from scenario_gen.method.routing.search.dubins import FULL_TURN_RAD, Pose
from scenario_gen.method.routing.search.steering import distance, is_free
from scenario_gen.method.routing.search.sweep import Scene
from scenario_gen.method.routing.search.trees import Records
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import B, F, F2, I1, kernel, named
from scenario_gen.numerics.numba_import import numba

STATE = np.dtype(
    [
        ("active", np.int64),  # the tree to extend next: 0 or 1
        ("iteration", np.int64),
        ("meetings", np.int64),
        ("bound", np.float64),  # a useful path costs less: infinite unless the search is informed
        ("random", np.uint64),  # state of the generator
    ]
)
STATES = numba.types.Array(numba.from_dtype(STATE), 1, "C")
SPREAD_SHARES = np.array([1.0, 0.5, 0.25, 0.125])  # narrow gaps need samples close to the path
MAX_ATTEMPTS_COUNT = 100  # to draw a sample that can help


class Rules(NamedTuple):
    """How the trees grow.

    Attributes:
        cells: (n,) flat indices of the cells to sample from.
        near: (G, 3) poses to sample near; may be empty.
        near_share: share of the samples near them.
        spread: standard deviation of these samples.
        yaw_spread: standard deviation of their headings [rad].
        step: longest new edge.
        gamma: of eq 10.
        zeta: largest near radius of eq 10.
        exponent: 1/d of eq 10.
        greedy: extend both trees as far as possible, without rewiring, until they meet.
        informed: discard what cannot improve the best path.
    """

    cells: Ints
    near: Floats
    near_share: float
    spread: float
    yaw_spread: float
    step: float
    gamma: float
    zeta: float
    exponent: float
    greedy: bool
    informed: bool


RULES = named(Rules, I1, F2, F, F, F, F, F, F, F, B, B)


@kernel(inline=True, forced=True)
def _uniform(state: Records) -> float:
    """Return a number in [0, 1) from SplitMix64 (Steele, Lea & Flood 2014)."""
    state[0].random += np.uint64(0x9E3779B97F4A7C15)
    z = state[0].random
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    value: float = float((z ^ (z >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53
    return value


@kernel(inline=True)
def _bell(state: Records) -> float:
    """Return a number of mean 0 and variance 1: the sum of four uniform numbers, scaled."""
    total = _uniform(state) + _uniform(state) + _uniform(state) + _uniform(state)
    return float((total - 2.0) * np.sqrt(3.0))


@kernel(inline=True)
def _pose_near(rules: Rules, state: Records) -> Pose:
    """Return a random pose near one of the known poses."""
    k = int(_uniform(state) * rules.near.shape[0])
    x, y, yaw = rules.near[k, 0], rules.near[k, 1], rules.near[k, 2]
    share = SPREAD_SHARES[int(_uniform(state) * SPREAD_SHARES.size)]
    ahead = rules.spread * _bell(state)
    left = share * rules.spread * _bell(state)
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = yaw + share * rules.yaw_spread * _bell(state)
    return Pose(x + cos * ahead - sin * left, y + sin * ahead + cos * left, turned)


@kernel(inline=True)
def _pose_in_cells(rules: Rules, columns: int, state: Records) -> Pose:
    """Return a random pose in one of the cells, uniformly."""
    cell = rules.cells[int(_uniform(state) * rules.cells.size)]
    x = cell % columns + _uniform(state)
    y = cell // columns + _uniform(state)
    return Pose(x, y, FULL_TURN_RAD * _uniform(state))


@kernel(inline=True)
def random_pose(start: Pose, goal: Pose, scene: Scene, rules: Rules, state: Records) -> Pose:
    """Return a random free pose through which a path can cost less than the bound.

    Source: the informed set is that of Gammell, Srinivasa & Barfoot 2014.
    """
    pose = goal
    for _ in range(MAX_ATTEMPTS_COUNT):
        if rules.near.shape[0] > 0 and _uniform(state) < rules.near_share:
            pose = _pose_near(rules, state)
        else:
            pose = _pose_in_cells(rules, scene.clearance.shape[1], state)
        shortest = distance(start, pose) + distance(pose, goal)
        if shortest < state[0].bound and is_free(pose, scene):
            break
    return pose
