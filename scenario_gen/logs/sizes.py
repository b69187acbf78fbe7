# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lengths and widths of vehicles: missing and impossible ones are replaced."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.kinds import usual_size
from scenario_gen.logs.raw import Observations
from scenario_gen.types import CAR, VEHICLE_TYPES

MAX_LENGTH_M = 100.0
"""Longest road vehicle."""

_MAX_WIDTH_M = 4.0
_SIZE_UNITS = {"ft": ("feet", 0.3048), "cm": ("centimetres", 0.01), "mm": ("millimetres", 0.001)}


def with_sizes(
    vehicles: Sequence[Observations], config: LogConfig
) -> tuple[list[Observations], list[str]]:
    """Return the vehicles with lengths and widths, and a note on impossible ones.

    Missing and impossible sizes are replaced.
    """
    sized = []
    impossible = []
    for vehicle in vehicles:
        length, width = vehicle.length, vehicle.width  # comparisons with NaN are false
        walks = VEHICLE_TYPES[vehicle.kind or CAR].walks  # wider than long
        if width <= 0.0 or width > _MAX_WIDTH_M or (width > length and not walks):
            impossible.append(vehicle)
            length = width = np.nan
        elif length <= 0.0 or length > MAX_LENGTH_M:
            impossible.append(vehicle)
            length = np.nan
        usual_length, usual_width = usual_size(vehicle.kind, config)
        sized.append(
            replace(
                vehicle,
                length=length if np.isfinite(length) else usual_length,
                width=width if np.isfinite(width) else usual_width,
            )
        )
    return sized, [_size_note(impossible, config)] if impossible else []


def _size_note(impossible: Sequence[Observations], config: LogConfig) -> str:
    """Return a note on impossible sizes, with the unit that would explain them."""
    vehicle = impossible[0]
    more = f" ({len(impossible)} vehicles have such sizes)" if len(impossible) > 1 else ""
    usual_length, usual_width = usual_size(vehicle.kind, config)
    return (
        f"vehicle {vehicle.id}: {vehicle.length:g} m × {vehicle.width:g} m is not the size of a "
        f"car{more}{_size_hint(vehicle.length, vehicle.width)}; used instead: "
        f"{usual_length:g} m × {usual_width:g} m"
    )


def _size_hint(length: float, width: float) -> str:
    """Return what impossible sizes look like; "" if unknown."""

    def is_usual(length: float, width: float) -> bool:
        return 2.5 < length < 20.0 and 1.2 < width < 2.7

    if is_usual(width, length):
        return ", it looks swapped (log.columns=length=…,width=…)"
    for unit, (name, factor) in _SIZE_UNITS.items():
        if is_usual(factor * length, factor * width):
            columns = f"log.columns=length=…:{unit},width=…:{unit}"
            return f", it looks like {name} (name the unit: {columns})"
    return ""
