# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Proof that oriented footprints do not overlap at any instant.

Over an interval the relative position of two vehicles lies in the convex hull of four control
points, and each heading lies within a known angle of its middle. A line that separates the boxes
at the middle, and that still does so for all four points after both boxes were widened by the
effect of the rotation, separates them throughout (a swept separating axis). Where there is no such
line, the interval is halved until it is proven, an overlap is found, or it is too short.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from scenario_gen.method.validity.cubic import Proof, split_cubic
from scenario_gen.method.validity.limits import Limits
from scenario_gen.numerics import Floats, Ints, unit
from scenario_gen.numerics.boxes import axes, Box, reaches
from scenario_gen.numerics.hermite import control_points
from scenario_gen.numerics.kernels import F, F1, F2, F4, kernel, OUT2
from scenario_gen.types import Cause, Scenario, together, Violation

_BLOCK_STEPS = 16  # intervals that share one bounding box
_ROUNDING_M = 1e-7  # above the rounding of the largest coordinates
_SAME_INSTANT_S = 0.5e-9  # instants are whole nanoseconds


class _Separation(NamedTuple):
    """The required gap [m], and the shortest interval [s] of a proof."""

    clearance: float
    resolution: float


class _Turning(NamedTuple):
    """A box whose heading changes linearly: half sizes [m], heading and its change [rad]."""

    half: Floats
    yaw: float
    change: float


@kernel(inline=True)
def _gap(d: Floats, a: _Turning, b: _Turning, u: float, margin: float) -> float:
    """Largest separation [m] along the four box axes, valid for all positions and headings.

    A box's extent along its longitudinal axis grows by at most width sin(turn) <= width turn,
    along any other line by at most (half diagonal) turn.

    Args:
        d: (4, 2) control points of the relative position [m].
        a: one box.
        b: the other box.
        u: middle of the interval.
        margin: half of the interval's length.
    """
    yaw_a, yaw_b = a.yaw + a.change * u, b.yaw + b.change * u
    turn_a, turn_b = margin * abs(a.change), margin * abs(b.change)
    box_a = Box(0.0, 0.0, np.cos(yaw_a), np.sin(yaw_a), a.half[0], a.half[1])
    box_b = Box(0.0, 0.0, np.cos(yaw_b), np.sin(yaw_b), b.half[0], b.half[1])
    swept_a = np.hypot(box_a.length, box_a.width) * turn_a
    swept_b = np.hypot(box_b.length, box_b.width) * turn_b
    growth = (
        box_a.width * turn_a + swept_b,
        box_a.length * turn_a + swept_b,
        box_b.width * turn_b + swept_a,
        box_b.length * turn_b + swept_a,
    )
    axis, reach = axes(box_a, box_b), reaches(box_a, box_b)
    best = -np.inf
    for k in range(4):
        low, high = np.inf, -np.inf
        for i in range(4):
            along = axis[k][0] * d[i, 0] + axis[k][1] * d[i, 1]
            low, high = min(low, along), max(high, along)
        best = max(best, max(low, -high) - reach[k] - growth[k])
    return best


@kernel(inline=True)
def _distance_to_origin(low_x: float, high_x: float, low_y: float, high_y: float) -> float:
    """Distance of the origin from the rectangle with these bounds."""
    x, y = max(low_x, -high_x, 0.0), max(low_y, -high_y, 0.0)
    return float(np.sqrt(x * x + y * y))


@kernel(inline=True)
def _is_near(d: Floats, reach: float) -> bool:
    """Whether the bounding box of control points (4, 2) comes within `reach` of the origin."""
    low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
    for c in range(4):
        low_x, high_x = min(low_x, d[c, 0]), max(high_x, d[c, 0])
        low_y, high_y = min(low_y, d[c, 1]), max(high_y, d[c, 1])
    return bool(_distance_to_origin(low_x, high_x, low_y, high_y) <= reach)


@kernel(inline=True)
def _first_contact(
    d: Floats, h: float, a: _Turning, b: _Turning, required: _Separation
) -> tuple[int, float, float]:
    """Outcome, fraction of the interval and gap [m]; d (4, 2) relative control points, h [s]."""
    part = np.empty((4, 2))
    u, step = 0.0, 1.0
    while u < 1.0:
        middle = u + 0.5 * step
        split_cubic(d, u, u + step, part)
        if _gap(part, a, b, middle, 0.5 * step) > required.clearance + _ROUNDING_M:
            u += step
            step = min(2.0 * step, 1.0 - u)
            continue
        split_cubic(d, middle, middle, part)
        gap = _gap(part, a, b, middle, 0.0)
        if gap <= required.clearance:
            return Proof.VIOLATED.value, middle, gap
        step *= 0.5
        if step * h < required.resolution:
            return Proof.UNPROVEN.value, middle, gap
    return Proof.PROVEN.value, 1.0, np.inf


