# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Proof that every footprint stays in drivable cells at every instant.

The quick proof covers the footprint with discs; each disc must be nearer to the centre of its cell
than the clearance there, after the motion of the vehicle was added. The exact proof encloses the
footprint over an interval in a rectangle at its middle pose, longer and wider by the effect of the
control points and the rotation, and compares that rectangle with the cells row by row. Where
neither suffices, the interval is halved until it is proven, the footprint is off the road, or the
interval is too short.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from scenario_gen.method.validity.cubic import Proof, split_cubic
from scenario_gen.method.validity.dynamics import vehicle_groups
from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import F, F1, F2, F4, kernel, named, OUT2
from scenario_gen.numerics.polygons import is_row_open
from scenario_gen.types import Cause, Road, Scenario, Vehicle, Violation

_CONTACT_CELLS = 1e-9  # a smaller overlap is a mere contact


class Ground(NamedTuple):
    """The drivable cells of a road.

    Attributes:
        clearance: (H, W) distance [cells] from each centre to the nearest cell that is blocked.
        x, y: lower-left corner of the grid [m].
        size: of a cell [m].
    """

    clearance: Floats
    x: float
    y: float
    size: float

    @classmethod
    def of(cls, road: Road) -> "Ground":
        """Return the cells of a road."""
        x, y = road.origin
        return cls(road.clearance_cells, x, y, road.resolution)


class _Rectangle(NamedTuple):
    """A rectangle in units of cells: centre, direction, half length and half width."""

    x: float
    y: float
    cos: float
    sin: float
    length: float
    width: float


@kernel(inline=True)
def _is_drivable(clearance: Floats, box: _Rectangle) -> bool:
    """Whether a rectangle covers drivable cells only."""
    a, b, c, s = box.length, box.width, box.cos, box.sin
    if c < 0.0:  # half a turn gives the same rectangle
        c, s = -c, -s
    if s < 0.0:  # a quarter turn exchanges length and width
        a, b = b, a
        c, s = -s, c
    top = a * s + b * c  # of the highest corner, relative to the centre
    right = a * c + b * s  # of the rightmost corner
    rows, columns = clearance.shape
    first = int(np.floor(box.y - top + _CONTACT_CELLS))
    last = int(np.ceil(box.y + top - _CONTACT_CELLS)) - 1
    if first < 0 or last >= rows:
        return False
    if box.x - right < -_CONTACT_CELLS or box.x + right > columns + _CONTACT_CELLS:
        return False
    for row in range(first, last + 1):
        low, high = max(row - box.y, -top), min(row + 1 - box.y, top)
        left_end, right_end = _row_ends(a, b, c, s, low, high)
        begin = max(int(np.floor(box.x - left_end + _CONTACT_CELLS)), 0)
        end = min(int(np.ceil(box.x + right_end - _CONTACT_CELLS)), columns)
        if not is_row_open(clearance, row, begin, end):
            return False
    return True


@kernel(inline=True)
def _row_ends(
    a: float, b: float, c: float, s: float, low: float, high: float
) -> tuple[float, float]:
    """How far a rectangle reaches to the left and right between two heights above its centre.

    Args:
        a: half size along the direction.
        b: half size across it.
        c: cosine of the direction, not negative.
        s: its sine, not negative.
        low: the lower height.
        high: the upper height.
    """
    right = a * c + b * s
    corner = a * s - b * c  # height of the rightmost corner; that of the leftmost one is negative
    left_end = right_end = right
    if low > corner:  # the front edge
        right_end = (a - low * s) / c
    elif high < corner:  # the right-hand edge
        right_end = (high * c + b) / s
    if low > -corner:  # the left-hand edge
        left_end = (b - low * c) / s
    elif high < -corner:  # the rear edge
        left_end = (a + high * s) / c
    return min(left_end, right), min(right_end, right)


@kernel(inline=True)
def _discs_are_drivable(clearance: Floats, box: _Rectangle, moved: float) -> bool:
    """Whether discs that cover a footprint, which moves by at most `moved` cells, are drivable."""
    rows, columns = clearance.shape
    count = max(1, int(np.ceil(1.5 * box.length / box.width)))
    spacing = 2.0 * box.length / count
    radius = np.sqrt(0.25 * spacing * spacing + box.width * box.width) + moved
    for i in range(count):
        ahead = (i + 0.5) * spacing - box.length
        x, y = box.x + ahead * box.cos, box.y + ahead * box.sin
        column, row = int(np.floor(x)), int(np.floor(y))
        if row < 0 or column < 0 or row >= rows or column >= columns:
            return False
        dx, dy = x - column - 0.5, y - row - 0.5
        spare = clearance[row, column] - radius
        if spare < 0.0 or spare * spare < dx * dx + dy * dy:
            return False
    return True


