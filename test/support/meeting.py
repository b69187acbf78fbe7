# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A meeting with a known truth: A turns left through a junction in front of B, who comes straight on."""

import numpy as np
import pandas as pd

START_S = 1_760_000_000.0
_FINE_S = np.linspace(0.0, 16.0, 16_001)


def _turning(driven):
    """Positions and headings of a left turn with a radius of 15 m, by the distance driven."""
    angle = np.clip((driven - 60.0) / 15.0, 0.0, np.pi / 2.0)
    ahead = np.minimum(driven - 60.0, 0.0)
    beyond = np.maximum(driven - 60.0 - 7.5 * np.pi, 0.0)
    x = 2.0 - 15.0 + 15.0 * np.cos(angle) - beyond
    return x, 15.0 * np.sin(angle) + ahead, np.pi / 2.0 + angle


def truth(seconds):
    """{vehicle: x, y, heading, speed} at seconds (0 to 14) since the start."""
    speeds = {
        "A": lambda t: 8.0 - 3.0 * np.exp(-(((t - 6.5) / 2.0) ** 2)),
        "B": lambda t: 10.0 - 2.5 * np.exp(-(((t - 7.0) / 1.5) ** 2)),
    }
    seconds = np.asarray(seconds, float)
    states = {}
    for name, speed in speeds.items():
        steps = speed(_FINE_S[1:]) * np.diff(_FINE_S)
        driven = np.interp(seconds, _FINE_S, np.concatenate([[0.0], np.cumsum(steps)]))
        if name == "A":
            x, y, heading = _turning(driven)
        else:
            x, y = np.full_like(driven, -2.0), 75.0 - driven
            heading = np.full_like(driven, -np.pi / 2.0)
        states[name] = (x, y, heading, speed(seconds))
    return states


def meeting(rate=10.0):
    """Rows of the meeting (t, id, x, y, h, v), ordered by time."""
    seconds = np.arange(round(14.0 * rate) + 1) / rate
    parts = [
        pd.DataFrame({"t": START_S + seconds, "id": name, "x": x, "y": y, "h": h, "v": v})
        for name, (x, y, h, v) in truth(seconds).items()
    ]
    return pd.concat(parts).sort_values(["t", "id"], kind="stable", ignore_index=True)


def degrees(rows):
    """The rows with lat and lon instead of x and y."""
    lat, lon = 48.9 + rows.y / 111_216.0, 9.1 + rows.x / 73_210.0
    return rows.assign(lat=lat, lon=lon).drop(columns=["x", "y"])


def north_degrees(rows):
    """Headings in degrees clockwise from north."""
    return (90.0 - np.degrees(rows.h)) % 360.0


def distance(encounter, names=("A", "B"), start_s=None):
    """Largest distance [m] from the truth, without the offset that all vehicles share."""
    start_s = encounter.start_ns * 1e-9 - START_S if start_s is None else start_s
    right = truth(np.clip(encounter.time + start_s, 0.0, 14.0))
    ids = [vehicle.id for vehicle in encounter.vehicles]
    offsets = []
    for name, vehicle in zip("AB", names, strict=True):
        row = ids.index(vehicle)
        begin, end = encounter.present[row]
        offset = encounter.position[row] - np.column_stack(right[name][:2])
        offsets.append(offset[begin : end + 1])
    joined = np.concatenate(offsets)
    return float(np.hypot(*(joined - np.median(joined, axis=0)).T).max())
