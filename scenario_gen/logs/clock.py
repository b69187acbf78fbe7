# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The clock of a log: counters that begin again, clocks that are set back, stamps before 1970.

The order of the rows shows when a clock is set back: stamps restart while the vehicle drives on,
so sorting them would put two motions into one time. The rows after such a step are moved to a
later time, after a gap, so that no encounter spans it. A counter that begins again is continued.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.geodesy import on_sphere
from scenario_gen.logs.raw import Observations, RawLog
from scenario_gen.numerics import Bools, Floats, Ints

_S_TO_NS = 10**9
_MAX_STAMP_NS = 2**62  # years 1823 to 2116: differences of two stamps fit into 64 bits
_COUNTERS_NS = (  # of 16 and 32 bits in ms, µs and ns; a minute, an hour, a day
    65_536_000_000,
    4_294_967_296_000_000,
    4_294_967_296_000,
    4_294_967_296,
    60 * _S_TO_NS,
    3_600 * _S_TO_NS,
    86_400 * _S_TO_NS,
)


@dataclass(frozen=True)
class StepLimits:
    """What tells a step of the clock from rows out of order.

    Attributes:
        min_row_count: rows on either side of a step; fewer are out of order.
        min_repeated_count: rows in the time that is recorded twice.
        slow_period_s: a slower source needs a single row only, if the next one follows in time.
        usual_step_ratio: longest step that follows in time, over the median step.
        max_standing_count: repeated stamps of a vehicle whose clock restarts.
        min_distance_m: distance of two places at one time that one vehicle cannot have.
        continuation_share: share of that distance within which the next row lies if the vehicle
            drives on and its clock does not.
        replay_share: share of the time before a step that is recorded again, as a new scene.
        min_replay_m: distance of a second drive from the first; nearer rows are copies.
    """

    min_row_count: int = 5
    min_repeated_count: int = 2
    slow_period_s: float = 0.4
    usual_step_ratio: float = 1.5
    max_standing_count: int = 3
    min_distance_m: float = 3.0
    continuation_share: float = 0.5
    replay_share: float = 0.5
    min_replay_m: float = 0.01


_STEP = StepLimits()


@dataclass(frozen=True)
class _ClockStep:
    """A step of the clock between two rows of the log.

    Attributes:
        before, after: stamps [ns].
        previous_row, row: of the log.
        period: of a counter that begins again [ns]; 0: the clock was set back.
    """

    before: int
    after: int
    previous_row: int
    row: int
    period: int


def is_out_of_range(stamps: Ints) -> Bools:
    """Return which stamps (T,) [ns] are so far from 1970 that their differences may overflow."""
    return (stamps < -_MAX_STAMP_NS) | (stamps > _MAX_STAMP_NS)


