# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The arms of a road: where lanes in and lanes out lie side by side, and the line between them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from scenario_gen.numerics import Floats, frozen
from scenario_gen.numerics.plane import angle_between, unit, unit_left
from scenario_gen.roads.ways import relative, reverse
from scenario_gen.types import Road

_PARALLEL = np.radians(3.0)
_LEVEL = 0.5  # metres along the arm by which the ends of its lanes may differ
_LARGEST_ISLAND = 60.0  # metres
RING_ROOM = 0.5  # metres that a roundabout's lane is wider on each side
_WIDEST = 40.0  # metres sideways


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm of a road.

    Attributes:
        pose: (3,) the end of its dividing line, heading out of the road.
        inward: (E,) offsets [m, left of `pose` positive] of the lanes in.
        outward: (X,) offsets of the lanes out.
    """

    pose: Floats
    inward: Floats
    outward: Floats


def arms_of(road: Road) -> tuple[Arm, ...]:
    """The arms of a road that have lanes both ways, in the order of the exits."""
    arms: list[Arm] = []
    taken: set[int] = set()
    for x, leave in enumerate(road.exits):
        if x in taken:
            continue
        outs = [k for k, other in enumerate(road.exits) if k not in taken and _beside(leave, other)]
        taken.update(outs)
        ins = [k for k, other in enumerate(road.entries) if _beside(leave, reverse(other))]
        if not ins:
            continue
        out_offset = np.array([relative(leave, road.exits[k, :2])[1] for k in outs])
        in_offset = np.array([relative(leave, road.entries[k, :2])[1] for k in ins])
        gap = np.abs(in_offset[:, None] - out_offset[None])
        i, o = np.unravel_index(int(np.argmin(gap)), gap.shape)
        middle = float(in_offset[i] + out_offset[o]) / 2.0
        pose = leave + middle * np.array([*unit_left(leave[2]), 0.0])
        arms.append(Arm(frozen(pose), frozen(np.sort(in_offset - middle)), frozen(np.sort(out_offset - middle))))
    return tuple(arms)


def unused_arms(road: Road, used: Iterable[Floats]) -> list[Arm]:
    """The arms by which none of the given poses (3,) [m, m, rad] comes or goes; none on a road of two arms."""
    arms = arms_of(road)
    poses = list(used)
    if len(arms) < 3:
        return []
    return [arm for arm in arms if not any(_beside(arm.pose, way) for pose in poses for way in (pose, reverse(pose)))]


def ring_of(road: Road) -> tuple[Floats, float] | None:
    """Centre (2,) [m] of a roundabout and the radius [m] of its lane: three arms or more that point to an island's middle."""
    arms = arms_of(road)
    if len(arms) < 3:
        return None
    poses = np.stack([arm.pose for arm in arms])
    normal = unit_left(poses[:, 2])
    reach = (normal * poses[:, :2]).sum(axis=1)
    centre = np.linalg.lstsq(normal, reach, rcond=None)[0]
    if np.abs((normal * centre).sum(axis=1) - reach).max() > _LEVEL or road.drivable_at(centre[None])[0]:
        return None
    out = np.arange(0.0, _LARGEST_ISLAND, road.resolution / 2.0)
    islands = []
    for along in unit(poses[:, 2]):
        free = road.drivable_at(centre + out[:, None] * along)
        islands.append(float(out[np.argmax(free)]) if free.any() else 0.0)
    width = 2.0 * min(float(np.abs(offsets).min()) for arm in arms for offsets in (arm.inward, arm.outward))
    if max(islands) - min(islands) > 1.0 or min(islands) < 2.0:
        return None
    return frozen(centre), float(np.median(islands)) + width / 2.0 + RING_ROOM


def _beside(pose: Floats, other: Floats) -> bool:
    ahead, left = relative(pose, other[:2])
    return abs(angle_between(other[2], pose[2])) < _PARALLEL and abs(ahead) < _LEVEL and abs(left) < _WIDEST
