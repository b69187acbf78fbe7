# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""All evidence of each vehicle against each other: places, speeds, velocities, headings, stamps.

The displacements of a vehicle are compared with its recorded speeds, with the direction of its
recorded velocities and with its headings. Where a pair contradicts, other readings of the columns
are tried. The only one with which every vehicle agrees is used if it is a unit that no column
names, and said; else it is a `Doubt` with the option for it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from scenario_gen.logs.cleaning import is_before_fix
from scenario_gen.logs.clock import is_out_of_range
from scenario_gen.logs.columns import UNITS
from scenario_gen.logs.comparison import (
    Change,
    Comparison,
    Convert,
    counts_steps,
    EVIDENCE,
    Reading,
    scaled,
    swapped_fix,
    with_fix,
)
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.directions import check_directions
from scenario_gen.logs.legs import median_period
from scenario_gen.logs.quality import Doubt, Quantity
from scenario_gen.logs.raw import RawLog
from scenario_gen.numerics import Floats

_FRAME_RATES_HZ = (10, 12.5, 15, 20, 24, 25, 30, 29.97, 50, 60, 100)
_SPEED_UNITS = {
    "kmh": "speeds in km/h",
    "mph": "speeds in mph",
    "kn": "speeds in knots",
    "fps": "speeds in ft/s",
    "cmps": "speeds in cm/s",
}
_POSITION_UNITS = {"ft": "x, y in feet", "cm": "x, y in centimetres", "km": "x, y in kilometres"}
_DEGREE_UNITS = ("e7", "ddmm", "min")
_TIME_UNITS = ("ms", "us", "ns")
_LONG_TIME_UNITS = ("min", "h", "d")


def interpret(log: RawLog, config: LogConfig) -> tuple[RawLog, list[str], list[Doubt]]:
    """Return a log whose evidence agrees, notes on units that were found, and doubts."""
    reading = Reading(log, config)
    _check_time_unit(reading)
    if log.geographic:
        _find_degrees(reading)
    if reading.doubts:
        return reading.log, reading.notes, reading.doubts
    _check_starts(reading)
    _check_speeds(reading)
    _check_frame_rate(reading)
    check_directions(reading)
    return reading.log, reading.notes, reading.doubts


# Time


def _check_time_unit(reading: Reading) -> None:
    """Use the unit of times whose steps are too long for seconds; doubt too short ones."""
    vehicles = [
        replace(v, fix_ns=np.sort(v.fix_ns[~is_out_of_range(v.fix_ns)]))
        for v in reading.log.vehicles
    ]
    period = median_period(vehicles)
    if not reading.has("time"):
        return
    shortest, longest = EVIDENCE.usual_period_s
    factors = UNITS["time"]
    fact = f"positions are {period:g} s apart (median)"
    span = max((float(np.ptp(v.fix_ns)) * 1e-9 for v in vehicles if len(v.fix_ns)), default=0.0)
    is_short = period < EVIDENCE.fastest_period_s and span < reading.config.min_duration
    units = _TIME_UNITS if period > EVIDENCE.slowest_period_s else _LONG_TIME_UNITS * is_short
    for unit in units:
        columns = reading.units(unit, "time")
        if not shortest <= period * factors[unit] <= longest:
            continue
        if reading.is_assumed("time") and not is_short:
            reading.apply(Change("", columns, scaled(time=factors[unit])))
            reading.notes.append(f"{fact}, so the time is in {unit}: {reading.option()}")
        elif not is_short or span * factors[unit] > reading.config.min_duration:
            cause = f"{fact}, and the log lasts {span:g} s: the time may be in {unit}"
            reading.doubt(Quantity.CLOCK, span, cause, reading.option(**columns))
        return


def _check_frame_rate(reading: Reading) -> None:
    """Add a doubt if the time is a number of frames, and nothing shows their rate."""
    time = reading.log.columns.get("time")
    if time is None or "time" in reading.changes or time.unit or reading.doubts:
        return
    compared = reading.compared()
    if not time.counts_frames:
        if not (counts_steps(reading.log.vehicles) and _crawls(reading, compared)):
            return
        cause = (
            f"column {time.name} counts in steps of 1 and no vehicle is faster than "
            f"{EVIDENCE.max_crawl_mps:g} m/s: it looks like a number of frames"
        )
    else:
        if np.nanmedian([1e9, *compared.deviation]) < EVIDENCE.wrong_ratio:
            return
        cause = f"column {time.name} counts frames, and no speeds show how many there are a second"
    changes = reading.units("25fps", "time")
    speed = _typical_speed(reading.compared(scaled(time=1 / 25.0)))
    if speed > EVIDENCE.max_speed_mps and reading.is_assumed("x", "y"):
        cause += f"; with 25, vehicles would drive at {speed:.0f} m/s: are x, y pixels?"
        changes |= reading.units(_scale(speed), "x", "y")
    remedy = f"name the rate, e.g. {reading.option(**changes)}"
    reading.doubt(Quantity.CLOCK, 1.0, cause, remedy)


