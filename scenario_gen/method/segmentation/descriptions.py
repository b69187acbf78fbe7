# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What each vehicle does in each primitive, in plain language with figures."""

from itertools import pairwise

import numpy as np

from scenario_gen.numerics import Floats, Ints
from scenario_gen.types import Motion, VehicleType

STEADY = 0.25
TURNING = np.deg2rad(15.0)
LEANING = 0.5


def describe_motion(speed: Floats, heading: Floats, dt: float, kind: VehicleType) -> str:
    """Describe speed [m/s] and heading [rad], both (n,), of one vehicle of a type in one primitive."""
    n, slow = len(speed), kind.waits_below
    line = np.column_stack([np.arange(n) * dt, np.ones(n)])
    slope, level = (
        np.linalg.lstsq(line, speed, rcond=None)[0].tolist() if n > 1 else (0.0, float(speed[0]))
    )
    first, last = max(level, 0.0), max(level + slope * (n - 1) * dt, 0.0)
    if np.median(speed) < slow and max(first, last) < 2.0 * slow:
        return "stands"
    turn = float(heading[-1] - heading[0])
    bend = ""
    if abs(turn) >= TURNING:
        bend = f", turning {'left' if turn > 0.0 else 'right'} by {abs(np.rad2deg(turn)):.0f}°"
    if abs(last - first) < slow or abs(slope) < STEADY:
        return f"{'walks' if kind.walks else 'drives'} at {np.mean(speed):.1f} m/s{bend}"
    if slope > 0.0:
        verb = "pulls away" if first < slow else "accelerates"
        return f"{verb} from {first:.1f} to {last:.1f} m/s{bend}"
    verb = "brakes to a stop" if last < slow else "brakes"
    return f"{verb} from {first:.1f} to {last:.1f} m/s{bend}"


def describe_segments(encounter: Motion, changepoints: Ints) -> tuple[str, ...]:
    """One sentence per segment between changepoints (K,), naming every vehicle by its id."""
    edges = [0, *(int(c) for c in changepoints), encounter.speed.shape[1]]
    return tuple(
        ", ".join(
            f"vehicle {vehicle.id} {_in_segment(encounter, i, a, b)}"
            for i, vehicle in enumerate(encounter.vehicles)
        )
        for a, b in pairwise(edges)
    )


def _in_segment(encounter: Motion, i: int, a: int, b: int) -> str:
    """Describe what vehicle i does from sample a to before b, as far as it is there."""
    first, last = encounter.present[i].tolist()
    if last < a:
        return "has left"
    if first >= b - 1:
        return "is not there yet"
    own = slice(max(a, first), min(b, last + 1))
    motion = describe_motion(
        encounter.speed[i, own],
        encounter.heading[i, own],
        encounter.dt,
        encounter.vehicles[i].kind,
    )
    comes = f"arrives after {(first - a) * encounter.dt:.1f} s and " if first > a else ""
    goes = f", leaves after {(last - a) * encounter.dt:.1f} s" if last < b - 1 else ""
    return f"{comes}{motion}{goes}"


def describe_accelerations(mean: Floats) -> str:
    """Describe a primitive by its mean features (3N,), vehicles numbered from 0; see `features`."""
    parts = []
    for i, (along, across, moves) in enumerate(mean.reshape(-1, 3)):
        if moves < 0.5:
            parts.append(f"vehicle {i} stands")
            continue
        pace = (
            "drives steadily"
            if abs(along) < STEADY
            else f"{'accelerates' if along > 0.0 else 'brakes'} at {abs(along):.1f} m/s²"
        )
        bend = (
            ""
            if abs(across) < LEANING
            else f", turning {'left' if across > 0.0 else 'right'} at {abs(across):.1f} m/s²"
        )
        parts.append(f"vehicle {i} {pace}{bend}")
    return ", ".join(parts)
