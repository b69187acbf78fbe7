# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Cleaning: impossible values are dropped and counted; the rest is put in order of time and into metres."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.logs.clock import beyond
from scenario_gen.logs.config import LogConfig, picked
from scenario_gen.logs.geodesy import local_frame, middle_of, on_sphere, sites_of
from scenario_gen.logs.kinds import usual_size
from scenario_gen.logs.quality import Dropped
from scenario_gen.logs.raw import Observations, RawLog
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.types import CAR, VEHICLE_TYPES

SLOWEST_S = 5.0  # s between fixes: a slower source does not show how a vehicle drives, or its unit of time is another one
FARTHEST_M = 1e8  # m from the origin of any frame: a quarter of the way to the moon
UNITS = {"milliseconds": ("ms", 1e-3), "microseconds": ("us", 1e-6), "nanoseconds": ("ns", 1e-9)}
USUAL = (0.005, 2.0)  # s between fixes of usual sources
FASTEST_MPS = 70.0  # m/s: no road vehicle's measured speed is above it (an SPMD unit sends 163.8 for "unknown")
TELEPORT_SLACK_M = 3.0  # m that a fix may lie beyond what the speeds allow: GPS noise
TELEPORT_SLACK_MPS = (
    10.0  # m/s by which a measured speed may be wrong before a fix counts as a jump
)
LONGEST_M, WIDEST_M = 100.0, 4.0  # of a vehicle
SIZES = (
    ("feet", "ft", 0.3048),
    ("centimetres", "cm", 0.01),
    ("millimetres", "mm", 0.001),
)  # that sizes may be in
MOVES_MPS = 1.0  # m/s: above it a vehicle is not where it was
BORNE_OUT = 0.2  # of a measured speed: what the positions drive at least, in whatever unit it is
RELOCATED = 5  # fixes in a row that agree with each other and are then a new place, not jumps


@dataclass
class Drops:
    """Counts of dropped rows by reason, with the first row of each; and notes on what was replaced."""

    count: dict[str, int] = field(default_factory=dict)
    first: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def add(self, reason: str, rows: Ints) -> None:
        """Count `rows` (K,) of the log as dropped for `reason`."""
        if len(rows):
            self.count[reason] = self.count.get(reason, 0) + len(rows)
            self.first[reason] = min(self.first.get(reason, int(rows[0])), int(rows.min()))

    def of(self, log: RawLog) -> tuple[Dropped, ...]:
        """Return the reasons with their counts and the places in the log."""
        return tuple(
            Dropped(reason, count, log.where(self.first[reason]))
            for reason, count in self.count.items()
        )


def clean(log: RawLog, config: LogConfig) -> tuple[tuple[Observations, ...], Drops]:
    """Drop impossible values and bring every vehicle into the local frame.

    Returns:
        The vehicles with at least two fixes, in metres, stamps strictly increasing, no NaN but in headings, one after another for
        each site (`in_metres`); and the drops.

    Raises:
        InputError: nothing usable is left, or `strict` is set and a row had to be repaired.
    """
    drops = Drops()
    for reason, row in log.dropped:
        drops.add(reason, np.array([row]))
    known = {vehicle.id: vehicle for vehicle in log.vehicles}
    sound = [
        sound_observations(known[name], log.geographic, drops)
        for name in picked(list(known), config, log.name)
    ]
    window = time_window(sound, log, drops, config)
    sound = [within(vehicle, *window) for vehicle in sound]
    if not any(len(vehicle.fix_ns) for vehicle in sound):
        raise InputError(
            f"{log.name}: no position between {config.start:g} s and {config.end:g} s; change --set log.start=… or log.end=…"
        )
    sound = [in_order(vehicle, log, drops) for vehicle in sound]
    sound = [without_held(vehicle, drops, geographic=log.geographic) for vehicle in sound]
    check_clock(sound, log, config)
    tracks, notes = sized(
        [without_jumps(vehicle, drops, geographic=log.geographic) for vehicle in sound], config
    )
    drops.notes += notes
    if config.strict and drops.count:
        worst = drops.of(log)[0]
        raise InputError(
            f"{worst.first}: {worst.reason} ({worst.count} such rows), and strict is set"
        )
    if log.geographic:
        tracks = in_metres(tracks, config)
    return tuple(track for track in tracks if len(track.fix_ns) >= 2), drops