def _typical_speed(compared: Comparison) -> float:
    known = compared.fastest[np.isfinite(compared.fastest)]
    return float(np.median(known)) if len(known) else 0.0


def _scale(speed: float) -> str:
    """Return a round number that makes a speed that of a car in a town."""
    return f"{10.0 / speed:.1g}"


def _crawls(reading: Reading, compared: Comparison) -> bool:
    """Return whether vehicles without measured speeds drive far, all of them very slowly."""
    vehicles = reading.log.vehicles
    if any(len(vehicle.speed_ns) for vehicle in vehicles) or len(vehicles) < 2:
        return False
    if abs(median_period(vehicles) - 1.0) > 1e-6:
        return False
    if not np.nanmax([0.0, *compared.fastest]) <= EVIDENCE.max_crawl_mps:
        return False
    extent = max(float(np.hypot(*np.ptp(vehicle.fix, axis=0))) for vehicle in vehicles)
    n_fixes = max(len(vehicle.fix_ns) for vehicle in vehicles)
    return extent > EVIDENCE.min_crawl_m and n_fixes > EVIDENCE.min_crawl_count


# Places


def _find_degrees(reading: Reading) -> None:
    """Use the unit of latitudes and longitudes that cannot be degrees."""
    fix = np.concatenate([vehicle.fix for vehicle in reading.log.vehicles] or [np.zeros((0, 2))])
    fix = np.abs(fix[np.isfinite(fix).all(axis=1)])
    if not len(fix) or not reading.has("lat", "lon"):
        return
    latitude, longitude = np.median(fix, axis=0).tolist()
    if latitude <= 90.0 and longitude <= 180.0:
        if np.ptp(fix) > 0.0 and np.abs(fix * 1e4 - np.round(fix * 1e4)).max() < 1e-6:
            cause = "latitude and longitude have four decimals: places are up to 6 m off"
            reading.doubt(Quantity.POSITION, 11.0, cause, "record six decimals or more")
        return
    if latitude <= 180.0 and longitude <= 90.0:
        cause = f"a latitude of {latitude:g} is not on Earth: lat and lon may be swapped"
        option = reading.option(**reading.swapped("lat", "lon"))
        reading.doubt(Quantity.POSITION, latitude, cause, option)
        return
    units = [unit for unit in _DEGREE_UNITS if _suits_globe(fix, unit)]
    spreads = [reading.compared(_degrees(unit)).spread for unit in units]
    known = [float(np.nanmax(spread)) for spread in spreads if np.isfinite(spread).any()]
    if len(known) > 1:
        best = int(np.argmin(known))
        rest = min(value for k, value in enumerate(known) if k != best)
        units = [units[best]] if rest > 2.0 * known[best] + 0.02 else units
    if not units:
        cause = f"latitudes such as {latitude:g} are no degrees"
        reading.doubt(Quantity.POSITION, latitude, cause, "name their unit")
        return
    changes = [Change(unit, reading.units(unit, "lat", "lon"), _degrees(unit)) for unit in units]
    options = [reading.option(**change.columns) for change in changes]
    if not reading.is_assumed("lat", "lon"):
        cause = f"latitudes such as {latitude:g} are no degrees"
        reading.doubt(Quantity.POSITION, latitude, cause, " or ".join(options))
    elif len(units) > 1:
        cause = f"latitudes may be in {' or '.join(units)}, and no speeds tell which"
        reading.doubt(Quantity.POSITION, latitude, cause, " or ".join(options))
    reading.apply(changes[0])
    text = f"latitude and longitude are read in the unit {units[0]}: {reading.option()}"
    reading.notes.append(text)


def _suits_globe(fix: Floats, unit: str) -> bool:
    """Return whether absolute latitudes and longitudes (F, 2) in a unit are on the globe."""
    if unit == "ddmm" and (fix % 100.0 >= 60.0).any():
        return False
    degrees = np.median(_in_degrees(fix, unit), axis=0)
    is_small = unit == "e7" and degrees.max() < 0.01
    return bool((degrees <= (90.0, 180.0)).all()) and not is_small


