# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Dubins curves: the shortest forward paths between two poses with a bounded turning radius.

A curve is a word of three parts (arc, arc or straight line, arc) and their lengths, in any unit.

Source: Dubins 1957; the closed forms are those of Shkel & Lumelsky 2001.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from scenario_gen.numerics import Floats, unit
from scenario_gen.numerics.kernels import F, kernel, named

# Words that start to the left; the next number is the mirror image.
LSL_CODE, LSR_CODE, LRL_CODE = 0, 2, 4
TURNS = np.array(  # of each part of each word: 1 left, -1 right, 0 straight
    [
        [1.0, 0.0, 1.0],  # LSL
        [-1.0, 0.0, -1.0],  # RSR
        [1.0, 0.0, -1.0],  # LSR
        [-1.0, 0.0, 1.0],  # RSL
        [1.0, -1.0, 1.0],  # LRL
        [-1.0, 1.0, -1.0],  # RLR
    ]
)
FULL_TURN_RAD = 2.0 * np.pi
CLOSED_RAD = 1e-8  # an arc this close to a full circle has no length
MIN_LINE_RATIO = 1e-7  # to the radius: the direction of a shorter line is only rounding


class Pose(NamedTuple):
    """A position and a heading [rad]."""

    x: float
    y: float
    yaw: float


class Curve(NamedTuple):
    """A word and the lengths of its three parts."""

    word: int
    first: float
    second: float
    third: float


class _Geometry(NamedTuple):
    """A query in normal form: two poses on the x axis at distance `d` [radii]."""

    d: float
    alpha: float
    beta: float
    sin_a: float
    cos_a: float
    sin_b: float
    cos_b: float


POSE = named(Pose, F, F, F)


@kernel(inline=True)
def _positive(angle: float) -> float:
    """Wrap an angle [rad] to [0, 2 pi); a nearly full circle is 0."""
    wrapped = angle - FULL_TURN_RAD * np.floor(angle / FULL_TURN_RAD)
    return 0.0 if wrapped > FULL_TURN_RAD - CLOSED_RAD else wrapped


@kernel(inline=True)
def length_of(curve: Curve) -> float:
    """Return the length of a curve."""
    return curve.first + curve.second + curve.third


@kernel(inline=True)
def part_of(curve: Curve, part: int) -> float:
    """Return the length of part 0, 1 or 2."""
    if part == 0:
        return curve.first
    return curve.second if part == 1 else curve.third


@kernel(inline=True)
def _shorter(a: Curve, b: Curve) -> Curve:
    return b if length_of(b) < length_of(a) else a


@kernel(inline=True)
def _lsl(g: _Geometry) -> Curve:
    """Left, straight, left; Shkel & Lumelsky eq. (5)."""
    cos_ab = g.cos_a * g.cos_b + g.sin_a * g.sin_b
    square = 2.0 + g.d * g.d - 2.0 * cos_ab + 2.0 * g.d * (g.sin_a - g.sin_b)
    straight = np.sqrt(max(square, 0.0))
    if straight < MIN_LINE_RATIO:
        return Curve(LSL_CODE, _positive(g.beta - g.alpha), straight, 0.0)
    angle = np.arctan2(g.cos_b - g.cos_a, g.d + g.sin_a - g.sin_b)
    return Curve(LSL_CODE, _positive(angle - g.alpha), straight, _positive(g.beta - angle))


@kernel(inline=True)
def _lsr(g: _Geometry) -> Curve:
    """Left, straight, right; Shkel & Lumelsky eq. (8). Infinitely long where there is none."""
    cos_ab = g.cos_a * g.cos_b + g.sin_a * g.sin_b
    square = -2.0 + g.d * g.d + 2.0 * cos_ab + 2.0 * g.d * (g.sin_a + g.sin_b)
    if square < 0.0:
        return Curve(LSR_CODE, np.inf, 0.0, 0.0)
    straight = np.sqrt(square)
    angle = np.arctan2(-g.cos_a - g.cos_b, g.d + g.sin_a + g.sin_b)
    angle -= np.arctan2(-2.0, straight)
    return Curve(LSR_CODE, _positive(angle - g.alpha), straight, _positive(angle - g.beta))


