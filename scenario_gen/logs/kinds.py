# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What logs call the types of road users, and which of them are read."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
import re

from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.logs.config import listed, LogConfig
from scenario_gen.logs.raw import Observations, RawLog
from scenario_gen.types import CAR, OTHER, VEHICLE_TYPES, words

NO_ROAD_USERS = frozenset(
    (
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
        "train",
        "watercraft",
        "aircraft",
    )
)
UNTOLD = frozenset(
    ("", "nan", "none", "vehicle", "land vehicle", "motor vehicle", "default vehtype")
)
"""Words that say nothing of the type: it is told from the size."""


@cache
def type_called(word: str) -> str | None:
    """Return the type that a log means by a word, "" where the size tells it, None where it is not known."""
    plain = _plain(word)
    if plain in UNTOLD:
        return ""
    known = {_plain(each): name for each, name in words().items()}
    parts = plain.split()
    found = [
        part
        for part in (plain, *parts, *(part.removesuffix("s") for part in parts))
        if part in known
    ]
    return known[max(found, key=len)] if found else None


def _plain(word: str) -> str:
    return " ".join(re.findall(r"[a-z]+", word.lower()))


def is_road_user(word: str) -> bool:
    """Return whether who is so called takes part in traffic on a road."""
    return NO_ROAD_USERS.isdisjoint(_plain(word).split())


def typed(log: RawLog, config: LogConfig) -> RawLog:
    """Return a log with types in place of what it calls them; a note counts who is left out, and what is not known.

    Raises:
        InputError: the parameter `types` names one that there is not.
    """
    wanted = listed(config.types)
    for name in wanted:
        if name not in VEHICLE_TYPES:
            known = VEHICLE_TYPES.names()
            near = did_you_mean(name, known)
            raise InputError(
                f"parameter log.types: there is no type {name!r}; choose one of {', '.join(known)}{near}"
            )
    left_out, unknown = Counter[str](), Counter[str]()
    kept: list[Observations] = []
    for seen in log.vehicles:
        called = type_called(seen.kind)
        if not is_road_user(seen.kind) or (wanted and (called or OTHER) not in wanted):
            left_out[seen.kind] += 1
            continue
        unknown[seen.kind] += called is None
        kept.append(replace(seen, kind=called or ""))
    notes = log.notes
    if +unknown:
        notes = (*notes, f"types that are not known, read by size: {counted(+unknown)}")
    return replace(log, vehicles=tuple(kept), notes=notes, excluded=left_out)


def counted(counts: Mapping[str, int]) -> str:
    """Return the numbers by type as a text."""
    return ", ".join(
        f"{count} × {kind or 'without a type'}" for kind, count in sorted(counts.items())
    )


def usual_size(name: str, config: LogConfig) -> tuple[float, float]:
    """Return length and width [m] of a type of which the log says no sizes: the parameters' of a car, and where none is known."""
    if name in ("", CAR, OTHER):
        return config.length, config.width
    return VEHICLE_TYPES[name].length, VEHICLE_TYPES[name].width
