# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The clock of a log: stamps before 1970, and clocks that are set back or start anew while the log is written.

A log's order shows when a clock is set back: stamps begin anew while the vehicle drives on, so that sorting them would put two
motions in one time. What follows is read as later, after a gap, so that no encounter reaches across.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.geodesy import on_sphere
from scenario_gen.logs.raw import Observations, RawLog
from scenario_gen.numerics import Bools, Floats, Ints

LATEST_NS = 2**62  # years 1823 to 2116: so the difference of any two stamps fits in 64 bits
ROWS = 5  # on either side of a step: fewer are rows out of order
LONGER = {"min": 60.0, "h": 3600.0, "d": 86400.0}  # units of time, in s
QUICKEST_S, SOURCE_S = (
    0.005,
    (0.02, 2.0),
)  # s between fixes: less is another unit's; and what is usual
LEAST = 2  # rows in the time that is there twice
SLOW_S = 0.4  # s between fixes: of a slower source a single row counts, if the next follows after a usual step, and so does a
USUAL, FEW = (
    1.5,
    3,
)  # stamp that stands: a usual step is so many medians at most; stamps of a vehicle that stand, at most
APART_M = 3.0  # m between two places at one time: not one vehicle
ONWARD_SHARE = 0.5  # share of that distance within which the next row lies, if the vehicle drives on and its clock does not
SAME_NS = 2_000_000_000  # steps of two vehicles this near are one


@dataclass(frozen=True)
class _Step:
    """The stamps [ns] before and after a step of the clock, and the row of the log after it."""

    before: int
    after: int
    row: int


def beyond(stamps: Ints) -> Bools:
    """Return which stamps (T,) [ns] are so far from 1970 that differences of them may overflow."""
    return (stamps < -LATEST_NS) | (stamps > LATEST_NS)