def sound_observations(vehicle: Observations, geographic: bool, drops: Drops) -> Observations:
    """Return the observations without impossible positions and speeds."""
    fix, speed = vehicle.fix, vehicle.speed
    checks: list[tuple[str, Any]] = [
        ("stamp is out of range", beyond(vehicle.fix_ns)),
        ("position is not a number", ~np.isfinite(fix).all(axis=1)),
    ]
    if geographic:
        checks.append(("position is (0, 0)", (np.abs(fix) < 1e-6).all(axis=1)))
        checks.append(
            ("position is not on Earth", (np.abs(fix[:, 0]) > 90.0) | (np.abs(fix[:, 1]) > 180.0))
        )
    else:
        checks.append(("position is not on Earth", (np.abs(fix) > FARTHEST_M).any(axis=1)))
    keep = judge(checks, vehicle.fix_row, drops)
    slow_checks: list[tuple[str, Any]] = [
        ("stamp is out of range", beyond(vehicle.speed_ns)),
        ("speed is not a number", ~np.isfinite(speed)),
        ("speed is negative", speed < 0.0),
        (f"speed is above {FASTEST_MPS:g} m/s", speed > FASTEST_MPS),
    ]
    keep_speed = judge(slow_checks, vehicle.speed_row, drops)
    return select(vehicle, keep, keep_speed)


def judge(checks: list[tuple[str, Any]], rows: Ints, drops: Drops) -> Bools:
    """Return which rows (T,) pass all checks, each a reason and (T,) flags; a row counts once, for its first reason."""
    keep = np.ones(len(rows), dtype=bool)
    for reason, bad in checks:
        drops.add(reason, rows[keep & bad])
        keep &= ~bad
    return keep


def select(vehicle: Observations, fixes: Bools | Ints, speeds: Bools | Ints) -> Observations:
    """Return the vehicle with only the chosen observations, in the order given: flags (F,) and (S,), or indices."""
    return replace(
        vehicle,
        **{
            name: getattr(vehicle, name)[fixes] for name in ("fix_ns", "fix", "fix_row", "heading")
        },
        **{name: getattr(vehicle, name)[speeds] for name in ("speed_ns", "speed", "speed_row")},
    )


def time_window(
    sound: list[Observations], log: RawLog, drops: Drops, config: LogConfig
) -> tuple[int, int]:
    """Return the first and last stamp wanted [ns].

    Raises:
        InputError: there is no usable position at all.
    """
    stamps = [vehicle.fix_ns for vehicle in sound if len(vehicle.fix_ns)]
    if not stamps:
        causes = "; ".join(map(str, drops.of(log)))
        raise InputError(
            f"{log.segments[0].label} holds no usable position among {log.rows} rows"
            + (f" ({causes})" if causes else "")
            + looks_like(log)
            + "; check the columns and their units, or name them with --set log.columns=…"
        )
    first, last = min(int(s.min()) for s in stamps), max(int(s.max()) for s in stamps)
    if config.end and config.end <= config.start:
        raise InputError(
            f"parameter end is {config.end:g} s; it must be after start ({config.start:g} s), or 0"
        )
    if config.start * 1e9 > last - first:
        raise InputError(
            f"parameter start is {config.start:g} s, but {log.name} is only {(last - first) * 1e-9:.1f} s long"
        )
    return first + round(config.start * 1e9), first + round(
        config.end * 1e9
    ) if config.end else last


def looks_like(log: RawLog) -> str:
    """Return what positions of which none can be used look like, "" if like nothing that is known."""
    fix = np.concatenate([vehicle.fix for vehicle in log.vehicles] or [np.zeros((0, 2))])
    fix = np.abs(fix[np.isfinite(fix).all(axis=1)])
    if not log.geographic:
        return ""
    if not len(fix):
        return "; the receivers had no fix, or the fields are empty"
    latitude, longitude = np.median(fix, axis=0)
    for unit, what, whole in (
        ("ddmm", "degrees and minutes, as of NMEA", (9_000.0, 18_000.0)),
        ("e7", "1e-7 degrees", (9e8, 1.8e9)),
    ):
        if max(latitude, longitude) > 180.0 and latitude <= whole[0] and longitude <= whole[1]:
            return f"; they look like {what}: --set log.columns=lat=…:{unit},lon=…:{unit}"
    return (
        "; lat and lon may be swapped: --set log.columns=lat=…,lon=…"
        if 90.0 < latitude <= 180.0
        else ""
    )


