# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The clock of a log: stamps before 1970, and clocks that are set back or restart while recording.

The order of the rows shows when a clock is set back: stamps restart while the vehicle drives on,
so sorting them would put two motions into one time. The rows after such a step are moved to a
later time, after a gap, so that no encounter spans it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

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
_SAME_STEP_NS = 2_000_000_000  # steps of two vehicles that are this near are the same


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
        shared_share: share of the parts between steps in which several vehicles are recorded, if
            the rows are sorted by time.
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
    shared_share: float = 0.5


_STEP = StepLimits()


@dataclass(frozen=True)
class _ClockStep:
    """The stamps [ns] before and after a step of the clock, and the rows of the log around it."""

    before: int
    after: int
    previous_row: int
    row: int

    def matches(self, before: int, after: int) -> bool:
        """Return whether two stamps belong to this step."""
        near_before = abs(before - self.before) < _SAME_STEP_NS
        return near_before and abs(after - self.after) < _SAME_STEP_NS


def is_out_of_range(stamps: Ints) -> Bools:
    """Return which stamps (T,) [ns] are so far from 1970 that their differences may overflow."""
    return (stamps < -_MAX_STAMP_NS) | (stamps > _MAX_STAMP_NS)


def retimed(log: RawLog, config: LogConfig) -> tuple[RawLog, list[str]]:
    """Return the log on a clock that increases, from 1970 on; and notes on what was shifted."""
    log, notes = _unwrapped(log)
    by_vehicle = [_vehicle_steps(vehicle, log) for vehicle in log.vehicles]
    if any(by_vehicle):
        parts = _parts_by_row(log, by_vehicle) or _parts_by_vehicle(log, by_vehicle)
        log, n_parts = _parts_in_turn(log, parts, config)
        steps = sorted(
            (step for vehicle_steps in by_vehicle for step in vehicle_steps),
            key=lambda step: step.row,
        )
        more = f" and {n_parts - 2} more times" if n_parts > 2 else ""
        notes.append(
            f"the clock steps from {steps[0].before / _S_TO_NS:.10g} to "
            f"{steps[0].after / _S_TO_NS:.10g} s at {log.where(steps[0].row)}{more}: later rows "
            "are read as a separate, later part"
        )
    stamps = np.concatenate([vehicle.fix_ns for vehicle in log.vehicles] or [np.zeros(0, int)])
    first_ns = int(stamps[~is_out_of_range(stamps)].min(initial=0))
    if first_ns < 0:
        seconds = -(first_ns // _S_TO_NS)
        shift = np.array(seconds * _S_TO_NS)
        log = _shifted(log, [(shift, shift)] * len(log.vehicles))
        notes.append(f"times begin before 1970, or before an event: {seconds} s are added to all")
    return log, notes


def _unwrapped(log: RawLog) -> tuple[RawLog, list[str]]:
    """Return a log whose counter of time, or time of day, begins again, as one that grows."""
    steps = [np.diff(vehicle.fix_ns) for vehicle in log.vehicles if len(vehicle.fix_ns) > 2]
    backward = np.concatenate([step[step < 0] for step in steps] or [np.zeros(0, int)])
    forward = np.concatenate([step[step > 0] for step in steps] or [np.zeros(0, int)])
    if not len(backward) or not len(forward):
        return log, []
    usual_ns = 2.0 * float(np.median(forward))
    for period_ns in _COUNTERS_NS:
        is_wrap = (backward + period_ns > 0) & (backward + period_ns <= usual_ns)
        if not is_wrap.all():
            continue

        def shifts(stamps: Ints, period_ns: int = period_ns) -> Ints:
            turns = np.concatenate([[0], np.cumsum(np.diff(stamps) < -period_ns // 2)])
            return np.asarray(turns[: len(stamps)] * period_ns)

        log = _shifted(log, [(shifts(v.fix_ns), shifts(v.speed_ns)) for v in log.vehicles])
        return log, [f"the time begins again after {period_ns / _S_TO_NS:g} s: read as one clock"]
    return log, []


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


def _vehicle_steps(vehicle: Observations, log: RawLog) -> list[_ClockStep]:
    """Return where a vehicle's stamps go back while it is not where it was at those stamps."""
    valid = np.isfinite(vehicle.fix).all(axis=1) & ~is_out_of_range(vehicle.fix_ns)
    stamps = vehicle.fix_ns[valid]
    rows = vehicle.fix_row[valid]
    places = on_sphere(vehicle.fix[valid]) if log.geographic else vehicle.fix[valid]
    backward = _backward_rows(stamps)
    edges = np.concatenate([[0], backward, [len(stamps)]]).tolist()
    steps = []
    for begin, row, end in zip(edges, edges[1:], edges[2:], strict=False):
        is_long = min(row - begin, end - row) >= _STEP.min_row_count
        if not is_long or log.segment(int(rows[row])) != log.segment(int(rows[row - 1])):
            continue
        if _is_clock_step(stamps[begin:end], places[begin:end], row - begin, np.diff(stamps)):
            before, after = int(stamps[row - 1]), int(stamps[row])
            steps.append(_ClockStep(before, after, int(rows[row - 1]), int(rows[row])))
    return steps


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


def _backward_rows(stamps: Ints) -> Ints:
    """Return the rows whose stamps go back, or repeat if few do, in stamps (T,)."""
    step = np.diff(stamps)
    repeats = step == 0
    counts_repeats = repeats.sum() <= _STEP.max_standing_count
    return np.flatnonzero((step < 0) | (repeats & counts_repeats)) + 1


def _interpolate(stamps: Ints, places: Floats, wanted: Ints) -> Floats:
    """Return the places (K, D) of a vehicle at stamps (K,) [ns]."""
    seconds = (stamps - stamps[0]) / _S_TO_NS
    wanted_s = (wanted - stamps[0]) / _S_TO_NS
    return np.column_stack([np.interp(wanted_s, seconds, axis) for axis in places.T])


_Parts = list[tuple[Ints, Ints]]
"""Numbers of the parts between steps, for the fixes and the speeds of each vehicle."""


def _parts_by_row(log: RawLog, by_vehicle: Sequence[Sequence[_ClockStep]]) -> _Parts | None:
    """Return the parts if the log is sorted by time between steps of a common clock, else None.

    A step is then a row, for all vehicles, wherever each of them is recorded next.
    """
    rows = np.concatenate([vehicle.fix_row for vehicle in log.vehicles])
    stamps = np.concatenate([vehicle.fix_ns for vehicle in log.vehicles])
    owner = np.repeat(
        np.arange(len(log.vehicles)), [len(vehicle.fix_row) for vehicle in log.vehicles]
    )
    order = np.argsort(rows, kind="stable")
    steps = [step for vehicle_steps in by_vehicle for step in vehicle_steps]
    least_ns = min(step.before - step.after for step in steps) / 2
    backward = np.flatnonzero(np.diff(stamps[order]) < -max(least_ns, 0)) + 1
    part = np.searchsorted(backward, np.arange(len(order)), side="right")
    pairs = np.unique(np.column_stack([part, owner[order]]), axis=0)
    n_vehicles = np.bincount(pairs[:, 0])
    if (n_vehicles > 1).mean() < _STEP.shared_share:
        return None
    edges = rows[order][backward]
    is_step = np.zeros(len(edges), dtype=bool)
    for step in steps:
        first, last = np.searchsorted(edges, (step.previous_row, step.row), side="right")
        if first == last:
            return None
        is_step[first:last] = True
    starts = edges[is_step]
    return [
        (
            np.searchsorted(starts, vehicle.fix_row, side="right"),
            np.searchsorted(starts, vehicle.speed_row, side="right"),
        )
        for vehicle in log.vehicles
    ]


def _parts_by_vehicle(log: RawLog, by_vehicle: Sequence[Sequence[_ClockStep]]) -> _Parts:
    """Return the parts if each vehicle has rows of its own: its steps are counted.

    A vehicle whose stamps show none of the steps is divided by the rows of the steps.
    """
    steps = sorted(
        (step for vehicle_steps in by_vehicle for step in vehicle_steps), key=lambda step: step.row
    )
    distinct: list[_ClockStep] = []
    for step in steps:
        if not any(known.matches(step.before, step.after) for known in distinct):
            distinct.append(step)
    rows = [step.row for step in distinct]

    def part_of(stamps: Ints, row: Ints) -> Ints:
        starts = [
            k
            for k in _backward_rows(stamps).tolist()
            if any(step.matches(int(stamps[k - 1]), int(stamps[k])) for step in distinct)
        ]
        if starts:
            return np.searchsorted(starts, np.arange(len(stamps)), side="right")
        return np.searchsorted(rows, row, side="right")

    return [
        (
            part_of(vehicle.fix_ns, vehicle.fix_row),
            part_of(vehicle.speed_ns, vehicle.speed_row),
        )
        for vehicle in log.vehicles
    ]


def _parts_in_turn(log: RawLog, parts: _Parts, config: LogConfig) -> tuple[RawLog, int]:
    """Return the log with each part moved later, by more than a bridged gap; and their number."""
    gap_ns = round((2.5 * config.longest_gap + 15.0) * _S_TO_NS)
    n_parts = 1 + max(int(fixes.max(initial=0)) for fixes, _ in parts)
    n_parts = max(n_parts, 1 + max(int(speeds.max(initial=0)) for _, speeds in parts))
    firsts = np.full(n_parts, np.iinfo(np.int64).max)
    lasts = np.full(n_parts, np.iinfo(np.int64).min)
    for vehicle, (part, _) in zip(log.vehicles, parts, strict=True):
        valid = ~is_out_of_range(vehicle.fix_ns)
        np.minimum.at(firsts, part[valid], vehicle.fix_ns[valid])
        np.maximum.at(lasts, part[valid], vehicle.fix_ns[valid])
    shifts = [0]
    last_ns: int | None = None
    for k, (first, last) in enumerate(zip(firsts.tolist(), lasts.tolist(), strict=True)):
        if k:
            shifts.append(shifts[-1])
        if first > last:
            continue  # no fix is in this part
        if last_ns is not None:
            lag_ns = last_ns + gap_ns - first
            whole_seconds = -(-lag_ns // _S_TO_NS)
            shifts[-1] = whole_seconds * _S_TO_NS if lag_ns > 0 else shifts[-1]
        last_ns = last + shifts[-1]
    by_part = np.array(shifts)
    return _shifted(log, [(by_part[fixes], by_part[speeds]) for fixes, speeds in parts]), n_parts
