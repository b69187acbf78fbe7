# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the vehicles do in each segment of an encounter, in words."""

from itertools import pairwise

import numpy as np

from scenario_gen.base.road_users import VehicleType
from scenario_gen.numerics import Floats, Ints
from scenario_gen.types.motion import Motion

STEADY_MPS2 = 0.25  # a smaller acceleration is none
TURNING_RAD = np.deg2rad(15.0)  # a smaller change of heading is no turn


def describe_motion(speed: Floats, heading: Floats, dt: float, kind: VehicleType) -> str:
    """Describe speed [m/s] and heading [rad], both (n,), of a vehicle in one primitive."""
    n, slow = len(speed), kind.waits_below
    slope, level = 0.0, float(speed[0])
    if n > 1:
        line = np.column_stack([np.arange(n) * dt, np.ones(n)])
        slope, level = np.linalg.lstsq(line, speed, rcond=None)[0].tolist()
    first, last = max(level, 0.0), max(level + slope * (n - 1) * dt, 0.0)
    if np.median(speed) < slow and max(first, last) < 2.0 * slow:
        return "stands"
    turn = float(heading[-1] - heading[0])
    bend = ""
    if abs(turn) >= TURNING_RAD:
        bend = f", turning {'left' if turn > 0.0 else 'right'} by {abs(np.rad2deg(turn)):.0f}°"
    if abs(last - first) < slow or abs(slope) < STEADY_MPS2:
        return f"{'walks' if kind.walks else 'drives'} at {np.mean(speed):.1f} m/s{bend}"
    if slope > 0.0:
        verb = "pulls away" if first < slow else "accelerates"
        return f"{verb} from {first:.1f} to {last:.1f} m/s{bend}"
    verb = "brakes to a stop" if last < slow else "brakes"
    return f"{verb} from {first:.1f} to {last:.1f} m/s{bend}"


def describe_segments(encounter: Motion, changepoints: Ints) -> tuple[str, ...]:
    """Return one sentence per segment between changepoints (K,), with the ids of the vehicles."""
    sentences = []
    for a, b in pairwise([0, *changepoints.tolist(), encounter.speed.shape[1]]):
        clauses = [
            f"vehicle {vehicle.id} {_in_segment(encounter, i, a, b)}"
            for i, vehicle in enumerate(encounter.vehicles)
        ]
        sentences.append(", ".join(clauses))
    return tuple(sentences)


def _in_segment(encounter: Motion, i: int, a: int, b: int) -> str:
    """Describe what vehicle i does from sample a to b - 1, while it is present."""
    first, last = encounter.present[i].tolist()
    if last < a:
        return "has left"
    if first >= b - 1:
        return "has not arrived yet"
    present, dt = slice(max(a, first), min(b, last + 1)), encounter.dt
    speed, heading = encounter.speed[i, present], encounter.heading[i, present]
    motion = describe_motion(speed, heading, dt, encounter.vehicles[i].kind)
    arrival = f"arrives after {(first - a) * dt:.1f} s and " if first > a else ""
    departure = f", leaves after {(last - a) * dt:.1f} s" if last < b - 1 else ""
    return f"{arrival}{motion}{departure}"