@kernel(inline=True)
def _first_exit(
    b: Floats, h: float, yaw: Floats, half: Floats, ground: Ground, resolution: float
) -> tuple[int, float]:
    """Outcome, and fraction of the interval where it is not proven.

    Args:
        b: (4, 2) control points [cells].
        h: duration [s].
        yaw: (2,) heading at the start and its change [rad].
        half: (2,) half length and half width [cells].
        ground: the cells.
        resolution: shortest interval [s] of a proof.
    """
    length, width = half
    part = np.empty((4, 2))
    u, step = 0.0, 1.0
    while u < 1.0:
        middle = u + 0.5 * step
        split_cubic(b, middle, middle, part)
        angle = yaw[0] + yaw[1] * middle
        box = _Rectangle(part[0, 0], part[0, 1], np.cos(angle), np.sin(angle), length, width)
        split_cubic(b, u, u + step, part)
        ahead = left = 0.0
        for i in range(4):
            dx, dy = part[i, 0] - box.x, part[i, 1] - box.y
            ahead = max(ahead, abs(box.cos * dx + box.sin * dy))
            left = max(left, abs(box.cos * dy - box.sin * dx))
        turn = 0.5 * step * abs(yaw[1])
        moved = np.sqrt(ahead * ahead + left * left) + length * turn
        swept = _Rectangle(
            box.x,
            box.y,
            box.cos,
            box.sin,
            length + ahead + width * turn,
            width + left + length * turn,
        )
        if _discs_are_drivable(ground.clearance, box, moved) or _is_drivable(
            ground.clearance, swept
        ):
            u += step
            step = min(2.0 * step, 1.0 - u)
            continue
        if not _is_drivable(ground.clearance, box):
            return Proof.VIOLATED.value, middle
        step *= 0.5
        if step * h < resolution:
            return Proof.UNPROVEN.value, middle
    return Proof.PROVEN.value, 1.0


@kernel(F1, F4, F2, F2, named(Ground, F2, F, F, F), F, OUT2)
def first_exits(
    time: Floats,
    control: Floats,
    heading: Floats,
    half: Floats,
    ground: Ground,
    resolution: float,
    out: Floats,
) -> None:
    """Find when each vehicle first leaves drivable cells.

    Args:
        time: (T,) seconds.
        control: (N, T - 1, 4, 2) control points [m].
        heading: (N, T) rad.
        half: (N, 2) half lengths and half widths [m].
        ground: the road.
        resolution: shortest interval [s] of a proof.
        out: (N, 2) filled with the outcome (`Proof`) and, where it is not proven, the time [s].
    """
    b, yaw, extent = np.empty((4, 2)), np.empty(2), np.empty(2)
    for i in range(control.shape[0]):
        out[i, 0] = Proof.PROVEN.value
        extent[0], extent[1] = half[i, 0] / ground.size, half[i, 1] / ground.size
        for k in range(control.shape[1]):
            yaw[0], yaw[1] = heading[i, k], heading[i, k + 1] - heading[i, k]
            moves = yaw[1] != 0.0
            for c in range(4):
                b[c, 0] = (control[i, k, c, 0] - ground.x) / ground.size
                b[c, 1] = (control[i, k, c, 1] - ground.y) / ground.size
                moves = moves or b[c, 0] != b[0, 0] or b[c, 1] != b[0, 1]
            if k > 0 and not moves:  # it stands where the interval before ended
                continue
            h = time[k + 1] - time[k]
            status, u = _first_exit(b, h, yaw, extent, ground, resolution)
            if status != Proof.PROVEN.value:
                out[i, 0], out[i, 1] = status, time[k] + u * h
                break


def exit_violations(
    scenario: Scenario,
    control: Floats,
    half: Floats,
    ground_of: Callable[[Vehicle], Ground],
    resolution: float,
) -> Iterator[Violation]:
    """Yield the vehicles that are not proven to stay on the road.

    Args:
        scenario: the vehicles.
        control: (N, T - 1, 4, 2) control points [m].
        half: (N, 2) half lengths and half widths [m].
        ground_of: returns the cells in which a vehicle may drive or walk.
        resolution: shortest interval [s] of a proof.
    """
    out = np.full((len(half), 2), np.nan)  # NaN is no proof
    for rows, span in vehicle_groups(scenario):
        first_exits(
            scenario.time[span],
            control[rows, span.start : span.stop - 1],
            scenario.heading[rows, span],
            half[rows],
            ground_of(scenario.vehicles[rows.start]),
            resolution,
            out[rows],
        )
    for i, (status, time) in enumerate(out.tolist()):
        if status == Proof.PROVEN:
            continue
        fault = "leaves drivable space"
        if status != Proof.VIOLATED:
            fault = "cannot be proven inside drivable space"
        x, y = scenario.at(time).position[i].tolist()
        message = f"vehicle {i}: footprint {fault} at {time:.3f} s near ({x:.2f}, {y:.2f})"
        yield Violation(Cause.OFF_ROAD, time, (i,), message)
