# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Dubins curves: the shortest ways between two poses for a car that drives ahead and turns no tighter than a radius.

A curve is a word of three parts (arc, arc or straight, arc), each with its length. Lengths are in one unit, any.

Source: Dubins 1957; the closed forms are those of Shkel & Lumelsky 2001.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.numerics.kernels import F, kernel, named

LSL, RSR, LSR, RSL, RLR, LRL = 0, 1, 2, 3, 4, 5
TURNS = np.array(  # by word and part: 1 left, -1 right, 0 straight
    [
        [1.0, 0.0, 1.0],
        [-1.0, 0.0, -1.0],
        [1.0, 0.0, -1.0],
        [-1.0, 0.0, 1.0],
        [-1.0, 1.0, -1.0],
        [1.0, -1.0, 1.0],
    ]
)
REVERSED = np.array(
    [RSR, LSL, LSR, RSL, LRL, RLR]
)  # the words driven the other way round, by a car that was turned
FULL = 2.0 * np.pi
CLOSED = 1e-9  # [rad] an arc this near to a full circle is none


class Pose(NamedTuple):
    """A place, and the heading there [rad]."""

    x: float
    y: float
    yaw: float


class Curve(NamedTuple):
    """A word, and the lengths of its three parts."""

    word: int
    a: float
    b: float
    c: float


POSE = named(Pose, F, F, F)


@kernel(inline=True)
def _turned(angle: float) -> float:
    """The angle [rad] in [0, 2 pi), what is nearly a full circle as 0."""
    rest = angle - FULL * np.floor(angle / FULL)
    return 0.0 if rest > FULL - CLOSED else rest


@kernel(inline=True)
def shortest(start: Pose, end: Pose, radius: float) -> Curve:  # noqa: PLR0912
    """The shortest curve from pose to pose.

    Source: Shkel & Lumelsky 2001, "Classification of the Dubins set".
    """
    dx, dy = (end.x - start.x) / radius, (end.y - start.y) / radius
    d = np.sqrt(dx * dx + dy * dy)
    direction = np.arctan2(dy, dx) if d > 0.0 else 0.0
    alpha, beta = start.yaw - direction, end.yaw - direction
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    cab = ca * cb + sa * sb
    best, word, t, p, q = np.inf, LSL, 0.0, 0.0, 0.0

    square = 2.0 + d * d - 2.0 * cab + 2.0 * d * (sa - sb)
    across = np.arctan2(cb - ca, d + sa - sb)
    first, middle, last = (
        _turned(across - alpha),
        np.sqrt(max(square, 0.0)),
        _turned(beta - across),
    )
    if first + middle + last < best:
        best, word, t, p, q = first + middle + last, LSL, first, middle, last

    square = 2.0 + d * d - 2.0 * cab + 2.0 * d * (sb - sa)
    across = np.arctan2(ca - cb, d - sa + sb)
    first, middle, last = (
        _turned(alpha - across),
        np.sqrt(max(square, 0.0)),
        _turned(across - beta),
    )
    if first + middle + last < best:
        best, word, t, p, q = first + middle + last, RSR, first, middle, last

    square = -2.0 + d * d + 2.0 * cab + 2.0 * d * (sa + sb)
    if square >= 0.0:
        middle = np.sqrt(square)
        if middle < best:
            across = np.arctan2(-ca - cb, d + sa + sb) - np.arctan2(-2.0, middle)
            first, last = _turned(across - alpha), _turned(across - beta)
            if first + middle + last < best:
                best, word, t, p, q = first + middle + last, LSR, first, middle, last

    square = -2.0 + d * d + 2.0 * cab - 2.0 * d * (sa + sb)
    if square >= 0.0:
        middle = np.sqrt(square)
        if middle < best:
            across = np.arctan2(ca + cb, d - sa - sb) - np.arctan2(2.0, middle)
            first, last = _turned(alpha - across), _turned(beta - across)
            if first + middle + last < best:
                best, word, t, p, q = first + middle + last, RSL, first, middle, last

    if d < 4.0:  # three arcs reach no farther
        cosine = 0.125 * (6.0 - d * d + 2.0 * cab + 2.0 * d * (sa - sb))
        if abs(cosine) <= 1.0:
            middle = FULL - np.arctan2(np.sqrt(1.0 - cosine * cosine), cosine)
            first = _turned(alpha - np.arctan2(ca - cb, d - sa + sb) + 0.5 * middle)
            last = _turned(alpha - beta - first + middle)
            if first + middle + last < best:
                best, word, t, p, q = first + middle + last, RLR, first, middle, last
        cosine = 0.125 * (6.0 - d * d + 2.0 * cab + 2.0 * d * (sb - sa))
        if abs(cosine) <= 1.0:
            middle = FULL - np.arctan2(np.sqrt(1.0 - cosine * cosine), cosine)
            first = _turned(-alpha + np.arctan2(cb - ca, d + sa - sb) + 0.5 * middle)
            last = _turned(beta - alpha - first + middle)
            if first + middle + last < best:
                best, word, t, p, q = first + middle + last, LRL, first, middle, last
    return Curve(word, t * radius, p * radius, q * radius)


@kernel(inline=True)
def length_of(curve: Curve) -> float:
    """The length of a curve."""
    return curve.a + curve.b + curve.c


@kernel(inline=True)
def part_of(curve: Curve, part: int) -> float:
    """The length of one part."""
    return curve.a if part == 0 else curve.b if part == 1 else curve.c


@kernel(inline=True)
def onward(pose: Pose, turn: float, length: float, radius: float) -> Pose:
    """The pose `length` farther on, by an arc (turn 1 left, -1 right) or straight on (0)."""
    if turn == 0.0:
        return Pose(
            pose.x + length * np.cos(pose.yaw), pose.y + length * np.sin(pose.yaw), pose.yaw
        )
    end = pose.yaw + turn * length / radius
    side = turn * radius
    x, y = (
        pose.x + side * (np.sin(end) - np.sin(pose.yaw)),
        pose.y - side * (np.cos(end) - np.cos(pose.yaw)),
    )
    return Pose(x, y, end)


@kernel(inline=True)
def end_of(pose: Pose, curve: Curve, radius: float) -> Pose:
    """The pose at the end of a curve."""
    pose = onward(pose, TURNS[curve.word, 0], curve.a, radius)
    pose = onward(pose, TURNS[curve.word, 1], curve.b, radius)
    return onward(pose, TURNS[curve.word, 2], curve.c, radius)


@kernel(inline=True)
def piece(curve: Curve, start: float, end: float) -> Curve:
    """The part of a curve between two of its lengths."""
    a, b, c = curve.a, curve.b, curve.c
    first = min(a, end) - min(a, start)
    second = min(max(end - a, 0.0), b) - min(max(start - a, 0.0), b)
    third = min(max(end - a - b, 0.0), c) - min(max(start - a - b, 0.0), c)
    return Curve(curve.word, first, second, third)


@kernel(POSE, POSE, F)
def shortest_curve(start: Pose, end: Pose, radius: float) -> tuple[Curve, Pose]:
    """`shortest` for Python, and the pose that it leads to."""
    curve = shortest(start, end, radius)
    return curve, end_of(start, curve, radius)