@kernel(inline=True)
def _lrl(g: _Geometry) -> Curve:
    """Left, right, left; Shkel & Lumelsky eq. (11). Infinitely long where there is none."""
    cos_ab = g.cos_a * g.cos_b + g.sin_a * g.sin_b
    cosine = 0.125 * (6.0 - g.d * g.d + 2.0 * cos_ab + 2.0 * g.d * (g.sin_b - g.sin_a))
    if abs(cosine) > 1.0:
        return Curve(LRL_CODE, np.inf, 0.0, 0.0)
    middle = FULL_TURN_RAD - np.arctan2(np.sqrt(1.0 - cosine * cosine), cosine)
    angle = np.arctan2(g.cos_b - g.cos_a, g.d + g.sin_a - g.sin_b)
    first = _positive(angle - g.alpha + 0.5 * middle)
    return Curve(LRL_CODE, first, middle, _positive(g.beta - g.alpha - first + middle))


@kernel(inline=True)
def _shortest_from_left(g: _Geometry) -> Curve:
    """Return the shortest curve of the words that start with a left turn."""
    best = _shorter(_lsl(g), _lsr(g))
    return _shorter(best, _lrl(g)) if g.d < 4.0 else best  # three arcs reach no farther


@kernel(inline=True)
def shortest(start: Pose, end: Pose, radius: float) -> Curve:
    """Return the shortest curve from pose to pose.

    Source: Shkel & Lumelsky 2001, "Classification of the Dubins set".
    """
    dx = (end.x - start.x) / radius
    dy = (end.y - start.y) / radius
    direction = np.arctan2(dy, dx)
    alpha = start.yaw - direction
    beta = end.yaw - direction
    sin_a, cos_a = np.sin(alpha), np.cos(alpha)
    sin_b, cos_b = np.sin(beta), np.cos(beta)
    d = np.sqrt(dx * dx + dy * dy)
    left = _shortest_from_left(_Geometry(d, alpha, beta, sin_a, cos_a, sin_b, cos_b))
    mirrored = _shortest_from_left(_Geometry(d, -alpha, -beta, -sin_a, cos_a, -sin_b, cos_b))
    right = Curve(mirrored.word + 1, mirrored.first, mirrored.second, mirrored.third)
    best = _shorter(left, right)
    return Curve(best.word, best.first * radius, best.second * radius, best.third * radius)


@kernel(inline=True)
def advance(pose: Pose, turn: float, length: float, radius: float) -> Pose:
    """Return the pose at the end of an arc (turn 1 left, -1 right) or a straight line (0)."""
    if turn == 0.0:
        x = pose.x + length * np.cos(pose.yaw)
        y = pose.y + length * np.sin(pose.yaw)
        return Pose(x, y, pose.yaw)
    yaw = pose.yaw + turn * length / radius
    x = pose.x + turn * radius * (np.sin(yaw) - np.sin(pose.yaw))
    y = pose.y - turn * radius * (np.cos(yaw) - np.cos(pose.yaw))
    return Pose(x, y, yaw)


@kernel(inline=True)
def pose_along(pose: Pose, curve: Curve, distance: float, radius: float) -> Pose:
    """Return the pose at a distance from the start of a curve."""
    for part in range(3):
        length = min(part_of(curve, part), distance)
        pose = advance(pose, TURNS[curve.word, part], length, radius)
        distance -= length
    return pose


@kernel(POSE, POSE, F, on_demand=True)
def shortest_curve(start: Pose, end: Pose, radius: float) -> Curve:
    """Return the curve of `shortest`."""
    return shortest(start, end, radius)


def dubins_poses(start: Floats, end: Floats, radius: float, spacing: float) -> Floats:
    """Return poses (P, 3) along the shortest curve between poses (3,), at most `spacing` apart."""
    word, *lengths = shortest_curve(Pose(*start), Pose(*end), radius)
    return arc_poses(start, zip(TURNS[word] / radius, lengths, strict=True), spacing)


def arc_poses(start: Floats, parts: Iterable[tuple[float, float]], spacing: float) -> Floats:
    """Return poses (P, 3) from a pose (3,) along parts of constant curvature [1/m], length [m]."""
    poses = [np.asarray(start, dtype=np.float64)[None]]
    for curvature, length in parts:
        if length < 1e-6:
            continue
        x, y, yaw = poses[-1][-1]
        s = np.linspace(0.0, length, int(np.ceil(length / spacing)) + 1)[1:]
        half_turn = 0.5 * curvature * s
        chord = s * np.sinc(half_turn / np.pi)
        points = np.array([x, y]) + chord[:, None] * unit(yaw + half_turn)
        poses.append(np.column_stack((points, yaw + 2.0 * half_turn)))
    return np.concatenate(poses)