def retimed(log: RawLog, config: LogConfig) -> tuple[RawLog, list[str]]:
    """Return the log on a clock that increases, from 1970 on; and notes on what was shifted.

    Raises:
        InputError: the vehicles do not tell which of their rows follow a step of the clock.
    """
    notes = []
    by_vehicle = [list(_steps_of(vehicle, log)) for vehicle in log.vehicles]
    steps = sorted((s for steps in by_vehicle for s in steps), key=lambda step: step.row)
    if steps:
        parts = _parts(log, by_vehicle)
        n_parts = 1 + max(int(part.max(initial=0)) for pair in parts for part in pair)
        period = steps[0].period
        shifts = np.arange(n_parts) * period
        note = f"the time begins again after {period / _S_TO_NS:g} s: read as one clock"
        if not period or len({step.period for step in steps}) > 1:
            shifts = _shifts_in_turn(log, parts, n_parts, config)
            more = f" and {n_parts - 2} more times" if n_parts > 2 else ""
            note = (
                f"the clock steps from {steps[0].before / _S_TO_NS:.10g} to "
                f"{steps[0].after / _S_TO_NS:.10g} s at {log.where(steps[0].row)}{more}: later "
                "rows are read as a separate, later part"
            )
        log = _shifted(log, [(shifts[fixes], shifts[speeds]) for fixes, speeds in parts])
        notes.append(note)
    stamps = np.concatenate([vehicle.fix_ns for vehicle in log.vehicles] or [np.zeros(0, int)])
    first_ns = int(stamps[~is_out_of_range(stamps)].min(initial=0))
    if first_ns < 0:
        seconds = -(first_ns // _S_TO_NS)
        shift = np.array(seconds * _S_TO_NS)
        log = _shifted(log, [(shift, shift)] * len(log.vehicles))
        notes.append(f"times begin before 1970, or before an event: {seconds} s are added to all")
    return log, notes


def _shifted(log: RawLog, shifts: Sequence[tuple[Ints, Ints]]) -> RawLog:
    """Return the log with nanoseconds added to the stamps of each vehicle's fixes and speeds."""

    def add(stamps: Ints, shift: Ints) -> Ints:
        return np.where(is_out_of_range(stamps), stamps, stamps + shift)

    vehicles = tuple(
        replace(
            vehicle,
            fix_ns=add(vehicle.fix_ns, fix_shift),
            speed_ns=add(vehicle.speed_ns, speed_shift),
        )
        for vehicle, (fix_shift, speed_shift) in zip(log.vehicles, shifts, strict=True)
    )
    return replace(log, vehicles=vehicles)


def _steps_of(vehicle: Observations, log: RawLog) -> Iterator[_ClockStep]:
    """Yield where a vehicle's stamps go back while it is not where it was at those stamps."""
    x, y = vehicle.fix.T
    valid = np.isfinite(x) & np.isfinite(y) & ~is_out_of_range(vehicle.fix_ns)
    stamps = vehicle.fix_ns[valid]
    rows = vehicle.fix_row[valid].tolist()
    places = on_sphere(vehicle.fix[valid]) if log.geographic else vehicle.fix[valid]
    steps = np.diff(stamps)
    counts_repeats = (steps == 0).sum() <= _STEP.max_standing_count
    backward = np.flatnonzero((steps < 0) | ((steps == 0) & counts_repeats)) + 1
    edges = [0, *backward.tolist(), len(stamps)]
    for begin, row, end in zip(edges, edges[1:], edges[2:], strict=False):
        is_long = min(row - begin, end - row) >= _STEP.min_row_count
        if not is_long or log.segment(rows[row]) != log.segment(rows[row - 1]):
            continue
        period = _period_of(stamps, int(steps[row - 1]))
        part = slice(begin, end)
        if period or _is_clock_step(stamps[part], places[part], row - begin, steps):
            before, after = stamps[row - 1 : row + 1].tolist()
            yield _ClockStep(before, after, rows[row - 1], rows[row], period)


def _period_of(stamps: Ints, step: int) -> int:
    """Return the period [ns] of the counter that begins again with a step [ns]; 0: none does."""
    longest = 2.0 * float(np.median(np.abs(np.diff(stamps))))
    for period in _COUNTERS_NS:
        if 0 < step + period <= longest and stamps.min() >= 0 and stamps.max() < period:
            return period
    return 0


def _is_clock_step(stamps: Ints, places: Floats, row: int, all_steps: Ints) -> bool:
    """Return whether the clock was set back between two rows of a track.

    Args:
        stamps: (T,) [ns], increasing before and after the row.
        places: (T, D) [m].
        row: the first one after the step.
        all_steps: steps [ns] of the vehicle's stamps.
    """
    before = stamps[:row]
    is_repeated = (stamps[row:] <= before[-1]) & (stamps[row:] >= before[0])
    repeated = row + np.flatnonzero(is_repeated)
    usual_ns = float(np.median(all_steps))
    next_step = int(stamps[row + 1] - stamps[row]) if row + 1 < len(stamps) else 0
    continues = 0 < next_step < _STEP.usual_step_ratio * usual_ns
    is_slow = usual_ns > _STEP.slow_period_s * _S_TO_NS
    n_needed = 1 if continues and is_slow else _STEP.min_repeated_count
    if len(repeated) < n_needed:
        return False
    earlier = _interpolate(before, places[:row], stamps[repeated])
    distances = np.linalg.norm(places[repeated] - earlier, axis=1)
    distance = float(np.percentile(distances, 25))
    advance = float(np.linalg.norm(places[row] - places[row - 1]))
    if distance > _STEP.min_distance_m:
        return True
    is_replay = len(repeated) >= _STEP.replay_share * len(before)
    if is_replay and row > 2 * _STEP.min_row_count and distance > _STEP.min_replay_m:
        return True
    drives_on = advance < _STEP.continuation_share * distance
    return distance > _STEP.min_distance_m / 4.0 and drives_on


def _interpolate(stamps: Ints, places: Floats, wanted: Ints) -> Floats:
    """Return the places (K, D) of a vehicle at stamps (K,) [ns]."""
    seconds = (stamps - stamps[0]) / _S_TO_NS
    wanted_s = (wanted - stamps[0]) / _S_TO_NS
    return np.column_stack([np.interp(wanted_s, seconds, axis) for axis in places.T])


_Parts = list[tuple[Ints, Ints]]
"""Numbers of the parts between steps, for the fixes and the speeds of each vehicle."""


def _parts(log: RawLog, by_vehicle: Sequence[Sequence[_ClockStep]]) -> _Parts:
    """Return the parts: by the rows of a log that is sorted by time, else by each vehicle's steps.

    Raises:
        InputError: it is not sorted, and not every vehicle shows every step.
    """
    steps = [step for vehicle_steps in by_vehicle for step in vehicle_steps]
    rows = np.concatenate([vehicle.fix_row for vehicle in log.vehicles])
    stamps = np.concatenate([vehicle.fix_ns for vehicle in log.vehicles])
    order = np.argsort(rows, kind="stable")
    order = order[~is_out_of_range(stamps[order])]
    least_ns = min(step.before - step.after for step in steps) / 2
    edges = rows[order][1:][np.diff(stamps[order]) < -least_ns]
    between = [(step.previous_row, step.row) for step in steps]
    first, last = np.searchsorted(edges, between, side="right").T
    is_sorted = (last - first <= 1).all() and len(edges) <= len(set(first.tolist()))
    by_own_steps = [[step.row for step in vehicle_steps] for vehicle_steps in by_vehicle]
    starts = by_own_steps
    if is_sorted:
        starts = [edges.tolist() or max(by_own_steps, key=len)] * len(log.vehicles)
    elif len(set(map(len, starts))) > 1:
        raise InputError(
            f"{log.where(steps[0].row)}: the clock steps back, but not for every vehicle; cut "
            "the log there, or keep its rows in the order in which they were recorded"
        )
    return [
        (
            np.searchsorted(start, vehicle.fix_row, side="right"),
            np.searchsorted(start, vehicle.speed_row, side="right"),
        )
        for start, vehicle in zip(starts, log.vehicles, strict=True)
    ]


def _shifts_in_turn(log: RawLog, parts: _Parts, n_parts: int, config: LogConfig) -> Ints:
    """Return how far [ns] each part is moved, so that more than a bridged gap precedes it."""
    part = np.concatenate([fixes for fixes, _ in parts])
    stamps = np.concatenate([vehicle.fix_ns for vehicle in log.vehicles])
    valid = ~is_out_of_range(stamps)
    stamped = np.unique(part[valid])
    spans = [stamps[valid & (part == k)] for k in stamped]
    gap_ns = round((2.5 * config.longest_gap + 15.0) * _S_TO_NS)
    shifts = in_turn([(int(span.min()), int(span.max())) for span in spans], gap_ns)
    rows = np.searchsorted(stamped, np.arange(n_parts), side="right") - 1
    return np.asarray(shifts)[np.maximum(rows, 0)]


def in_turn(spans: Sequence[tuple[int, int]], gap_ns: int) -> list[int]:
    """Return by how many whole seconds [ns] spans are moved, so that each follows the last one.

    Args:
        spans: their first and last stamps [ns].
        gap_ns: between two of them, at least.
    """
    shifts = [0]
    end = spans[0][1]
    for first, last in spans[1:]:
        lag = end + gap_ns - first
        shifts.append(-(-lag // _S_TO_NS) * _S_TO_NS if lag > 0 else shifts[-1])
        end = last + shifts[-1]
    return shifts