@kernel(inline=True)
def _block_bounds(control: Floats) -> Floats:
    """Low x, high x, low y, high y (N, B, 4) of each block of control points (N, K, 4, 2)."""
    n, intervals = control.shape[0], control.shape[1]
    bounds = np.empty((n, (intervals + _BLOCK_STEPS - 1) // _BLOCK_STEPS, 4))
    bounds[:, :, 0::2] = np.inf
    bounds[:, :, 1::2] = -np.inf
    for i in range(n):
        for k in range(intervals):
            box = bounds[i, k // _BLOCK_STEPS]
            for c in range(4):
                x, y = control[i, k, c, 0], control[i, k, c, 1]
                box[0], box[1] = min(box[0], x), max(box[1], x)
                box[2], box[3] = min(box[2], y), max(box[3], y)
    return bounds


class _Motions(NamedTuple):
    """The arguments `time`, `control`, `heading` and `half` of `first_contacts`."""

    time: Floats
    control: Floats
    heading: Floats
    half: Floats


@kernel(inline=True)
def _turning(motions: _Motions, i: int, k: int) -> _Turning:
    """Box of vehicle i in interval k."""
    yaw = motions.heading[i, k]
    return _Turning(motions.half[i], yaw, motions.heading[i, k + 1] - yaw)


@kernel(inline=True)
def _block_contact(
    block: int, i: int, j: int, motions: _Motions, reach: float, required: _Separation
) -> tuple[int, float, float]:
    """Outcome, time [s] and gap [m] of the first contact of vehicles i and j in a block."""
    time, control = motions.time, motions.control
    d = np.empty((4, 2))
    end = min(len(time) - 1, (block + 1) * _BLOCK_STEPS)
    for k in range(block * _BLOCK_STEPS, end):
        for c in range(4):
            d[c, 0] = control[j, k, c, 0] - control[i, k, c, 0]
            d[c, 1] = control[j, k, c, 1] - control[i, k, c, 1]
        if _is_near(d, reach):
            h = time[k + 1] - time[k]
            a, b = _turning(motions, i, k), _turning(motions, j, k)
            status, u, gap = _first_contact(d, h, a, b, required)
            if status != Proof.PROVEN.value:
                return status, time[k] + u * h, gap
    return Proof.PROVEN.value, np.nan, np.nan


@kernel(inline=True)
def _pair_contact(
    i: int, j: int, motions: _Motions, bounds: Floats, required: _Separation
) -> tuple[int, float, float]:
    """Outcome, time [s] and gap [m] of the first contact of vehicles i and j."""
    half = motions.half
    reach = np.hypot(half[i, 0], half[i, 1]) + np.hypot(half[j, 0], half[j, 1])
    reach += required.clearance + _ROUNDING_M
    for k in range(bounds.shape[1]):
        p, q = bounds[i, k], bounds[j, k]
        if _distance_to_origin(q[0] - p[1], q[1] - p[0], q[2] - p[3], q[3] - p[2]) <= reach:
            status, at, gap = _block_contact(k, i, j, motions, reach, required)
            if status != Proof.PROVEN.value:
                return status, at, gap
    return Proof.PROVEN.value, np.nan, np.nan


@kernel(F1, F4, F2, F2, F, F, OUT2)
def first_contacts(
    time: Floats,
    control: Floats,
    heading: Floats,
    half: Floats,
    clearance: float,
    resolution: float,
    out: Floats,
) -> None:
    """Find the first contact of each pair i < j of N vehicles.

    Args:
        time: (T,) seconds.
        control: (N, T - 1, 4, 2) control points [m].
        heading: (N, T) rad.
        half: (N, 2) half lengths and half widths [m].
        clearance: gap [m] that must be exceeded.
        resolution: shortest interval of time [s] of a proof.
        out: (N (N - 1) / 2, 3) filled with the outcome (`Proof`) and, where it is not proven, with
            the time [s] and the gap [m].
    """
    motions = _Motions(time, control, heading, half)
    bounds = _block_bounds(control)
    required = _Separation(clearance, resolution)
    pair = 0
    for i in range(len(control)):
        for j in range(i + 1, len(control)):
            status, at, gap = _pair_contact(i, j, motions, bounds, required)
            out[pair, 0], out[pair, 1], out[pair, 2] = status, at, gap
            pair += 1


def contact_violations(
    scenario: Scenario, control: Floats, half: Floats, limits: Limits
) -> Iterator[Violation]:
    """Yield the pairs whose footprints are not proven to keep the required gap.

    Args:
        scenario: the vehicles.
        control: (N, T - 1, 4, 2) control points [m].
        half: (N, 2) half lengths and half widths [m].
        limits: required gap, resolution and presence margin.
    """
    pairs = list(combinations(range(len(half)), 2))
    out = np.full((len(pairs), 3), np.nan)  # NaN is no proof: a pair that was not compared
    required = (limits.clearance, limits.time_resolution)
    if scenario.all_present:
        first_contacts(scenario.time, control, scenario.heading, half, *required, out)
    else:
        extended = ExtendedMotion.of(scenario, limits.presence_margin)
        for pair, row in zip(pairs, out, strict=True):
            extended.first_contact(pair, half, required, row[None])
    for pair, (status, time, gap) in zip(pairs, out.tolist(), strict=True):
        if status == Proof.PROVEN:
            continue
        if np.isnan(status):
            fault = "were not compared"
        elif status == Proof.UNPROVEN:
            fault = f"cannot be proven more than {limits.clearance:g} m apart (gap {gap:.6f} m)"
        elif gap <= 0.0:
            fault = f"overlap by {-gap:.3f} m"
        else:
            fault = f"come within {gap:.3f} m; {limits.clearance:g} m must be exceeded"
        message = f"vehicles {pair[0]} and {pair[1]}: footprints {fault} at {time:.3f} s"
        first, last = scenario.time[scenario.present[list(pair)]].T
        if not np.isnan(time) and not ((time >= first) & (time <= last)).all():
            margin = limits.presence_margin
            message += (
                f"; a vehicle that enters or leaves is present for {margin:g} s "
                "more than it is shown"
            )
        yield Violation(Cause.OVERLAP, float(np.nan_to_num(time)), pair, message)


class ExtendedMotion(NamedTuple):
    """Vehicles that enter or leave within a scenario, each a little longer than it is shown.

    Attributes:
        time: (T,) seconds.
        position: (N, T, 2) metres.
        heading: (N, T) rad.
        control: (N, T - 1, 4, 2) control points [m].
        present: (N, 2) first and last sample of each vehicle.
    """

    time: Floats
    position: Floats
    heading: Floats
    control: Floats
    present: Ints

    @classmethod
    def of(cls, scenario: Scenario, margin: float) -> "ExtendedMotion":
        """Extend each presence by at least `margin` seconds, up to a sample of the scenario.

        Before its first and after its last sample a vehicle keeps its speed and rate of turn. Its
        path is an arc: the chord of an angle a is sin(a / 2) / (a / 2) times as long as the arc,
        and lies at a / 2 to its start.
        """
        time, speed = scenario.time, scenario.speed
        present = scenario.present.copy()
        position, heading = scenario.position.copy(), scenario.heading.copy()
        first, last = scenario.present.T
        entry = np.searchsorted(time, time[first] - margin + _SAME_INSTANT_S, side="right") - 1
        exit_ = np.searchsorted(time, time[last] + margin - _SAME_INSTANT_S)
        present[:, 0] = np.maximum(entry, 0)
        present[:, 1] = np.minimum(exit_, len(time) - 1)
        for i, (first, last) in enumerate(scenario.present.tolist()):
            before = slice(present[i, 0], first)
            after = slice(last + 1, present[i, 1] + 1)
            for end, inner, beyond in ((first, first + 1, before), (last, last - 1, after)):
                rate = (heading[i, inner] - heading[i, end]) / (time[inner] - time[end])
                since = time[beyond] - time[end]
                half_turn = 0.5 * rate * since
                chord = speed[i, end] * since * np.sinc(half_turn / np.pi)
                direction = unit(heading[i, end] + half_turn)
                position[i, beyond] = position[i, end] + chord[:, None] * direction
                heading[i, beyond] = heading[i, end] + rate * since
        control = np.empty((len(present), len(time) - 1, 4, 2))
        control_points(time, position, heading, speed, control)
        return cls(time, position, heading, control, present)

    def first_contact(
        self, pair: tuple[int, int], half: Floats, required: tuple[float, float], out: Floats
    ) -> None:
        """Fill `out` (1, 3) as `first_contacts` does, for the common time of one pair."""
        rows, span = list(pair), together(self.present, *pair)
        samples = span.stop - span.start
        time = self.time[span]
        control = self.control[rows, span.start : span.stop - 1]
        heading = self.heading[rows, span]
        if samples == 0:
            out[0, 0] = Proof.PROVEN
            return
        if samples == 1:  # both stand for a second
            time = np.array([0.0, 1.0])
            control = np.repeat(self.position[rows, span], 4, axis=1)[:, None]
            heading = np.repeat(heading, 2, axis=1)
        first_contacts(time, control, heading, half[rows], *required, out)
        if samples == 1:
            out[0, 1] = self.time[span.start]
