# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The replay: the recording as fitted to the road, before anything is generated."""

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.types import cut, Encounter, Fit, FittedVehicle, Scenario

MIN_DIRECTED_CHORD_M = 0.5
"""A shorter chord gives no direction (eq 8) and no scale (eq 9)."""


def replay(encounter: Encounter, fit: Fit, frame_id: str = "map") -> Scenario:
    """Map each piece between two anchors onto the road by its own similarity (eqs 7-9).

    Start goes to start and end to end; speeds scale with the lengths. A standing primitive stands
    at its anchor. A piece whose chord is too short to give a direction keeps its shape and is
    turned by the headings of its start.
    """
    first, last = int(fit.anchor_index[0]), int(fit.anchor_index[-1])
    window = slice(first, last + 1)
    states = [
        _replayed(
            encounter.position[n],
            encounter.heading[n],
            encounter.speed[n],
            fit.anchor_index,
            fitted,
        )[window]
        for n, fitted in enumerate(fit.fitted)
    ]
    state = np.stack(states)
    time = encounter.time[window] - encounter.time[first]
    return Scenario(
        vehicles=fit.vehicles,
        time=time,
        position=state[..., :2],
        heading=state[..., 2],
        speed=state[..., 3],
        acceleration=np.gradient(state[..., 3], encounter.dt, axis=1),
        frame_id=frame_id,
        present=cut(encounter.present, first, last + 1),
    )


def _replayed(
    position: Floats, heading: Floats, speed: Floats, index: np.ndarray, fitted: FittedVehicle
) -> Floats:
    """Return (T, 4): x, y, yaw, speed of one vehicle on the road."""
    out = np.empty((len(speed), 4))
    for k in range(len(index) - 1):
        i, j = int(index[k]), int(index[k + 1])
        piece = slice(i, j + 1)
        start, end = fitted.anchors[k], fitted.anchors[k + 1]
        if fitted.stands[k]:
            out[piece] = [*start, 0.0]
            continue
        offset = position[piece] - position[i]
        u, v = offset[-1], end[:2] - start[:2]
        chord, target = np.hypot(*u), np.hypot(*v)
        if chord < MIN_DIRECTED_CHORD_M or target < MIN_DIRECTED_CHORD_M:
            scale, turn = 1.0, start[2] - heading[i]
        else:
            scale, turn = target / chord, np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v)
        c, s = np.cos(turn), np.sin(turn)
        moved = (scale * offset) @ np.array([[c, s], [-s, c]])
        miss = v - moved[-1]  # zero to rounding unless the chord was too short
        out[piece, :2] = start[:2] + moved + np.linspace(0.0, 1.0, j - i + 1)[:, None] * miss
        out[piece, 2] = heading[piece] + turn
        out[piece, 3] = scale * speed[piece]
    return out
