# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Proof that every footprint stays in drivable cells at every instant.

Fast: discs that cover the footprint, each nearer to its cell's centre than the clearance there allows, with what the
vehicle moves in the meantime added. Exact: over a stretch of time the footprint lies in a rectangle at its middle pose,
longer and wider by what the control points and the rotation can add; that rectangle is compared with the cells row by row.
Where neither suffices the stretch is halved, until it is proven, the footprint itself is off the road, or it is too short.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.method.validity.dynamics import stretch
from scenario_gen.numerics import Counts, Floats
from scenario_gen.numerics.kernels import F, F1, F2, F4, kernel, N2, named, OUT2
from scenario_gen.roads import blocked_before, clearance_in_cells
from scenario_gen.types import Road

CONTACT = 1e-9  # cells, an overlap this small only touches
PROVEN, FOUND, UNPROVEN = 0.0, 1.0, 2.0


@kernel(inline=True)
def _rectangle_drivable(
    blocked: Counts, x: float, y: float, c: float, s: float, length: float, width: float
) -> bool:
    """Whether the rectangle centred at (x, y), half sizes length and width, all in cells, covers drivable cells only."""
    a, b = length, width
    if c < 0.0:  # half a turn changes nothing
        c, s = -c, -s
    if s < 0.0:  # a quarter turn exchanges length and width
        a, b, c, s = b, a, -s, c
    top, right = (
        a * s + b * c,
        a * c + b * s,
    )  # the highest and the rightmost corner, seen from the centre
    turn = a * s - b * c  # height of the rightmost corner; the leftmost is at -turn
    rows, columns = blocked.shape[0], blocked.shape[1] - 1
    first, last = int(np.floor(y - top + CONTACT)), int(np.ceil(y + top - CONTACT)) - 1
    if first < 0 or last >= rows or x - right < -CONTACT or x + right > columns + CONTACT:
        return False
    for row in range(first, last + 1):
        low, high = (
            max(row - y, -top),
            min(row + 1 - y, top),
        )  # the rectangle's part in this row of cells
        to = from_ = right
        if low > turn:  # above the rightmost corner: the front edge
            to = (a - low * s) / c
        elif high < turn:  # below it: the right-hand edge
            to = (high * c + b) / s
        if low > -turn:  # above the leftmost corner
            from_ = (b - low * c) / s
        elif high < -turn:
            from_ = (a + high * s) / c
        begin = max(int(np.floor(x - min(from_, right) + CONTACT)), 0)
        end = min(int(np.ceil(x + min(to, right) - CONTACT)), columns)
        if end > begin and blocked[row, end] != blocked[row, begin]:
            return False
    return True


@kernel(inline=True)
def _discs_drivable(
    clearance: Floats,
    x: float,
    y: float,
    c: float,
    s: float,
    length: float,
    width: float,
    moved: float,
) -> bool:
    """Whether covering discs prove a footprint that moves by at most `moved` drivable; all in cells."""
    rows, columns = clearance.shape
    count = max(1, int(np.ceil(1.5 * length / width)))
    spacing = 2.0 * length / count
    radius = np.sqrt(0.25 * spacing * spacing + width * width) + moved
    for i in range(count):
        ahead = (i + 0.5) * spacing - length
        px, py = x + ahead * c, y + ahead * s
        column, row = int(np.floor(px)), int(np.floor(py))
        if row < 0 or column < 0 or row >= rows or column >= columns:
            return False
        dx, dy, spare = px - column - 0.5, py - row - 0.5, clearance[row, column] - radius
        if spare < 0.0 or spare * spare < dx * dx + dy * dy:
            return False
    return True


@kernel(inline=True)
def _first_exit(
    b: Floats,
    h: float,
    yaw: Floats,
    half: Floats,
    clearance: Floats,
    blocked: Counts,
    resolution: float,
) -> tuple[float, float]:
    """(status, u) of one interval: control points b (4, 2), start and change of heading (2,), half sizes, in cells."""
    length, width = half
    part = np.empty((4, 2))
    u, step = 0.0, 1.0
    while u < 1.0:
        middle = u + 0.5 * step
        stretch(b, middle, middle, part)
        x, y, at, turn = part[0, 0], part[0, 1], yaw[0] + yaw[1] * middle, 0.5 * step * abs(yaw[1])
        stretch(b, u, u + step, part)
        c, s = np.cos(at), np.sin(at)
        ahead = aside = 0.0
        for i in range(4):
            dx, dy = part[i, 0] - x, part[i, 1] - y
            ahead, aside = max(ahead, abs(c * dx + s * dy)), max(aside, abs(c * dy - s * dx))
        if _discs_drivable(
            clearance,
            x,
            y,
            c,
            s,
            length,
            width,
            np.sqrt(ahead * ahead + aside * aside) + length * turn,
        ) or _rectangle_drivable(
            blocked, x, y, c, s, length + ahead + width * turn, width + aside + length * turn
        ):
            u += step
            step = min(2.0 * step, 1.0 - u)
            continue
        if not _rectangle_drivable(blocked, x, y, c, s, length, width):
            return FOUND, middle
        step *= 0.5
        if step * h < resolution:
            return UNPROVEN, middle
    return PROVEN, 1.0


class Ground(NamedTuple):
    """A road as `first_exits` reads it.

    Attributes:
        clearance: (H, W) distance [cells] from each centre to the nearest cell that is not drivable.
        blocked: (H, W + 1) from `blocked_before`.
        x: of the grid's lower-left corner, metres.
        y: likewise.
        size: of a cell, metres.
    """

    clearance: Floats
    blocked: Counts
    x: float
    y: float
    size: float

    @classmethod
    def of(cls, road: Road) -> "Ground":
        """Read a road."""
        return cls(
            clearance_in_cells(road),
            blocked_before(road),
            road.origin[0],
            road.origin[1],
            road.resolution,
        )


@kernel(F1, F4, F2, F2, named(Ground, F2, N2, F, F, F), F, OUT2)
def first_exits(
    time: Floats,
    control: Floats,
    heading: Floats,
    half: Floats,
    ground: Ground,
    resolution: float,
    out: Floats,
) -> None:
    """Fill `out` (N, 2) with status and time [s] at which each vehicle first leaves drivable cells.

    Args:
        time: (T,) seconds.
        control: (N, T - 1, 4, 2) control points, metres.
        heading: (N, T) rad.
        half: (N, 2) half lengths and half widths, metres.
        ground: the road.
        resolution: shortest stretch of time [s] looked at.
        out: status PROVEN, FOUND or UNPROVEN, and the time where not proven.
    """
    size = ground.size
    b, yaw, extent = np.empty((4, 2)), np.empty(2), np.empty(2)
    for i in range(control.shape[0]):
        out[i, 0] = PROVEN
        extent[0], extent[1] = half[i, 0] / size, half[i, 1] / size
        for k in range(control.shape[1]):
            stands = k > 0 and heading[i, k + 1] == heading[i, k]
            for c in range(4):
                b[c, 0], b[c, 1] = (
                    (control[i, k, c, 0] - ground.x) / size,
                    (control[i, k, c, 1] - ground.y) / size,
                )
                stands = stands and b[c, 0] == b[0, 0] and b[c, 1] == b[0, 1]
            if stands:  # where it stood at the end of the interval before
                continue
            h = time[k + 1] - time[k]
            yaw[0], yaw[1] = heading[i, k], heading[i, k + 1] - heading[i, k]
            status, u = _first_exit(
                b, h, yaw, extent, ground.clearance, ground.blocked, resolution
            )
            if status != PROVEN:
                out[i, 0], out[i, 1] = status, time[k] + u * h
                break
