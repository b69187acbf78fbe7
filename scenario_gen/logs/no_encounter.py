# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Why a log has no encounter, and which parameter would change that."""

from collections.abc import Callable, Sequence
import math
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.base.errors import InputError
from scenario_gen.logs.cleaning import Cause, Drops
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.encounters import Piece
from scenario_gen.logs.groups import distances, driven, near_pairs, simultaneous, ticks
from scenario_gen.logs.kinds import counted
from scenario_gen.logs.raw import RawLog
from scenario_gen.numerics import runs

_MANY_DROPS_SHARE = 0.3  # of the rows, for one cause: their unit is likely wrong
_UNIT_CHECKS = {
    Cause.SPEED_TOO_HIGH: "the unit of the speeds (speed=…:kmh, …:cmps)",
    Cause.JUMP: "the unit of x, y (x=…:cm,y=…:cm)",
}


class NoEncounterError(InputError):
    """A readable log has no encounter, or only one vehicle."""


class _Approach(NamedTuple):
    """The longest time for which two vehicles are within `proximity`; smallest distance."""

    seconds: float
    driven_m: float
    nearest_m: float
    first: str
    second: str


def unit_advice(log: RawLog, drops: Drops) -> str:
    """Return which units to check if many rows were dropped for one cause; "" if not."""
    checks = [
        check
        for cause, check in _UNIT_CHECKS.items()
        if drops.count.get(cause, 0) > _MANY_DROPS_SHARE * log.rows
    ]
    return f": check {' and '.join(checks)} with --set log.columns=…" if checks else ""


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
    return f"{message}. {'; '.join(causes)}{unit_advice(log, drops)}" if causes else message


def explain_no_encounter(log: RawLog, pieces: Sequence[Piece], config: LogConfig) -> str:
    """Return the message on a log without encounters, with the parameter that would give one."""
    rule = (
        f"{log.segments[0].label}: no two vehicles are within {config.proximity:g} m for "
        f"{config.min_duration:g} s while one drives {config.travel:g} m"
    )
    near = [
        _approach(pieces[i], pieces[j], config) for i, j in near_pairs(pieces, 1, config.proximity)
    ]
    best = max(near, key=lambda pair: (pair.seconds, pair.driven_m, -pair.nearest_m), default=None)
    if best is None or best.seconds <= 0.0:
        nearest_m, i, j = _least(pieces, lambda a, b: float(distances(a, b).min()))
        if not math.isfinite(nearest_m):
            return f"{rule}: no two vehicles are recorded at the same time and place"
        return (
            f"{rule}. Vehicles {pieces[i].track.id} and {pieces[j].track.id} come closest, to "
            f"{nearest_m:.0f} m; {_proximity_advice(pieces, config)}"
        )
    fact = (
        f"{rule}. Vehicles {best.first} and {best.second} are within {config.proximity:g} m for "
        f"{best.seconds:.1f} s and come as near as {best.nearest_m:.0f} m"
    )
    if best.seconds < config.min_duration:
        seconds = math.floor(10.0 * best.seconds) / 10.0
        return f"{fact}; --set log.min_duration={seconds:g} accepts them"
    if best.driven_m < config.travel:
        return (
            f"{fact}, and the faster one drives {best.driven_m:.1f} m; "
            f"--set log.travel={math.floor(best.driven_m):g} accepts them"
        )
    return (
        f"{fact}, but not at the same time; --set log.proximity=… or log.longest_gap=… may "
        "accept them"
    )


def _approach(a: Piece, b: Piece, config: LogConfig) -> _Approach:
    """Return how long two pieces are near each other without a break."""
    distance = distances(a, b)
    begin = max(a.first, b.first)
    spans = runs(distance < config.proximity)
    first, last = max(spans, key=lambda span: span[1] - span[0], default=(0, 0))
    seconds = max(last - 1 - first, 0) * config.period
    farther = max(driven(piece, begin + first, begin + last, config) for piece in (a, b))
    return _Approach(seconds, farther, float(distance.min()), a.track.id, b.track.id)


def _least(
    pieces: Sequence[Piece], measure: Callable[[Piece, Piece], float]
) -> tuple[float, int, int]:
    """Return the least measure of two simultaneous pieces, and their numbers; infinite if none.

    The measure [m] is at least the least distance of the two pieces.
    """
    best = math.inf, 0, 0
    for i, others, bounds in simultaneous(pieces, 1):
        for k in np.argsort(bounds).tolist():
            if bounds[k] >= best[0]:
                break
            j = int(others[k])
            best = min(best, (measure(pieces[i], pieces[j]), min(i, j), max(i, j)))
    return best


def _proximity_advice(pieces: Sequence[Piece], config: LogConfig) -> str:
    """Return the proximity that would accept two vehicles."""
    n_ticks = ticks(config.min_duration, config)

    def needed_m(a: Piece, b: Piece) -> float:
        """Return the least bound within which two pieces stay for `n_ticks`."""
        distance = distances(a, b)
        if len(distance) <= n_ticks:
            return math.inf
        windows = sliding_window_view(np.pad(distance, 1, "edge"), n_ticks + 2)
        return float(windows.max(axis=1).min())

    reach = _least(pieces, needed_m)[0]
    if not math.isfinite(reach):
        return "no two vehicles are recorded together for that long"
    proximity = math.ceil(reach / 10.0 + 1e-9) * 10
    return f"--set log.proximity={proximity} accepts two"
