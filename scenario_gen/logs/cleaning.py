# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Cleaning: impossible values are dropped and counted; the rest is sorted by time, in metres."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import chain
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from scenario_gen.base.errors import InputError
from scenario_gen.logs.clock import is_out_of_range
from scenario_gen.logs.config import chosen_vehicles, LogConfig
from scenario_gen.logs.geodesy import local_frame, middle_of, on_sphere, parse_origin, sites_of
from scenario_gen.logs.kinds import with_sizes
from scenario_gen.logs.quality import Dropped
from scenario_gen.logs.raw import Observations, RawLog
from scenario_gen.numerics import Bools, Floats, Ints


@dataclass(frozen=True)
class CleaningLimits:
    """Bounds that tell measurements from errors.

    Attributes:
        max_period_s: longest median time between fixes: a slower source does not show how a
            vehicle drives, or its unit of time is wrong.
        max_coordinate_m: a quarter of the way to the moon; no frame's origin is farther.
        max_speed_mps: no road vehicle is faster (an SPMD unit sends 163.8 for "unknown").
        jump_slack_m: distance by which a fix may exceed what the speeds allow: GPS noise.
        jump_slack_mps: possible error of a measured speed before a fix counts as a jump.
        moving_mps: above this speed, a vehicle changes its position between fixes.
        min_speed_share: share of a measured speed that the positions of a moving vehicle confirm
            at least, in whatever unit the speed is.
        relocation_count: fixes in a row that agree with each other and are then a new place.
        reversed_share: of the steps of time that go back if the newest rows come first.
        min_first_jump_m: from 0, 0 to the first real place.
    """

    max_period_s: float = 5.0
    max_coordinate_m: float = 1e8
    max_speed_mps: float = 70.0
    jump_slack_m: float = 3.0
    jump_slack_mps: float = 10.0
    moving_mps: float = 1.0
    min_speed_share: float = 0.2
    relocation_count: int = 5
    reversed_share: float = 0.95
    min_first_jump_m: float = 10.0


CLEANING = CleaningLimits()


class Cause(Enum):
    """Why rows are dropped or sorted; the value is for people."""

    STAMP_OUT_OF_RANGE = "stamp is out of range"
    STAMP_DISORDER = "stamp out of order (sorted)"
    STAMP_REPEATED = "stamp repeated"
    NO_POSITION = "position is not a number"
    ZERO_POSITION = "position is (0, 0)"
    NOT_ON_EARTH = "position is not on Earth"
    REPEATED_POSITION = "position repeated while the vehicle moves (the first is kept)"
    JUMP = "position jumps"
    NO_SPEED = "speed is not a number"
    NEGATIVE_SPEED = "speed is negative"
    SPEED_TOO_HIGH = f"speed is above {CLEANING.max_speed_mps:g} m/s"


@dataclass(frozen=True)
class StampConflict:
    """`count` rows with the stamp of another row elsewhere; `is_coarse` if they continue it."""

    count: int
    is_coarse: bool


