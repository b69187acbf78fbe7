# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Types of road users, and the sizes that are usual for them."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
import re

import numpy as np

from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.logs.columns import with_columns
from scenario_gen.logs.config import listed, LogConfig
from scenario_gen.logs.raw import Observations, RawLog
from scenario_gen.types import CAR, OTHER, VEHICLE_TYPES, words

_NOT_ROAD_USERS = frozenset(
    [
        "animal",
        "dog",
        "cone",
        "static",
        "unnamed",
        "background",
        "construction",
        "riderless",
        "unknown",
        "tram",
        "streetcar",
        "train",
        "watercraft",
        "aircraft",
    ]
)
_UNSPECIFIC = ("", "nan", "none", "vehicle", "land vehicle", "motor vehicle", "default vehtype")


@cache
def type_called(word: str) -> str | None:
    """Return the type for a log's word, "" if its size determines it, None if it is unknown."""
    plain = _plain(word)
    if plain in _UNSPECIFIC:
        return ""
    known = {_plain(name): kind for name, kind in words().items()}
    singular = " ".join(part.removesuffix("s") for part in plain.split())
    text = f" {plain} {singular} "
    matches = [name for name in known if f" {name} " in text]
    return known[max(matches, key=len)] if matches else None


def _plain(word: str) -> str:
    """Return the letters of a word in lower case."""
    return " ".join(re.findall(r"[a-z]+", word.lower()))


def _is_road_user(word: str) -> bool:
    """Return whether a log's word denotes a road user."""
    return _NOT_ROAD_USERS.isdisjoint(_plain(word).split())


def typed(log: RawLog, config: LogConfig) -> RawLog:
    """Return a log with types instead of its words; it counts road users that are left out.

    Raises:
        InputError: the parameter `types` names an unknown type.
    """
    wanted = listed(config.types)
    for name in wanted:
        if name not in VEHICLE_TYPES:
            known = VEHICLE_TYPES.names()
            raise InputError(
                f"parameter log.types: there is no type {name!r}; choose one of "
                f"{', '.join(known)}{did_you_mean(name, known)}"
            )
    excluded: Counter[str] = Counter()
    unknown: Counter[str] = Counter()
    vehicles: list[Observations] = []
    for vehicle in log.vehicles:
        word = vehicle.kind
        kind = type_called(word)
        if not _is_road_user(word) or (wanted and (kind or OTHER) not in wanted):
            excluded[word] += 1
            continue
        if kind is None:
            unknown[word] += 1
        vehicles.append(replace(vehicle, kind=kind or ""))
    if excluded and not vehicles:
        remedy = (
            "; name other types with --set log.types=…" if wanted else _without_types(log, config)
        )
        raise InputError(
            f"{log.segments[0].label}: every road user is left out by its type "
            f"({counted(excluded)}){remedy}"
        )
    notes = log.notes
    if unknown:
        notes = (*notes, f"unknown types, guessed from the sizes: {counted(unknown)}")
    return replace(log, vehicles=tuple(vehicles), notes=notes, excluded=excluded)


def _without_types(log: RawLog, config: LogConfig) -> str:
    """Return the option that reads a table without its types."""
    is_table = "kind" in log.columns
    return f"; {with_columns(config.columns, {'kind': 'none'})}" if is_table else ""


def counted(counts: Mapping[str, int]) -> str:
    """Return the numbers by type as a text."""
    return ", ".join(
        f"{count} × {kind or 'without a type'}" for kind, count in sorted(counts.items())
    )


def usual_size(name: str, config: LogConfig) -> tuple[float, float]:
    """Return length and width [m] of a type, if a log has none; a car's are parameters."""
    if name in ("", CAR, OTHER):
        return config.length, config.width
    return VEHICLE_TYPES[name].length, VEHICLE_TYPES[name].width


MAX_LENGTH_M = 100.0
"""Longest road vehicle."""