def within(vehicle: Observations, first: int, last: int) -> Observations:
    """Return the vehicle's observations between two stamps."""
    return select(
        vehicle,
        (vehicle.fix_ns >= first) & (vehicle.fix_ns <= last),
        (vehicle.speed_ns >= first) & (vehicle.speed_ns <= last),
    )


def in_metres(vehicles: list[Observations], config: LogConfig) -> list[Observations]:
    """Project latitude and longitude to east and north of the parameter `origin`, or else of the middle of their site.

    Sites are groups of fixes far from each other (`geodesy.sites_of`), however far: each has a frame of its own. A vehicle that
    is recorded at two sites is returned once for each.
    """
    everything = np.concatenate([vehicle.fix for vehicle in vehicles])
    site = np.zeros(len(everything), dtype=np.int64) if config.origin else sites_of(everything)
    origins = [
        parse_origin(config.origin)
        if config.origin
        else middle_of(everything[site == k], left_out=5.0, digits=5)
        for k in range(int(site.max()) + 1)
    ]
    found = []
    for vehicle, own in zip(
        vehicles,
        np.split(site, np.cumsum([len(vehicle.fix) for vehicle in vehicles])[:-1]),
        strict=True,
    ):
        at = (
            own[np.clip(np.searchsorted(vehicle.fix_ns, vehicle.speed_ns), 0, len(own) - 1)]
            if len(own)
            else own
        )
        for k in np.unique(own):
            part = select(vehicle, own == k, at == k)
            found.append(
                replace(
                    part,
                    fix=local_frame(part.fix[:, 0], part.fix[:, 1], origins[k]),
                    origin=origins[k],
                )
            )
    return found