@dataclass
class Drops:
    """Dropped rows by cause: their number, and the first of them; notes on what was replaced.

    The causes of readers are texts. Stamps that repeat at other places are listed by vehicle.
    """

    count: dict[Cause | str, int] = field(default_factory=dict)
    first: dict[Cause | str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    conflicts: dict[str, StampConflict] = field(default_factory=dict)

    def add(self, cause: Cause | str, rows: Ints) -> None:
        """Count rows (K,) of the log as dropped."""
        if len(rows):
            self.count[cause] = self.count.get(cause, 0) + len(rows)
            self.first[cause] = min(self.first.get(cause, int(rows[0])), int(rows.min()))

    def located(self, log: RawLog) -> tuple[Dropped, ...]:
        """Return the causes with numbers of rows and places in the log."""
        return tuple(
            Dropped(
                cause.value if isinstance(cause, Cause) else cause,
                count,
                log.where(self.first[cause]),
            )
            for cause, count in self.count.items()
        )


def _chosen_tracks(log: RawLog, config: LogConfig) -> Iterable[Observations]:
    """Return the tracks of the chosen vehicles, in the order of `chosen_vehicles`."""
    by_id: dict[str, list[Observations]] = {}
    for vehicle in log.vehicles:
        by_id.setdefault(vehicle.id, []).append(vehicle)
    names = chosen_vehicles(list(by_id), config, log.name)
    return chain.from_iterable(by_id[name] for name in names)


def clean(log: RawLog, config: LogConfig) -> tuple[tuple[Observations, ...], Drops]:
    """Drop impossible values and project every vehicle into a local frame.

    Returns:
        The vehicles with at least two fixes, in metres, with strictly increasing stamps, without
        NaN except in headings, once for each site (`in_metres`); and the drops.

    Raises:
        InputError: nothing usable is left, or `strict` is set and a row needs repair.
    """
    drops = Drops()
    for cause, row in log.dropped:
        drops.add(cause, np.array([row]))
    tracks = _chosen_tracks(log, config)
    vehicles = [_without_invalid(track, log.geographic, drops) for track in tracks]

    first_ns, last_ns = _time_window(vehicles, log, drops, config)
    vehicles = [_in_window(vehicle, first_ns, last_ns) for vehicle in vehicles]
    if not any(len(vehicle.fix_ns) for vehicle in vehicles):
        raise InputError(
            f"{log.name}: no position between {config.start:g} s and {config.end:g} s; "
            "change --set log.start=… or log.end=…"
        )
    vehicles = [_in_order(vehicle, log, drops) for vehicle in vehicles]
    vehicles = [_without_repeats(vehicle, drops, log.geographic) for vehicle in vehicles]
    _check_clock(vehicles, log, config)
    vehicles = [_without_jumps(vehicle, drops, log.geographic) for vehicle in vehicles]
    vehicles, size_notes = with_sizes(vehicles, log, config)
    drops.notes += size_notes
    if config.strict and drops.count:
        worst = drops.located(log)[0]
        raise InputError(
            f"{worst.first}: {worst.reason} ({worst.count} such rows), and strict is set"
        )
    if log.geographic:
        vehicles = in_metres(vehicles, config)
    return tuple(vehicle for vehicle in vehicles if len(vehicle.fix_ns) >= 2), drops


def _without_invalid(vehicle: Observations, geographic: bool, drops: Drops) -> Observations:
    """Return the observations without impossible positions and speeds."""
    fix = vehicle.fix
    speed = vehicle.speed
    position_checks: dict[Cause, Any] = {
        Cause.STAMP_OUT_OF_RANGE: is_out_of_range(vehicle.fix_ns),
        Cause.NO_POSITION: ~(np.isfinite(fix[:, 0]) & np.isfinite(fix[:, 1])),
        Cause.ZERO_POSITION: is_before_fix(fix),
    }
    x, y = np.abs(fix).T
    limits = (CLEANING.max_coordinate_m,) * 2
    if geographic:
        position_checks[Cause.ZERO_POSITION] = (x < 1e-6) & (y < 1e-6)
        limits = (90.0, 180.0)
    position_checks[Cause.NOT_ON_EARTH] = (x > limits[0]) | (y > limits[1])
    speed_checks: dict[Cause, Any] = {
        Cause.STAMP_OUT_OF_RANGE: is_out_of_range(vehicle.speed_ns),
        Cause.NO_SPEED: ~np.isfinite(speed),
        Cause.NEGATIVE_SPEED: speed < 0.0,
        Cause.SPEED_TOO_HIGH: speed > CLEANING.max_speed_mps,
    }
    valid_fix = _passing(position_checks, vehicle.fix_row, drops)
    return select(vehicle, valid_fix, _passing(speed_checks, vehicle.speed_row, drops))


def is_before_fix(fix: Floats) -> Bools:
    """Return which positions (F, 2) [m] are 0, 0 at the start, until they jump to a real place."""
    is_zero = (fix[:, 0] == 0.0) & (fix[:, 1] == 0.0)
    n_zeros = int(np.argmin(is_zero)) if not is_zero.all() else 0
    is_far = n_zeros and np.hypot(*fix[n_zeros]) > CLEANING.min_first_jump_m
    return np.asarray(np.arange(len(fix)) < (n_zeros if is_far else 0))


def _no_fix_hint(log: RawLog) -> str:
    """Return that receivers had no fix, if a log has no latitude and longitude at all."""
    is_known = log.geographic and any(np.isfinite(v.fix).all(axis=1).any() for v in log.vehicles)
    is_empty = log.geographic and not is_known
    return "; the receivers had no fix, or the fields are empty" if is_empty else ""


def _passing(checks: Mapping[Cause, Any], rows: Ints, drops: Drops) -> Bools:
    """Return which rows (T,) pass all checks (T,); a row counts once, for its first cause."""
    passing = np.ones(len(rows), dtype=bool)
    for cause, is_bad in checks.items():
        drops.add(cause, rows[passing & is_bad])
        passing &= ~is_bad
    return passing


def select(
    vehicle: Observations, fixes: Bools | Ints, speeds: Bools | Ints | None = None
) -> Observations:
    """Return the vehicle with the chosen observations only, in the given order.

    Args:
        vehicle: the observations.
        fixes: flags (F,) or indices.
        speeds: flags (S,) or indices; None: all.
    """
    chosen = replace(
        vehicle,
        fix_ns=vehicle.fix_ns[fixes],
        fix=vehicle.fix[fixes],
        fix_row=vehicle.fix_row[fixes],
        heading=vehicle.heading[fixes],
        height=None if vehicle.height is None else vehicle.height[fixes],
        ego=None if vehicle.ego is None else vehicle.ego[fixes],
    )
    if speeds is None:
        return chosen
    return replace(
        chosen,
        speed_ns=vehicle.speed_ns[speeds],
        speed=vehicle.speed[speeds],
        speed_row=vehicle.speed_row[speeds],
        course=None if vehicle.course is None else vehicle.course[speeds],
    )


def _time_window(
    vehicles: Sequence[Observations], log: RawLog, drops: Drops, config: LogConfig
) -> tuple[int, int]:
    """Return the first and the last stamp of the requested window [ns].

    Raises:
        InputError: there is no usable position, or the window is empty.
    """
    stamps = np.concatenate([vehicle.fix_ns for vehicle in vehicles])
    if not len(stamps):
        causes = "; ".join(map(str, drops.located(log)))
        raise InputError(
            f"{log.segments[0].label}: no usable position in {log.rows} rows"
            + (f" ({causes})" if causes else "")
            + _no_fix_hint(log)
            + "; check the columns and their units" * bool(log.columns)
        )
    first_ns = int(stamps.min())
    last_ns = int(stamps.max())
    if config.end and config.end <= config.start:
        raise InputError(
            f"parameter end is {config.end:g} s; it must be after start ({config.start:g} s), or 0"
        )
    if config.start * 1e9 > last_ns - first_ns:
        raise InputError(
            f"parameter start is {config.start:g} s, but {log.name} is only "
            f"{(last_ns - first_ns) * 1e-9:.1f} s long"
        )
    end_ns = first_ns + round(config.end * 1e9) if config.end else last_ns
    return first_ns + round(config.start * 1e9), end_ns


def _in_window(vehicle: Observations, first_ns: int, last_ns: int) -> Observations:
    """Return the vehicle's observations between two stamps."""
    fixes = (vehicle.fix_ns >= first_ns) & (vehicle.fix_ns <= last_ns)
    speeds = (vehicle.speed_ns >= first_ns) & (vehicle.speed_ns <= last_ns)
    return select(vehicle, fixes, speeds)


def in_metres(vehicles: Sequence[Observations], config: LogConfig) -> list[Observations]:
    """Project latitude and longitude to east and north.

    The origin is the parameter `origin`, or else the middle of the site. Sites are groups of fixes
    far from each other (`geodesy.sites_of`): each has its own frame. A vehicle that is recorded at
    two sites is returned once for each.
    """
    fixes = np.concatenate([vehicle.fix for vehicle in vehicles])
    if config.origin:
        site = np.zeros(len(fixes), dtype=np.int64)
        origins = [parse_origin(config.origin)]
    else:
        site = sites_of(fixes)
        origins = [
            middle_of(fixes[site == k], left_out=5.0, digits=5) for k in range(int(site.max()) + 1)
        ]
    ends = np.cumsum([len(vehicle.fix) for vehicle in vehicles])
    projected = []
    for vehicle, fix_site in zip(vehicles, np.split(site, ends[:-1]), strict=True):
        if not len(fix_site):
            continue
        next_fix = np.searchsorted(vehicle.fix_ns, vehicle.speed_ns)
        speed_site = fix_site[np.clip(next_fix, 0, len(fix_site) - 1)]
        for k in np.unique(fix_site):
            part = select(vehicle, fix_site == k, speed_site == k)
            fix = local_frame(part.fix[:, 0], part.fix[:, 1], origins[k])
            projected.append(replace(part, fix=fix, origin=origins[k]))
    return projected


def _in_order(vehicle: Observations, log: RawLog, drops: Drops) -> Observations:
    """Sort by stamp and drop repeated stamps.

    Raises:
        InputError: half of the stamps run backwards, or most repeat.
    """
    steps = np.diff(vehicle.fix_ns)
    backward = np.flatnonzero(steps < 0) + 1
    n_repeated = int((steps == 0).sum())
    if len(steps) >= 4 and (len(backward) > len(steps) / 2 or n_repeated > 0.9 * len(steps)):
        row = vehicle.fix_row[backward[0] if len(backward) else 1]
        fault = f"stands still {n_repeated} times"
        if len(backward):
            fault = f"runs backwards {len(backward)} times"
        raise InputError(
            f"{log.where(int(row))}: the clock of vehicle {vehicle.id} {fault} in {len(steps)} "
            "rows; check the time column"
        )
    drops.add(Cause.STAMP_DISORDER, vehicle.fix_row[backward])
    if len(vehicle.speed_row) != len(vehicle.fix_row):  # else rows have both, and count once
        speed_backward = np.flatnonzero(np.diff(vehicle.speed_ns) < 0) + 1
        only_speeds = np.setdiff1d(speed_backward, backward)
        drops.add(Cause.STAMP_DISORDER, vehicle.speed_row[only_speeds])

    _, first_fixes = np.unique(vehicle.fix_ns, return_index=True)
    _, first_speeds = np.unique(vehicle.speed_ns, return_index=True)
    repeated = np.delete(np.arange(len(vehicle.fix_ns)), first_fixes)
    drops.add(Cause.STAMP_REPEATED, vehicle.fix_row[repeated])
    if len(repeated):
        _note_conflicts(vehicle, first_fixes, repeated, drops, geographic=log.geographic)
    return select(vehicle, first_fixes, first_speeds)


def _note_conflicts(
    vehicle: Observations, kept: Ints, repeated: Ints, drops: Drops, *, geographic: bool
) -> None:
    """Note the repeated stamps at whose time the vehicle is elsewhere.

    Args:
        vehicle: observations in the order of the log.
        kept: rows (K,) of the different stamps, in order of the stamps.
        repeated: rows of the others.
        drops: receives the note.
        geographic: whether positions are degrees.
    """
    places = on_sphere(vehicle.fix) if geographic else vehicle.fix
    first = kept[np.searchsorted(vehicle.fix_ns[kept], vehicle.fix_ns[repeated])]
    offset = np.linalg.norm(places[repeated] - places[first], axis=1)
    count = int((offset > CLEANING.jump_slack_m).sum())
    if count:
        advance = np.linalg.norm(places[repeated] - places[repeated - 1], axis=1)
        is_coarse = bool(np.median(advance) < CLEANING.jump_slack_m)
        drops.conflicts[vehicle.id] = StampConflict(count, is_coarse)


def _without_repeats(vehicle: Observations, drops: Drops, geographic: bool) -> Observations:
    """Drop positions that repeat while the vehicle moves: they are not measurements.

    It moves if its measured speeds say so and the next new position confirms them; without speeds,
    if the steps between new positions are as fast as a vehicle, including the repeats.
    """
    is_repeat = np.concatenate([[False], (np.diff(vehicle.fix, axis=0) == 0.0).all(axis=1)])
    new = np.flatnonzero(~is_repeat)
    if not is_repeat.any() or len(new) < 2:
        return vehicle
    places = on_sphere(vehicle.fix[new]) if geographic else vehicle.fix[new]
    seconds = np.diff(vehicle.fix_ns[new]) * 1e-9
    rate = np.linalg.norm(np.diff(places, axis=0), axis=1) / seconds
    if len(vehicle.speed_ns) >= 2:
        speed = np.interp(vehicle.fix_ns, vehicle.speed_ns, vehicle.speed)
        counts = np.diff(np.append(new, len(is_repeat)))
        mean_speed = np.add.reduceat(speed, new) / counts
        advances = rate > CLEANING.min_speed_share * mean_speed[:-1]
        is_moving = speed > CLEANING.moving_mps
    else:
        previous_rate = np.insert(rate[:-1], 0, rate[0])
        advances = np.minimum(rate, previous_rate) > 2.0 * CLEANING.moving_mps
        is_moving = np.ones(len(is_repeat), dtype=bool)
    has_repeats = (advances & (np.diff(new) > 1)).any()
    advances = np.append(advances, has_repeats)  # nothing follows the last new position
    is_held = is_repeat & is_moving & advances[np.cumsum(~is_repeat) - 1]
    drops.add(Cause.REPEATED_POSITION, vehicle.fix_row[is_held])
    return select(vehicle, ~is_held)


def _check_clock(vehicles: Sequence[Observations], log: RawLog, config: LogConfig) -> None:
    """Check that the common clock has at most `tick_limit` ticks, and the likely unit of time.

    The clock has a tick for every period in which a vehicle is recorded; smoothing needs memory
    for each.

    Args:
        vehicles: observations with stamps in order.
        log: names the places.
        config: names limit and period.

    Raises:
        InputError: the clock is too long, or the fixes are too far apart in time.
    """
    vehicles = [vehicle for vehicle in vehicles if len(vehicle.fix_ns) >= 2]
    if not vehicles:
        return
    steps = np.concatenate([np.diff(vehicle.fix_ns) for vehicle in vehicles])
    period = float(np.median(steps)) * 1e-9
    if period > max(CLEANING.max_period_s, config.longest_gap):
        raise InputError(
            f"{log.where(int(vehicles[0].fix_row[1]))}: positions are {period:g} s apart "
            f"(median); a track needs at most {CLEANING.max_period_s:g} s; check the unit of time"
        )
    spans = [_covered_ns(np.diff(vehicle.fix_ns), config) for vehicle in vehicles]
    n_ticks = round(sum(spans) / (config.period * 1e9))
    if n_ticks > config.tick_limit:
        longest = vehicles[int(np.argmax(spans))]
        raise InputError(
            f"{log.where(int(longest.fix_row[0]))}: vehicle {longest.id[:50]} and others are "
            f"recorded for {n_ticks} ticks of {config.period:g} s (limit {config.tick_limit}): "
            "cut the log (log.start, log.end), or raise --set log.tick_limit=…"
        )


def _covered_ns(steps: Ints, config: LogConfig) -> int:
    """Return the time in which a vehicle is recorded without long gaps; its track is cut there."""
    longest_s = max(config.longest_gap, 2.5 * CLEANING.max_period_s)
    return int(steps[steps <= longest_s * 1e9].sum())


def newest_last(log: RawLog) -> RawLog:
    """Return a log in order of time if its rows are from the newest to the oldest, with a note."""
    steps = [np.diff(vehicle.fix_ns) for vehicle in log.vehicles if len(vehicle.fix_ns) > 2]
    if not steps or (np.concatenate(steps) < 0).mean() < CLEANING.reversed_share:
        return log
    vehicles = tuple(
        select(v, np.arange(len(v.fix_ns))[::-1], np.arange(len(v.speed_ns))[::-1])
        for v in log.vehicles
    )
    return replace(log, vehicles=vehicles, notes=(*log.notes, "the newest rows come first"))


def _without_jumps(vehicle: Observations, drops: Drops, geographic: bool) -> Observations:
    """Drop fixes that the measured speeds do not allow, except several in a row that agree."""
    places = on_sphere(vehicle.fix) if geographic else vehicle.fix
    step = np.linalg.norm(np.diff(places, axis=0), axis=1)
    seconds = vehicle.fix_ns.astype(np.float64) * 1e-9
    step_s = np.diff(vehicle.fix_ns) * 1e-9
    speed_limit = _max_speeds(vehicle, step / step_s)
    if not (step > CLEANING.jump_slack_m + speed_limit[1:] * step_s).any():
        return vehicle
    reachable = _reachable(seconds, places, speed_limit)
    drops.add(Cause.JUMP, vehicle.fix_row[~reachable])
    return select(vehicle, reachable)


def _max_speeds(vehicle: Observations, rates: Floats) -> Floats:
    """Return the highest possible speeds (F,) [m/s] at the fixes, by speeds or agreeing fixes."""
    if len(vehicle.speed_ns) < 2:
        return np.full(len(vehicle.fix_ns), CLEANING.max_speed_mps)
    measured = np.interp(vehicle.fix_ns, vehicle.speed_ns, vehicle.speed)
    usual_rate = median_filter(np.append(rates, rates[-1:]), CLEANING.relocation_count)
    believed = np.maximum(measured, np.minimum(usual_rate, CLEANING.max_speed_mps))
    limits: Floats = 1.5 * believed + CLEANING.jump_slack_mps
    return limits


def _reachable(seconds: Floats, fix: Floats, speed_limit: Floats) -> Bools:
    """Return which fixes (F,) can be reached from the last accepted one.

    Args:
        seconds: (F,) their stamps.
        fix: (F, 2) or (F, 3) [m].
        speed_limit: (F,) the highest possible speeds [m/s].
    """

    def reaches(start: int, end: int) -> bool:
        distance = np.linalg.norm(fix[end] - fix[start])
        reach = speed_limit[end] * (seconds[end] - seconds[start])
        return bool(distance <= CLEANING.jump_slack_m + reach)

    accepted = np.ones(len(fix), dtype=bool)
    last = 0
    n_doubted = 0
    for i in range(1, len(fix)):
        if reaches(last, i):
            last = i
            n_doubted = 0
            continue
        n_doubted = n_doubted + 1 if n_doubted and reaches(i - 1, i) else 1
        accepted[i] = False
        if n_doubted >= CLEANING.relocation_count:
            accepted[i - n_doubted + 1 : i + 1] = True
            last = i
            n_doubted = 0
    return accepted