def retimed(log: RawLog, config: LogConfig) -> tuple[RawLog, tuple[str, ...]]:
    """Return a log whose clock runs on, from 1970 on; and notes on what was shifted."""
    notes = []
    steps = _steps(log)
    if steps:
        log = _run_on(log, steps, config)
        more = f" and {len(steps) - 1} more times" if len(steps) > 1 else ""
        notes.append(
            f"the clock starts anew, from {steps[0].before * 1e-9:.10g} to {steps[0].after * 1e-9:.10g} s, at "
            f"{log.where(steps[0].row)}{more}: what follows is read as later, and apart"
        )
    first = min(
        (int(own.fix_ns[~beyond(own.fix_ns)].min(initial=0)) for own in log.vehicles), default=0
    )
    if first < 0:
        seconds = -(first // 10**9)
        log = _shifted(
            log,
            [
                (own.fix_ns * 0 + seconds * 10**9, own.speed_ns * 0 + seconds * 10**9)
                for own in log.vehicles
            ],
        )
        notes.append(f"times begin before 1970, or before an event: {seconds} s are added to all")
    return log, tuple(notes)


def check_unit(log: RawLog, config: LogConfig) -> None:
    """Refuse a log that is too short for any encounter, and would not be if its time were in minutes, hours or days.

    Raises:
        InputError: it is; the message names the unit.
    """
    stamps = [np.sort(own.fix_ns[~beyond(own.fix_ns)]) * 1e-9 for own in log.vehicles]
    steps = np.concatenate([np.zeros(0), *map(np.diff, stamps)])
    typical = float(np.median(steps)) if len(steps) else np.inf
    span = max((float(np.ptp(own)) for own in stamps if len(own)), default=0.0)
    for unit, seconds in LONGER.items() if typical < QUICKEST_S else ():
        if (
            span < config.min_duration < span * seconds
            and SOURCE_S[0] < typical * seconds < SOURCE_S[1]
        ):
            raise InputError(
                f"{log.segments[0].label}: all lasts {span:g} s, positions are {typical:g} s apart (median); the time may be in "
                f"{unit}: --set log.columns=time=<column>:{unit}"
            )


def _shifted(log: RawLog, by: Sequence[tuple[Ints, Ints]]) -> RawLog:
    """Return the log with nanoseconds added to the fixes' and the speeds' stamps of each vehicle; wild ones stay."""
    vehicles = tuple(
        replace(
            own,
            fix_ns=np.where(beyond(own.fix_ns), own.fix_ns, own.fix_ns + fixes),
            speed_ns=np.where(beyond(own.speed_ns), own.speed_ns, own.speed_ns + speeds),
        )
        for own, (fixes, speeds) in zip(log.vehicles, by, strict=True)
    )
    return replace(log, vehicles=vehicles)


def _steps(log: RawLog) -> list[_Step]:
    """Return the steps of the log's clock, in the log's order, each once."""
    found: list[_Step] = []
    for own in log.vehicles:
        for step in _own_steps(own, log):
            if not any(_is_same(step.before, step.after, other) for other in found):
                found.append(step)
    return sorted(found, key=lambda step: step.row)


def _is_same(before: int, after: int, step: _Step) -> bool:
    return abs(before - step.before) < SAME_NS and abs(after - step.after) < SAME_NS


def _own_steps(own: Observations, log: RawLog) -> list[_Step]:
    """Return where a vehicle's stamps go back while it is at another place than it was at those stamps."""
    sound = np.isfinite(own.fix).all(axis=1) & ~beyond(own.fix_ns)
    stamps, rows, fix = own.fix_ns[sound], own.fix_row[sound], own.fix[sound]
    back = _backs(stamps)
    if not len(back):
        return []
    usual = float(np.median(np.diff(stamps)))
    edges = np.concatenate([[0], back, [len(stamps)]])
    places = on_sphere(fix) if log.geographic else fix
    steps = []
    for at, begin, end in zip(back.tolist(), edges[:-2].tolist(), edges[2:].tolist(), strict=True):
        if min(at - begin, end - at) < ROWS or log.segment(int(rows[at])) != log.segment(
            int(rows[at - 1])
        ):
            continue
        again = at + np.flatnonzero(
            (stamps[at:end] <= stamps[at - 1]) & (stamps[at:end] >= stamps[begin])
        )
        onwards = at + 1 < end and 0 < stamps[at + 1] - stamps[at] < USUAL * usual
        if len(again) < LEAST and not (onwards and usual > SLOW_S * 1e9):
            continue
        then = _at(stamps[begin:at], places[begin:at], stamps[again])
        apart = float(np.percentile(np.linalg.norm(places[again] - then, axis=1), 25))
        onward = float(np.linalg.norm(places[at] - places[at - 1]))
        if apart > APART_M or (apart > APART_M / 4.0 and onward < ONWARD_SHARE * apart):
            steps.append(_Step(int(stamps[at - 1]), int(stamps[at]), int(rows[at])))
    return steps


def _backs(stamps: Ints) -> Ints:
    """Return where stamps (T,) go back, or stand if they seldom do."""
    step = np.diff(stamps)
    return np.flatnonzero((step < 0) | ((step == 0) & ((step == 0).sum() <= FEW))) + 1


def _at(stamps: Ints, places: Floats, when: Ints) -> Floats:
    """Return where a vehicle was (K, D) at stamps (K,)."""
    seconds = (stamps - stamps[0]) * 1e-9
    return np.column_stack(
        [np.interp((when - stamps[0]) * 1e-9, seconds, axis) for axis in places.T]
    )


def _run_on(log: RawLog, steps: list[_Step], config: LogConfig) -> RawLog:
    """Return the log with what comes after each step later than all before it, by more than any gap that is bridged."""

    def eras(stamps: Ints, rows: Ints) -> Ints:
        back = _backs(stamps)
        same = [
            [i for i in back.tolist() if _is_same(int(stamps[i - 1]), int(stamps[i]), step)]
            for step in steps
        ]
        own = sorted({i[0] for i in same if i})
        if own:
            return np.searchsorted(own, np.arange(len(stamps)), side="right")
        return np.searchsorted(
            [step.row for step in steps], rows, side="right"
        )  # it comes or goes with the step

    era = [
        (eras(own.fix_ns, own.fix_row), eras(own.speed_ns, own.speed_row)) for own in log.vehicles
    ]
    gap, shift, last = round((2.5 * config.longest_gap + 15.0) * 1e9), [0], None
    for k in range(len(steps) + 1):
        own_ns = [
            v.fix_ns[(which == k) & ~beyond(v.fix_ns)]
            for v, (which, _) in zip(log.vehicles, era, strict=True)
        ]
        stamps = np.concatenate(own_ns)
        if last is not None:
            later = last + gap - int(stamps.min(initial=last + gap))
            shift.append(-(-later // 10**9) * 10**9 if later > 0 else shift[-1])
        last = int(stamps.max(initial=0)) + shift[-1] if len(stamps) else last
    by = np.array(shift)
    return _shifted(log, [(by[fixes], by[speeds]) for fixes, speeds in era])
