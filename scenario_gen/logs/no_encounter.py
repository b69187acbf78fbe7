# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Why a log has no encounter, and which parameter would change that."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import islice
import math
from typing import NamedTuple

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import updated
from scenario_gen.logs.cleaning import Drops
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.encounters import Piece
from scenario_gen.logs.groups import distances, driven, find_groups, near_pairs
from scenario_gen.logs.kinds import counted
from scenario_gen.logs.raw import RawLog
from scenario_gen.numerics import runs

_MAX_PAIR_COUNT = 1_000  # that are compared
_MAX_REACH_M = 1e6  # within which the nearest vehicles are named


class NoEncounterError(InputError):
    """A readable log has no encounter, or only one vehicle."""


class _Approach(NamedTuple):
    """The longest time for which two pieces are within `proximity`; smallest distance."""

    seconds: float
    driven_m: float
    nearest_m: float
    pieces: tuple[Piece, Piece]


def explain_few_vehicles(log: RawLog, names: Sequence[str], drops: Drops) -> str:
    """Return the message on a log with fewer than two usable vehicles."""
    causes = [f"left out: {counted(log.excluded)}"] if log.excluded else []
    causes += map(str, drops.located(log))
    usable = f"only vehicle {names[0]}" if names else "no vehicle"
    message = (
        f"{log.segments[0].label}: {usable} has usable positions; an encounter needs at least two "
        "vehicles on one clock. Give the files of all vehicles in one command, or check "
        "--set log.columns=… and log.vehicles=…"
    )
    return f"{message}. {'; '.join(causes)}" if causes else message


def explain_no_encounter(log: RawLog, pieces: Sequence[Piece], config: LogConfig) -> str:
    """Return the message on a log without encounters, with the parameter that would give one."""
    rule = (
        f"{log.segments[0].label}: no two vehicles are within {config.proximity:g} m for "
        f"{config.min_duration:g} s while one drives {config.travel:g} m"
    )
    reach = config.proximity
    near: list[_Approach] = []
    while not near and reach < _MAX_REACH_M:
        pairs = islice(near_pairs(pieces, 1, reach), _MAX_PAIR_COUNT)
        near = [_approach(pieces[i], pieces[j], config) for i, j in pairs]
        reach *= 8.0
    if not near:
        return f"{rule}: no two vehicles are recorded at the same time and place"
    best = max(near, key=lambda pair: (pair.seconds, pair.driven_m, -pair.nearest_m))
    first, second = best.pieces
    fact = (
        f"{rule}. Vehicles {first.track.id} and {second.track.id} are within "
        f"{config.proximity:g} m for {best.seconds:.1f} s and come as near as "
        f"{best.nearest_m:.0f} m, while the faster one drives {best.driven_m:.1f} m"
    )
    for name, value in _options(best):
        with suppress(InputError):  # beyond the parameter's range
            if find_groups(best.pieces, updated(config, {name: value}))[0]:
                return f"{fact}; --set log.{name}={value:g} accepts them"
    return fact


def _options(best: _Approach) -> Iterator[tuple[str, float]]:
    """Yield parameters that may accept two vehicles, with their values."""
    yield "min_duration", math.floor(10.0 * best.seconds) / 10.0
    yield "travel", math.floor(best.driven_m)
    for factor in (1.0, 1.5, 2.0, 4.0):
        yield "proximity", 10.0 * math.ceil(factor * best.nearest_m / 10.0 + 1e-9)


def _approach(a: Piece, b: Piece, config: LogConfig) -> _Approach:
    """Return how long two pieces are near each other without a break."""
    distance = distances(a, b)
    begin = max(a.first, b.first)
    spans = runs(distance < config.proximity)
    first, last = max(spans, key=lambda span: span[1] - span[0], default=(0, 0))
    seconds = max(last - 1 - first, 0) * config.period
    farther = max(driven(piece, begin + first, begin + last, config) for piece in (a, b))
    return _Approach(seconds, farther, float(distance.min()), (a, b))
