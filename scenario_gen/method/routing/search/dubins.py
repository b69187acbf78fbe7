# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Dubins curves: the shortest ways between two poses for a car that drives ahead and turns no tighter than a radius.

A curve is a word of three parts (arc or straight, arc), each with its length: (word, a, b, c). Lengths are in one unit, any.

Source: Dubins 1957; the closed forms are those of Shkel & Lumelsky 2001.
"""

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F, kernel, OUT1

LSL, RSR, LSR, RSL, RLR, LRL = 0, 1, 2, 3, 4, 5
TURNS = np.array(  # by word and part: 1 left, -1 right, 0 straight
    [[1.0, 0.0, 1.0], [-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, 1.0]]
)
FULL = 2.0 * np.pi
CLOSED = 1e-9  # [rad] an arc this near to a full circle is none


@kernel(inline=True)
def _turned(angle: float) -> float:
    """The angle [rad] in [0, 2 pi), what is nearly a full circle as 0."""
    rest = angle - FULL * np.floor(angle / FULL)
    return 0.0 if rest > FULL - CLOSED else rest


@kernel(inline=True)
def shortest(  # noqa: PLR0912
    x0: float, y0: float, yaw0: float, x1: float, y1: float, yaw1: float, radius: float
) -> tuple[int, float, float, float]:
    """The shortest curve from pose to pose [any length, rad]: its word and the lengths of its three parts.

    Source: Shkel & Lumelsky 2001, "Classification of the Dubins set".
    """
    dx, dy = (x1 - x0) / radius, (y1 - y0) / radius
    d = np.sqrt(dx * dx + dy * dy)
    direction = np.arctan2(dy, dx) if d > 0.0 else 0.0
    alpha, beta = yaw0 - direction, yaw1 - direction
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    cab = ca * cb + sa * sb
    best, word, t, p, q = np.inf, LSL, 0.0, 0.0, 0.0

    square = 2.0 + d * d - 2.0 * cab + 2.0 * d * (sa - sb)
    across = np.arctan2(cb - ca, d + sa - sb)
    first, middle, last = _turned(across - alpha), np.sqrt(max(square, 0.0)), _turned(beta - across)
    if first + middle + last < best:
        best, word, t, p, q = first + middle + last, LSL, first, middle, last

    square = 2.0 + d * d - 2.0 * cab + 2.0 * d * (sb - sa)
    across = np.arctan2(ca - cb, d - sa + sb)
    first, middle, last = _turned(alpha - across), np.sqrt(max(square, 0.0)), _turned(across - beta)
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
    return word, t * radius, p * radius, q * radius


@kernel(inline=True)
def onward(x: float, y: float, yaw: float, turn: float, length: float, radius: float) -> tuple[float, float, float]:
    """The pose `length` farther on, by an arc (turn 1 left, -1 right) or straight on (0)."""
    if turn == 0.0:
        return x + length * np.cos(yaw), y + length * np.sin(yaw), yaw
    end = yaw + turn * length / radius
    side = turn * radius
    return x + side * (np.sin(end) - np.sin(yaw)), y - side * (np.cos(end) - np.cos(yaw)), end


@kernel(inline=True)
def end_of(x: float, y: float, yaw: float, word: int, a: float, b: float, c: float, radius: float) -> tuple[float, float, float]:
    """The pose at the end of a curve."""
    x, y, yaw = onward(x, y, yaw, TURNS[word, 0], a, radius)
    x, y, yaw = onward(x, y, yaw, TURNS[word, 1], b, radius)
    return onward(x, y, yaw, TURNS[word, 2], c, radius)


@kernel(inline=True)
def piece(a: float, b: float, c: float, start: float, end: float) -> tuple[float, float, float]:
    """The parts of a curve between two of its lengths."""
    first = min(a, end) - min(a, start)
    second = min(max(end - a, 0.0), b) - min(max(start - a, 0.0), b)
    third = min(max(end - a - b, 0.0), c) - min(max(start - a - b, 0.0), c)
    return first, second, third


@kernel(F, F, F, F, F, F, F, OUT1)
def shortest_into(x0: float, y0: float, yaw0: float, x1: float, y1: float, yaw1: float, radius: float, out: Floats) -> None:
    """Write word, three lengths, and the pose (x, y, yaw) that they lead to, into `out` (7,): `shortest` for Python."""
    word, a, b, c = shortest(x0, y0, yaw0, x1, y1, yaw1, radius)
    out[0], out[1], out[2], out[3] = word, a, b, c
    out[4], out[5], out[6] = end_of(x0, y0, yaw0, word, a, b, c, radius)