_MAX_WIDTH_M = 4.0
_SIZE_RATIO = 4.0  # of a length to the usual one of its type, or its inverse
_SIZE_UNITS = {"ft": ("feet", 0.3048), "cm": ("centimetres", 0.01), "mm": ("millimetres", 0.001)}


def with_sizes(
    vehicles: Sequence[Observations], log: RawLog, config: LogConfig
) -> tuple[list[Observations], list[str]]:
    """Return the vehicles with lengths and widths, and a note on impossible ones.

    Missing and impossible sizes are replaced.
    """
    sized = []
    impossible = []
    for vehicle in vehicles:
        length, width = vehicle.length, vehicle.width  # comparisons with NaN are false
        walks = VEHICLE_TYPES[vehicle.kind or CAR].walks  # wider than long
        usual_length, usual_width = usual_size(vehicle.kind, config)
        shortest, longest = 0.0, MAX_LENGTH_M
        if vehicle.kind not in ("", OTHER):
            shortest, longest = usual_length / _SIZE_RATIO, usual_length * _SIZE_RATIO
        if width <= 0.0 or width > _MAX_WIDTH_M or (width > length and not walks):
            impossible.append(vehicle)
            length = width = np.nan
        elif length <= shortest or length > longest:
            impossible.append(vehicle)
            length = np.nan
        sized.append(
            replace(
                vehicle,
                length=length if np.isfinite(length) else usual_length,
                width=width if np.isfinite(width) else usual_width,
            )
        )
    notes = [_size_note(impossible, log, config)] if impossible else []
    if vehicles and all(map(_is_half, vehicles)) and {"length", "width"} <= log.columns.keys():
        columns = {name: log.columns[name].option("2") for name in ("length", "width")}
        notes.append(
            f"all vehicles are as small as {vehicles[0].length:g} m × {vehicles[0].width:g} m: if "
            f"these are half sizes: {with_columns(config.columns, columns)}"
        )
    return sized, notes


def _is_half(vehicle: Observations) -> bool:
    """Return whether a vehicle has half the size of a car."""
    is_car = vehicle.kind in ("", CAR)
    return is_car and 1.8 < vehicle.length < 2.6 and 0.75 < vehicle.width < 1.2


def _size_note(impossible: Sequence[Observations], log: RawLog, config: LogConfig) -> str:
    """Return a note on impossible sizes, with the unit that would explain them."""
    vehicle = impossible[0]
    more = f" ({len(impossible)} vehicles have such sizes)" if len(impossible) > 1 else ""
    usual_length, usual_width = usual_size(vehicle.kind, config)
    return (
        f"vehicle {vehicle.id}: {vehicle.length:g} m × {vehicle.width:g} m is not the size of a "
        f"{vehicle.kind or CAR}{more}"
        f"{_size_hint(vehicle.length, vehicle.width, log, config)}; used instead: "
        f"{usual_length:g} m × {usual_width:g} m"
    )


def _size_hint(length: float, width: float, log: RawLog, config: LogConfig) -> str:
    """Return what impossible sizes look like, and the option for it; "" if unknown."""

    def is_usual(length: float, width: float) -> bool:
        return 2.5 < length < 20.0 and 1.2 < width < 2.7

    def option(units: Mapping[str, str]) -> str:
        columns = {q: log.columns[q].option(u) for q, u in units.items() if q in log.columns}
        return with_columns(config.columns, columns)

    if not {"length", "width"} <= log.columns.keys():
        return ""
    if is_usual(width, length):
        names = {"length": log.columns["width"].name, "width": log.columns["length"].name}
        return f", it looks swapped: {with_columns(config.columns, names)}"
    for unit, (name, factor) in _SIZE_UNITS.items():
        if is_usual(factor * length, factor * width):
            hint = f", it looks like {name}: {option({'length': unit, 'width': unit})}"
            if unit == "ft":
                units = dict.fromkeys(("x", "y", "length", "width"), unit)
                hint += f", or if x, y are too: {option(units | {'speed': 'fps'})}"
            return hint
    return ""
