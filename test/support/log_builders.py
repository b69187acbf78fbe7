# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Small logs made for tests: two cars on crossing roads, written as tables, with what a test wants wrong in them."""

import numpy as np
import pandas as pd

LATITUDE, LONGITUDE = 48.0, 11.0
METRES_PER_DEGREE = 111_320.0


def crossing(seconds=12.0, rate=10.0, start=1000.0):
    """Rows of two cars: `a` drives east at 8 m/s; `b` drives north, brakes to a stop and stands."""
    time = np.arange(round(seconds * rate) + 1) / rate
    east = pd.DataFrame(
        {
            "t_s": start + time,
            "vehicle_id": "a",
            "x_m": -40.0 + 8.0 * time,
            "y_m": 0.0,
            "speed_mps": 8.0,
        }
    )
    braking = np.minimum(time, 6.0)
    north = pd.DataFrame(
        {
            "t_s": start + time,
            "vehicle_id": "b",
            "x_m": 10.0,
            "y_m": -30.0 + 6.0 * braking - 0.5 * braking**2,
            "speed_mps": 6.0 - braking,
        }
    )
    return pd.concat([east, north], ignore_index=True).sort_values(
        ["t_s", "vehicle_id"], ignore_index=True
    )


def geographic(rows):
    """The same rows with latitude and longitude."""
    out = rows.drop(columns=["x_m", "y_m"])
    out["lat_deg"] = LATITUDE + rows["y_m"] / METRES_PER_DEGREE
    out["lon_deg"] = LONGITUDE + rows["x_m"] / (METRES_PER_DEGREE * np.cos(np.radians(LATITUDE)))
    return out


def save(rows, folder, name="log.csv", **options):
    """Write rows as a csv file; options are those of pandas."""
    path = folder / name
    rows.to_csv(path, index=False, **options)
    return path
