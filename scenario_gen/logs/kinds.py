# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Types of road users in logs, and which of them are read."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
import re

from scenario_gen.base.errors import did_you_mean, InputError
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
    notes = log.notes
    if unknown:
        notes = (*notes, f"unknown types, guessed from the sizes: {counted(unknown)}")
    return replace(log, vehicles=tuple(vehicles), notes=notes, excluded=excluded)


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
