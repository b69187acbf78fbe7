# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where the trees grow to: random poses of the component, later only where a better path can lie."""

from typing import NamedTuple

from numba import from_dtype, types
import numpy as np
from numpy.typing import NDArray

from scenario_gen.method.routing.search.dubins import POSE, Pose
from scenario_gen.method.routing.search.sweep import Car, pose_is_free, Scene
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import B, F, F2, I1, kernel, named

STATE = np.dtype(
    [
        ("nodes", np.int64, 2),  # of either tree
        ("chunks", np.int64),  # in use
        ("active", np.int64),  # the tree to extend next
        ("iteration", np.int64),
        ("connection", np.int64),  # the node at which the best path joins both trees, or -1
        ("root", np.int64),  # the start's
        ("drawn", np.int64),  # samples drawn ahead
        ("used", np.int64),  # how many of them are used
        ("best", np.float64),  # cost of the trees' best path
        ("bound", np.float64),  # what a path must better to count: infinite unless informed
        ("random", np.uint64),  # the generator's state
    ]
)

States = NDArray[np.void]
STATES = types.Array(from_dtype(STATE), 1, "C")
FINER = np.array(
    [1.0, 0.5, 0.25, 0.125]
)  # shares of the spread: narrow gaps need samples that are near to the path
TRIES = 20  # to draw a sample that serves


class Rules(NamedTuple):
    """How the trees grow.

    Attributes:
        start: the first tree's root.
        goal: the other one's.
        cells: (n,) flat indices of the cells to sample from.
        corners: (c,) those of them that lie before convex corners of obstacles.
        about: (G, 3) poses of a path to sample about; none: everywhere.
        share: of the samples beside corners, or about the path.
        spread: how far from the path.
        yaw_spread: and from its heading [rad].
        step: longest new edge.
        snap: what is left of an edge and shorter than that is no edge of its own.
        gamma: of eq 10.
        zeta: likewise, the largest near radius.
        greedy: extend as far as possible until the first path is found.
        skip: let edges skip ancestors that see the new node.
        informed: leave out what cannot better the path that is known.
    """

    start: Pose
    goal: Pose
    cells: Ints
    corners: Ints
    about: Floats
    share: float
    spread: float
    yaw_spread: float
    step: float
    snap: float
    gamma: float
    zeta: float
    greedy: bool
    skip: bool
    informed: bool


RULES = named(Rules, POSE, POSE, I1, I1, F2, F, F, F, F, F, F, F, B, B, B)


@kernel(inline=True, forced=True)
def uniform(state: States) -> float:
    """A number in [0, 1) from SplitMix64 (Steele, Lea & Flood 2014); advances `state` (1,) of `tree.STATE`."""
    state[0].random += np.uint64(0x9E3779B97F4A7C15)
    z = state[0].random
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    value: float = float((z ^ (z >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53
    return value


@kernel(inline=True)
def _bell(state: States) -> float:
    """A number of mean 0 and variance 1: the sum of four uniform ones."""
    return float(
        (uniform(state) + uniform(state) + uniform(state) + uniform(state) - 2.0)
        * 1.7320508075688772
    )


@kernel(inline=True, forced=True)
def _in_cell(cells: Ints, width: int, state: States) -> tuple[float, float]:
    """A point of one of the cells (flat indices), uniformly."""
    cell = cells[int(uniform(state) * cells.size)]
    return cell % width + uniform(state), cell // width + uniform(state)


@kernel(inline=True, forced=True)
def apart(a: Pose, b: Pose) -> float:
    """The straight distance of two poses."""
    return float(np.sqrt((a.x - b.x) ** 2 + (a.y - b.y) ** 2))


@kernel(inline=True, forced=True)
def detour(start: Pose, goal: Pose, pose: Pose) -> float:
    """The least length of a path from start to goal by way of a pose."""
    return apart(pose, start) + apart(pose, goal)


@kernel(inline=True, forced=True)
def sample_pose(body: Car, scene: Scene, rules: Rules, state: States) -> Pose:
    """A free pose: about a known path, or anywhere that a better path can lie."""
    about, pose = rules.about, rules.goal
    for _ in range(TRIES):
        if about.shape[0] > 0 and uniform(state) < rules.share:
            k = int(uniform(state) * about.shape[0])
            scale = FINER[int(uniform(state) * FINER.size)]
            aside, ahead = scale * rules.spread * _bell(state), rules.spread * _bell(state)
            c, s = np.cos(about[k, 2]), np.sin(about[k, 2])
            x, y = about[k, 0] + c * ahead - s * aside, about[k, 1] + s * ahead + c * aside
            pose = Pose(x, y, about[k, 2] + scale * rules.yaw_spread * _bell(state))
        else:
            x, y = _in_cell(rules.cells, scene.clearance.shape[1], state)
            pose = Pose(x, y, 2.0 * np.pi * uniform(state))
        if detour(rules.start, rules.goal, pose) < state[0].bound and pose_is_free(
            pose, body, scene
        ):
            break
    return pose


@kernel(inline=True, forced=True)
def sample_point(clearance: Floats, rules: Rules, state: States) -> Pose:
    """A point of the component, uniformly; once a path is known, of the ellipse that can better it.

    From then on a share of the samples lies in the cells diagonally before obstacles' convex corners: where shortest paths bend.
    """
    start, goal = rules.start, rules.goal
    bound = state[0].bound
    if (
        rules.corners.size > 0
        and rules.share > 0.0
        and bound < np.inf
        and uniform(state) < rules.share
    ):
        for _ in range(TRIES):
            pose = Pose(*_in_cell(rules.corners, clearance.shape[1], state), 0.0)
            if detour(start, goal, pose) < bound:
                return pose
    height, width = clearance.shape
    dx, dy = goal.x - start.x, goal.y - start.y
    straight = np.sqrt(dx * dx + dy * dy)
    major = 0.5 * bound
    minor = (
        0.5 * np.sqrt(max(bound * bound - straight * straight, 0.0)) if bound < np.inf else np.inf
    )
    small = np.pi * major * minor < rules.cells.size
    pose = goal
    for _ in range(100):
        if small:  # Gammell, Srinivasa & Barfoot 2014: sample the ellipse directly
            angle, r = 2.0 * np.pi * uniform(state), np.sqrt(uniform(state))
            u, v = major * r * np.cos(angle), minor * r * np.sin(angle)
            c, s = (dx / straight, dy / straight) if straight > 0.0 else (1.0, 0.0)
            pose = Pose(
                0.5 * (start.x + goal.x) + c * u - s * v,
                0.5 * (start.y + goal.y) + s * u + c * v,
                0.0,
            )
            i, j = int(np.floor(pose.y)), int(np.floor(pose.x))
            if 0 <= i < height and 0 <= j < width and clearance[i, j] > 0.0:
                break
        else:
            pose = Pose(*_in_cell(rules.cells, width, state), 0.0)
            if detour(start, goal, pose) < bound:
                break
    return pose