def _in_degrees(values: Floats, unit: str) -> Floats:
    if unit != "ddmm":
        return values * UNITS["lat"][unit]
    degrees = np.trunc(values / 100.0)
    return degrees + (values - 100.0 * degrees) / 60.0


def _degrees(unit: str) -> Convert:
    return with_fix(lambda fix: _in_degrees(fix, unit))


def _check_starts(reading: Reading) -> None:
    """Add a doubt if several vehicles begin at the origin at the same time."""
    starts = {}
    for vehicle in reading.log.vehicles:
        if reading.log.geographic or not len(vehicle.fix) or is_before_fix(vehicle.fix).any():
            continue
        is_at_origin = np.hypot(*vehicle.fix[0]) < EVIDENCE.origin_m
        if is_at_origin and _extent(vehicle.fix) > EVIDENCE.min_driven_m:
            starts[vehicle.id] = int(vehicle.fix_ns[0])
    if len(starts) > 1 and np.ptp(list(starts.values())) < 1e9:
        cause = f"vehicles {', '.join(starts)} all begin at 0, 0: each counts from its own start"
        reading.doubt(Quantity.FRAME, 0.0, cause, "record positions in one common frame")


# Speeds


def _check_speeds(reading: Reading) -> None:
    """Use the unit that makes all speeds agree with the positions, or add a doubt."""
    compared = reading.compared()
    stays = _staying(reading)
    if stays:
        reading.doubt(Quantity.SPEED, 0.0, stays, "record positions on the ground")
        return
    speed = _typical_speed(compared)
    is_known = np.isfinite(compared.ratio)
    if not is_known.any():
        time = reading.log.columns.get("time")
        is_time = time is not None and not time.counts_frames
        if speed > EVIDENCE.max_speed_mps and is_time and reading.is_assumed("x", "y"):
            cause = f"vehicles drive at {speed:.0f} m/s by x, y: are they pixels, or in feet?"
            option = reading.option(**reading.units(_scale(speed), "x", "y"))
            reading.doubt(
                Quantity.POSITION, speed, cause, f"name the metres of one, e.g. {option}"
            )
        return
    if median_period(reading.log.vehicles) > EVIDENCE.slowest_period_s:
        return  # cleaning says that fixes are too far apart
    if not compared.contradicts("speed_off"):
        _check_pairs(reading, compared)
        return
    ratios = compared.ratio[is_known]
    ratio = float(np.median(ratios))
    fact = f"the recorded speeds are {ratio:.2f} times those of the positions"
    assumed = _agreeing(reading, _speed_changes(reading, reading.is_assumed))
    if len(assumed) == 1 and assumed[0].is_unit:
        reading.apply(assumed[0])
        reading.notes.append(f"{fact}: read with {assumed[0].text}: {reading.option()}")
        return
    named = assumed or _agreeing(reading, _speed_changes(reading, reading.has))
    if named:
        options = [f"{each.text}; {reading.option(**each.columns)}" for each in named]
        positions_decide = not assumed and set(named[0].columns) == {"speed"}
        cause = f"{fact}; they would fit with {' or with '.join(options)}"
        reading.doubt(Quantity.SPEED, ratio, cause, stops=not positions_decide)
        return
    is_gross = compared.gross_off[is_known] > EVIDENCE.gross_share
    if np.log(compared.deviation[is_known]).max() < np.log(EVIDENCE.wrong_ratio):
        return  # parts of the recording are off, which the check of the result says
    names = [v.id for v, r in zip(reading.tried(), compared.ratio, strict=True) if np.isfinite(r)]
    if len(names) <= 5 and np.ptp(ratios) > 0.2 * ratio:
        parts = [f"{r:.2f} times for vehicle {n}" for n, r in zip(names, ratios, strict=True)]
        fact = f"the recorded speeds over those of the positions differ: {', '.join(parts)}"
    cause = f"{fact}: check the units of time, positions and speeds"
    remedy = "name them with --set log.columns=…" if reading.log.columns else ""
    is_serious = is_gross.mean() > EVIDENCE.many_share and bool(reading.log.columns)
    reading.doubt(Quantity.SPEED, ratio, cause, remedy, stops=bool(is_serious))


def _staying(reading: Reading) -> str:
    """Return a text on a vehicle that stays in one place while its speeds say that it drives."""
    staying = [
        vehicle
        for vehicle in reading.log.vehicles
        if len(vehicle.speed) >= EVIDENCE.min_leg_count
        and np.nanmedian([0.0, *np.abs(vehicle.speed)]) > EVIDENCE.max_crawl_mps
        and 0.0 <= _extent(vehicle.fix) < EVIDENCE.standing_m
        and not reading.log.geographic
    ]
    if len(staying) <= EVIDENCE.many_share * len(reading.log.vehicles):
        return ""
    vehicle = staying[0]
    x, y = vehicle.fix[0].tolist()
    return (
        f"vehicle {vehicle.id} stays at {x:g}, {y:g} while it drives at "
        f"{float(np.nanmedian(vehicle.speed)):.1f} m/s: positions may be relative to it, which "
        "moves"
    )


