# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The contacts of a drive, in continuous time."""

from itertools import combinations

import numpy as np

from scenario_gen.closed_loop.drive import Drive
from scenario_gen.closed_loop.off_road import RESOLUTION_S, SUBSTEPS_COUNT
from scenario_gen.method.evaluation import footprint_distance
from scenario_gen.method.validity import first_contacts, Proof
from scenario_gen.numerics.hermite import control_points
from scenario_gen.types import Scenario


def contact_times(drive: Drive) -> dict[tuple[int, int], float]:
    """Return the times [s] of the first contacts of all pairs of vehicles that touch."""
    pairs = combinations(reversed(range(len(drive.motion.vehicles))), 2)
    times = {pair: _contact(drive, *pair) for pair in pairs}
    return {pair: time for pair, time in times.items() if time is not None}


def _contact(drive: Drive, i: int, j: int) -> float | None:
    """Return the time [s] of the first contact of two vehicles while both are in the scene.

    None if they never touch.
    """
    both = np.flatnonzero(drive.present[i] & drive.present[j])
    parts = np.split(both, np.searchsorted(both, drive.jumps)) if drive.ego in (i, j) else [both]
    times = (
        _contact_in(drive.motion, [i, j], slice(part[0], part[-1] + 1))
        for part in parts
        if len(part)
    )
    return next((time for time in times if time is not None), None)


def _contact_in(motion: Scenario, pair: list[int], span: slice) -> float | None:
    """Return the time [s] of the first contact of two vehicles in a span of instants.

    None if they do not touch in it.
    """
    vehicles = (motion.vehicles[pair[0]], motion.vehicles[pair[1]])
    if span.stop - span.start < 2:
        touches = footprint_distance(motion, *pair)[span.start] <= 0.0
        return float(motion.time[span.start]) if touches else None
    time, position = motion.time[span], motion.position[pair][:, span]
    heading, speed = motion.heading[pair][:, span], motion.speed[pair][:, span]
    control, out = np.empty((2, len(time) - 1, 4, 2)), np.empty((1, 3))
    control_points(time, position, heading, speed, control)
    half = np.array([vehicle.half for vehicle in vehicles])
    first_contacts(time, control, heading, half, 0.0, RESOLUTION_S, out)
    if out[0, 0] == Proof.PROVEN:
        return None
    instant, step = float(out[0, 1]), float(motion.time[1])  # any instant of the contact
    k = min(int(instant / step + 1e-9), len(motion.time) - 2)
    start = float(motion.time[k])
    u = np.linspace(0.0, max(instant - start, 0.0) / step, SUBSTEPS_COUNT + 1)
    fine = motion.of_vehicles(pair).at_times(start + u * step)
    touch = footprint_distance(fine, 0, 1) <= 0.0
    return start + float(u[np.argmax(touch)]) * step if touch.any() else instant
