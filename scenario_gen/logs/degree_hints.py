# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Hints on latitudes and longitudes that are not degrees."""

import numpy as np

from scenario_gen.logs.columns import with_columns
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import RawLog


def degree_hint(log: RawLog, config: LogConfig) -> str:
    """Return what unusable latitudes and longitudes look like; "" if unknown."""
    if not log.geographic:
        return ""
    fix = np.concatenate([vehicle.fix for vehicle in log.vehicles] or [np.zeros((0, 2))])
    fix = np.abs(fix[np.isfinite(fix).all(axis=1)])
    if not len(fix):
        return "; the receivers had no fix, or the fields are empty"
    latitude, longitude = np.median(fix, axis=0)
    if 90.0 < latitude <= 180.0:
        return f"; lat and lon may be swapped: {_degree_option(log, config, swapped=True)}"
    if max(latitude, longitude) > 180.0 and latitude <= 9_000.0 and longitude <= 18_000.0:
        option = _degree_option(log, config, "ddmm")
        return f"; they look like degrees and minutes, as of NMEA: {option}"
    if max(latitude, longitude) > 180.0 and latitude <= 9e8 and longitude <= 1.8e9:
        return f"; they look like 1e-7 degrees: {_degree_option(log, config, 'e7')}"
    return ""


def _degree_option(
    log: RawLog, config: LogConfig, unit: str = "", *, swapped: bool = False
) -> str:
    """Return the option that reads latitude and longitude in a unit, or swapped."""
    latitude, longitude = log.columns.get("lat"), log.columns.get("lon")
    names = {"lat": f"…:{unit}" if unit else "…", "lon": f"…:{unit}" if unit else "…"}
    if latitude is not None and longitude is not None:
        names = {"lat": latitude.option(unit), "lon": longitude.option(unit)}
    if swapped:
        names = {"lat": names["lon"], "lon": names["lat"]}
    return with_columns(config.columns, names)