def _extent(fix: Floats) -> float:
    """Return the diagonal [m] of the rectangle around positions (F, 2); -1 without any."""
    known = fix[np.isfinite(fix).all(axis=1)]
    return float(np.hypot(*np.ptp(known, axis=0))) if len(known) else -1.0


def _agreeing(reading: Reading, changes: Iterator[Change]) -> list[Change]:
    """Return the changes with which the speeds of nearly all vehicles agree."""
    agreeing = []
    for change in changes:
        compared = reading.compared(change.convert)
        ratios = compared.deviation[np.isfinite(compared.ratio)]
        fits = len(ratios) and (ratios < EVIDENCE.same_ratio).mean() >= EVIDENCE.agreeing_share
        is_possible = _typical_speed(compared) < EVIDENCE.max_speed_mps
        if fits and is_possible and not compared.contradicts("speed_off"):
            agreeing.append(change)
    return _distinct(agreeing)


def _distinct(changes: Sequence[Change]) -> list[Change]:
    """Return the first of changes to the same columns, without those that change more columns.

    Data does not tell 30 from 29.97 frames a second.
    """
    first = {frozenset(each.columns): each for each in reversed(changes)}
    return [each for names, each in first.items() if not any(other < names for other in first)]


def _speed_changes(reading: Reading, may_change: Callable[..., bool]) -> Iterator[Change]:
    """Yield the changes of units, and of the order of columns, that speeds may ask for."""
    speed = UNITS["speed"]
    time = reading.log.columns.get("time")
    if may_change("time") and counts_steps(reading.log.vehicles):
        for unit, rate in product(("", *_SPEED_UNITS), _FRAME_RATES_HZ):
            if unit and not (reading.is_assumed("speed") and reading.is_assumed("time")):
                continue
            columns = reading.units(f"{rate:g}fps", "time")
            text = f"time in frames, {rate:g} per second"
            if unit:
                columns |= reading.units(unit, "speed")
                text += f", and {_SPEED_UNITS[unit]}"
            yield Change(text, columns, scaled(time=1.0 / rate, speed=speed.get(unit, 1.0)))
        if time is not None and time.counts_frames:
            return
    if may_change("speed"):
        for unit, text in _SPEED_UNITS.items():
            yield Change(text, reading.units(unit, "speed"), scaled(speed=speed[unit]))
    if reading.log.geographic:
        if reading.has("lat", "lon"):
            swap = reading.swapped("lat", "lon")
            yield Change("lat and lon swapped", swap, with_fix(swapped_fix), is_unit=False)
        if may_change("lat", "lon"):
            text = "latitude and longitude in radians"
            yield Change(text, reading.units("rad", "lat", "lon"), with_fix(np.degrees))
    elif may_change("x", "y"):
        for unit, text in _POSITION_UNITS.items():
            factor = UNITS["x"][unit]
            yield Change(text, reading.units(unit, "x", "y"), scaled(x=factor, y=factor))


def _check_pairs(reading: Reading, compared: Comparison) -> None:
    """Add a doubt if units of both positions and speeds explain a small, steady ratio."""
    known = np.isfinite(compared.ratio)
    ratios = np.log(compared.ratio[known])
    is_steady = np.ptp(ratios) < np.log(EVIDENCE.tight_ratio) and np.nanmedian(
        compared.spread
    ) < np.log(EVIDENCE.tight_ratio)
    middle = float(np.median(ratios))
    if not is_steady or abs(middle) < np.log(EVIDENCE.same_ratio):
        return
    if reading.log.geographic or not reading.is_assumed("x", "y", "speed"):
        return
    for (place, text), (unit, words) in product(_POSITION_UNITS.items(), _SPEED_UNITS.items()):
        factor = UNITS["speed"][unit] / UNITS["x"][place]
        if abs(middle + np.log(factor)) < np.log(EVIDENCE.exact_ratio):
            columns = reading.units(place, "x", "y") | reading.units(unit, "speed")
            cause = (
                f"the recorded speeds are {np.exp(middle):.2f} times those of the positions; they "
                f"fit with {text} and {words}"
            )
            reading.doubt(Quantity.SPEED, np.exp(middle), cause, reading.option(**columns))
            return