def parse_origin(text: str, parameter: str = "origin") -> tuple[float, float]:
    """Return latitude and longitude of a text `latitude,longitude`, in degrees, that a parameter has.

    Raises:
        InputError: it is not of that form, or no place on the globe.
    """
    try:
        latitude, longitude = (float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(
            f"parameter {parameter} is {text!r}; write latitude,longitude in degrees"
        ) from error
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise InputError(f"parameter {parameter} is {text!r}; that is not a place on Earth")
    return latitude, longitude


def in_order(vehicle: Observations, log: RawLog, drops: Drops) -> Observations:
    """Sort by stamp and drop repeated stamps.

    Raises:
        InputError: the stamps run backwards half of the time, or stand still.
    """
    fixes, speeds = np.diff(vehicle.fix_ns), np.diff(vehicle.speed_ns)
    back = np.flatnonzero(fixes < 0) + 1
    repeated = int((fixes == 0).sum())
    if len(fixes) >= 4 and (len(back) > len(fixes) / 2 or repeated > 0.9 * len(fixes)):
        row = vehicle.fix_row[back[0] if len(back) else 1]
        fault = (
            f"runs backwards {len(back)} times" if len(back) else f"stands still {repeated} times"
        )
        raise InputError(
            f"{log.where(int(row))}: the clock of vehicle {vehicle.id} {fault} in {len(fixes)} rows; check the time column"
        )
    drops.add("stamp out of order (sorted)", vehicle.fix_row[back])
    late = set(back.tolist())
    same = [
        i + 1
        for i in np.flatnonzero(speeds < 0)
        if i + 1 not in late and len(vehicle.speed_row) != len(vehicle.fix_row)
    ]
    drops.add("stamp out of order (sorted)", vehicle.speed_row[same])
    keep, again = first_of_each(vehicle.fix_ns)
    keep_speed, _ = first_of_each(vehicle.speed_ns)
    drops.add("stamp repeated", vehicle.fix_row[again])
    return select(vehicle, keep, keep_speed)


def without_held(vehicle: Observations, drops: Drops, *, geographic: bool) -> Observations:
    """Keep the first of positions that repeat while the vehicle moves: the others are no measurements.

    It moves if its measured speeds say so and the next position bears them out; without speeds, if it comes and goes by steps
    that are as fast as a vehicle, the repeats included.
    """
    repeats = np.concatenate([[False], (np.diff(vehicle.fix, axis=0) == 0.0).all(axis=1)])
    new = np.flatnonzero(~repeats)
    if not repeats.any() or len(new) < 2:
        return vehicle
    places = on_sphere(vehicle.fix[new]) if geographic else vehicle.fix[new]
    rate = np.linalg.norm(np.diff(places, axis=0), axis=1) / (np.diff(vehicle.fix_ns[new]) * 1e-9)
    if len(vehicle.speed_ns) >= 2:
        speed = np.interp(vehicle.fix_ns, vehicle.speed_ns, vehicle.speed)
        counts = np.diff(np.append(new, len(repeats)))
        goes = rate > BORNE_OUT * (np.add.reduceat(speed, new) / counts)[:-1]
        moves = speed > MOVES_MPS
    else:
        goes = np.minimum(rate, np.insert(rate[:-1], 0, rate[0])) > 2.0 * MOVES_MPS
        moves = np.ones(len(repeats), dtype=bool)
    goes = np.append(goes, (goes & (np.diff(new) > 1)).any())  # the last one, if there are others
    held = repeats & moves & goes[np.cumsum(~repeats) - 1]
    drops.add(
        "position repeated while the vehicle moves (the first is kept)", vehicle.fix_row[held]
    )
    return select(vehicle, ~held, np.ones(len(vehicle.speed_ns), dtype=bool))


def first_of_each(stamps: Ints) -> tuple[Ints, Ints]:
    """Return, of stamps (T,), the indices of the first row of each in order of time, and of the rows that repeat one."""
    _, keep = np.unique(stamps, return_index=True)
    return keep, np.delete(np.arange(len(stamps)), keep)


def check_clock(vehicles: Sequence[Observations], log: RawLog, config: LogConfig) -> None:
    """Refuse tracks whose common clock would have more than `tick_limit` ticks, or whose unit of time seems to be wrong.

    The clock has a tick for every period between a vehicle's first and last stamp: with one wrong stamp these may be years apart,
    and the clock would need hundreds of gibibytes.

    Args:
        vehicles: stamps in order.
        log: names the places.
        config: holds the limit and the period.

    Raises:
        InputError: the clock is too long, or the fixes are too far apart in time.
    """
    vehicles = [vehicle for vehicle in vehicles if len(vehicle.fix_ns) >= 2]
    if not vehicles:
        return
    typical = (
        float(np.median(np.concatenate([np.diff(vehicle.fix_ns) for vehicle in vehicles]))) * 1e-9
    )
    if typical > max(SLOWEST_S, config.longest_gap):
        likely = [
            (name, unit)
            for name, (unit, factor) in UNITS.items()
            if USUAL[0] <= typical * factor <= USUAL[1]
        ]
        hint = f"this looks like {likely[0][0]} read as seconds; " if likely else ""
        raise InputError(
            f"{log.where(int(vehicles[0].fix_row[1]))}: positions are {typical:g} s apart (median), at most {SLOWEST_S:g} s make "
            f"a track; {hint}name the unit with the parameter columns, time=<column>:{likely[0][1] if likely else '<unit>'}"
        )
    spans = [int(vehicle.fix_ns[-1]) - int(vehicle.fix_ns[0]) for vehicle in vehicles]
    ticks = round(sum(spans) / (config.period * 1e9))
    if ticks > config.tick_limit:
        longest = vehicles[int(np.argmax(spans))]
        after = int(np.argmax(np.diff(longest.fix_ns))) + 1
        gap = int(longest.fix_ns[after]) - int(longest.fix_ns[after - 1])
        raise InputError(
            f"{log.where(int(longest.fix_row[after]))}: the stamp of vehicle {longest.id[:50]} is {gap * 1e-9:g} s after the one "
            f"before, so the clock has {ticks} ticks of {config.period:g} s in all; at most {config.tick_limit} are made: "
            "correct the stamp, cut the log (parameters start, end), or raise --set log.tick_limit=…"
        )


def without_jumps(vehicle: Observations, drops: Drops, *, geographic: bool) -> Observations:
    """Drop fixes that the vehicle cannot have reached at its measured speeds, except several in a row that agree."""
    limit = reach(vehicle)
    places = on_sphere(vehicle.fix) if geographic else vehicle.fix
    step = np.linalg.norm(np.diff(places, axis=0), axis=1)
    seconds = np.diff(vehicle.fix_ns) * 1e-9
    keep = np.ones(len(vehicle.fix_ns), dtype=bool)
    if (step > TELEPORT_SLACK_M + limit[1:] * seconds).any():
        keep = reachable(vehicle.fix_ns.astype(np.float64) * 1e-9, places, limit)
        drops.add("position jumps", vehicle.fix_row[~keep])
    every = np.ones(len(vehicle.speed_ns), dtype=bool)
    return select(vehicle, keep, every)


def sized(vehicles: list[Observations], config: LogConfig) -> tuple[list[Observations], list[str]]:
    """Return the vehicles with lengths and widths, those of `config` where there are none, or such as no car has; and notes."""
    found, wrong = [], []
    for vehicle in vehicles:
        length, width, usual = vehicle.length, vehicle.width, usual_size(vehicle.kind, config)
        walks = VEHICLE_TYPES[vehicle.kind or CAR].walks  # wider than long
        # comparisons with NaN, where one is not recorded, are false
        if width <= 0.0 or width > WIDEST_M or (width > length and not walks):
            wrong.append(vehicle)
            length, width = np.nan, np.nan
        elif length <= 0.0 or length > LONGEST_M:
            wrong.append(vehicle)
            length = np.nan
        length, width = (
            own if np.isfinite(own) else known
            for own, known in zip((length, width), usual, strict=True)
        )
        found.append(replace(vehicle, length=length, width=width))
    if not wrong:
        return found, []
    size = (wrong[0].length, wrong[0].width)
    ways = {"swapped (log.columns=length=…,width=…)": size[::-1]} | {
        f"in {name} (name the unit: log.columns=length=…:{unit},width=…:{unit})": (
            factor * size[0],
            factor * size[1],
        )
        for name, unit, factor in SIZES
    }
    way = next(
        (words for words, (long, wide) in ways.items() if 2.5 < long < 20.0 and 1.2 < wide < 2.7),
        "",
    )
    more = f" ({len(wrong)} vehicles have such sizes)" if len(wrong) > 1 else ""
    return found, [
        f"vehicle {wrong[0].id} is recorded as {size[0]:g} m long and {size[1]:g} m wide, which no car is{more}"
        + (f"; it looks {way}" if way else "")
        + ": what is wrong is taken as {:g} m × {:g} m".format(*usual_size(wrong[0].kind, config))
    ]


def reach(vehicle: Observations) -> Floats:
    """Return the highest speeds (F,) [m/s] that the vehicle may have had at its fixes."""
    if len(vehicle.speed_ns) < 2:
        return np.full(len(vehicle.fix_ns), FASTEST_MPS)
    return 1.5 * np.interp(vehicle.fix_ns, vehicle.speed_ns, vehicle.speed) + TELEPORT_SLACK_MPS


def reachable(seconds: Floats, fix: Floats, limit: Floats) -> Bools:
    """Return which fixes (F,) can be reached from the last accepted one.

    Args:
        seconds: (F,) their stamps.
        fix: (F, 2) or (F, 3) [m].
        limit: (F,) the highest speeds that the vehicle may have had [m/s].
    """
    keep = np.ones(len(fix), dtype=bool)
    last, n_doubted = 0, 0
    for i in range(1, len(fix)):
        if np.linalg.norm(fix[i] - fix[last]) <= TELEPORT_SLACK_M + limit[i] * (
            seconds[i] - seconds[last]
        ):
            last, n_doubted = i, 0
            continue
        agrees = n_doubted and np.linalg.norm(fix[i] - fix[i - 1]) <= TELEPORT_SLACK_M + limit[
            i
        ] * (seconds[i] - seconds[i - 1])
        n_doubted = n_doubted + 1 if agrees else 1
        keep[i] = False
        if n_doubted >= RELOCATED:
            keep[i - n_doubted + 1 : i + 1] = True
            last, n_doubted = i, 0
    return keep
