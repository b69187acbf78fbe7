# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""All evidence of each vehicle against each other: places, speeds, velocities, headings, stamps.

The displacements of a vehicle are compared with its recorded speeds, with the direction of its
recorded velocities and with its headings. Where a pair contradicts, other readings of the columns
are tried. The only one with which every vehicle agrees is used if it is a unit that no column
names, and said; else it is a `Doubt` with the option for it (`Reading.resolve`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, product

import numpy as np

from scenario_gen.logs.cleaning import is_before_fix
from scenario_gen.logs.clock import is_out_of_range
from scenario_gen.logs.columns import UNITS
from scenario_gen.logs.comparison import (
    Change,
    Comparison,
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
from scenario_gen.logs.raw import Observations, RawLog
from scenario_gen.numerics import Floats

_FRAME_RATES_HZ = (10, 12.5, 15, 20, 24, 25, 30, 29.97, 50, 60, 100)
_SPEED_UNITS = {"kmh": "km/h", "mph": "mph", "kn": "knots", "fps": "ft/s", "cmps": "cm/s"}
_POSITION_UNITS = {
    "ft": "feet",
    "dm": "decimetres",
    "cm": "centimetres",
    "mm": "millimetres",
    "km": "kilometres",
}
_SPEED_FACT = "the recorded speeds are {:.2f} times those of the positions"
_DEGREE_UNITS = ("e7", "ddmm", "min")
_TIME_UNITS = ("ms", "us", "ns")
_LONG_TIME_UNITS = ("min", "h", "d")


def interpret(log: RawLog, config: LogConfig) -> tuple[RawLog, list[str], list[Doubt]]:
    """Return a log whose evidence agrees, notes on units that were found, and doubts."""
    reading = Reading(log, config)
    _check_time_unit(reading)
    if log.geographic:
        _find_degrees(reading)
    else:
        _check_metres(reading)
        _find_ego_frame(reading)
    if not (log.geographic or reading.doubts):
        _check_staying(reading)
        _check_starts(reading)
    if reading.doubts:
        return reading.log, reading.notes, reading.doubts
    _check_speeds(reading)
    _check_frame_rate(reading)
    check_directions(reading)
    return reading.log, reading.notes, reading.doubts


# Time


def _check_time_unit(reading: Reading) -> None:
    """Use the unit of times whose steps are too long for seconds; doubt too short ones."""
    if not reading.has("time"):
        return
    vehicles = [
        replace(v, fix_ns=np.sort(v.fix_ns[~is_out_of_range(v.fix_ns)]))
        for v in reading.log.vehicles
    ]
    period = median_period(vehicles)
    span = max((float(np.ptp(v.fix_ns)) * 1e-9 for v in vehicles if len(v.fix_ns)), default=0.0)
    is_short = period < EVIDENCE.fastest_period_s and span < reading.config.min_duration
    shortest, longest = EVIDENCE.usual_period_s
    fact = f"positions are {period:g} s apart (median), and the log lasts {span:g} s"
    for unit in _TIME_UNITS if period > EVIDENCE.slowest_period_s else _LONG_TIME_UNITS * is_short:
        factor = UNITS["time"][unit]
        is_long = not is_short or span * factor > reading.config.min_duration
        if shortest <= period * factor <= longest and is_long:
            columns = reading.units(unit, "time")
            change = Change(f"the time is in {unit}", columns, scaled(time=factor), not is_short)
            reading.resolve(Quantity.CLOCK, span, fact, [change])
            return


def _check_frame_rate(reading: Reading) -> None:
    """Add a doubt if the time is a number of frames, and nothing shows their rate."""
    time = reading.log.columns.get("time")
    if time is None or "time" in reading.changes or time.unit or reading.doubts:
        return
    if not time.counts_frames:
        if not (counts_steps(reading.log.vehicles) and _crawls(reading)):
            return
        cause = (
            f"column {time.name} counts in steps of 1 and no vehicle is faster than "
            f"{EVIDENCE.max_crawl_mps:g} m/s: it looks like a number of frames"
        )
    else:
        if np.nanmedian([1e9, *reading.compared().deviation]) < EVIDENCE.wrong_ratio:
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


def _crawls(reading: Reading) -> bool:
    """Return whether vehicles without measured speeds drive far, all of them very slowly."""
    vehicles = reading.log.vehicles
    if any(len(vehicle.speed_ns) for vehicle in vehicles) or len(vehicles) < 2:
        return False
    if abs(median_period(vehicles) - 1.0) > 1e-6:
        return False
    if not np.nanmax([0.0, *reading.compared().fastest]) <= EVIDENCE.max_crawl_mps:
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
    fact = f"latitude {latitude:g}, longitude {longitude:g} is not on Earth"
    if _suits_globe(fix):
        if np.ptp(fix) > 0.0 and np.abs(fix * 1e4 - np.round(fix * 1e4)).max() < 1e-6:
            cause = "latitude and longitude have four decimals: places are up to 6 m off"
            reading.doubt(Quantity.POSITION, 11.0, cause, "record six decimals or more")
    elif changes := _degree_changes(reading, fix):
        reading.resolve(Quantity.POSITION, latitude, fact, changes)
    else:
        reading.doubt(Quantity.POSITION, latitude, fact, "name the unit of lat and lon")


def _degree_changes(reading: Reading, fix: Floats) -> list[Change]:
    """Return the readings that bring absolute latitudes and longitudes (F, 2) onto the globe."""
    swap = reading.swapped("lat", "lon")
    if _suits_globe(swapped_fix(fix)):
        return [Change("lat and lon are swapped", swap, with_fix(swapped_fix), is_unit=False)]
    changes = [
        Change(
            f"lat and lon are in the unit {unit}",
            reading.units(unit, "lat", "lon"),
            with_fix(partial(_in_degrees, unit=unit)),
        )
        for unit in _DEGREE_UNITS
        if _suits_globe(degrees := _in_degrees(fix, unit)) and np.median(degrees) > 0.01
    ]
    spreads = [np.nanmax([0.0, *reading.compared(c.convert).spread]) for c in changes]
    limit = 2.0 * min(spreads, default=0.0) + 0.02
    clear = [change for change, s in zip(changes, spreads, strict=True) if 0.0 < s < limit]
    return clear if len(clear) == 1 else changes


def _suits_globe(degrees: Floats) -> bool:
    """Return whether most absolute latitudes and longitudes (F, 2) are on the globe."""
    return bool((np.median(degrees, axis=0) <= (90.0, 180.0)).all())


def _in_degrees(values: Floats, unit: str) -> Floats:
    """Return values (F, 2) in degrees; NaN if they cannot have the unit."""
    if unit != "ddmm":
        return values * UNITS["lat"][unit]
    degrees = np.trunc(values / 100.0)
    minutes = values - 100.0 * degrees
    return degrees + (minutes / 60.0 if (np.abs(minutes) < 60.0).all() else np.nan)


def _check_metres(reading: Reading) -> None:
    """Add a doubt if x and y are degrees: as metres, no vehicle would move."""
    vehicles = reading.log.vehicles
    farthest = max((_extent(vehicle.fix) for vehicle in vehicles), default=0.0)
    if not reading.has("x", "y") or farthest <= 0.0:
        return
    if farthest >= EVIDENCE.degrees_m:
        _check_grid(reading)
        return
    largest = np.nanmax(np.abs(np.concatenate([vehicle.fix for vehicle in vehicles])), axis=0)
    fastest = np.nanmax(np.concatenate([[0.0], *(vehicle.speed for vehicle in vehicles)]))
    drives = fastest >= 1.0 or not any(len(vehicle.speed) for vehicle in vehicles)
    if drives and (largest <= (180.0, 90.0)).all() and largest.max() > 1.0:
        x, y = (reading.log.columns[name].name for name in ("x", "y"))
        cause = f"no vehicle drives farther than {farthest:.2g} m by x, y: they may be degrees"
        reading.doubt(Quantity.POSITION, farthest, cause, reading.option(lon=x, lat=y))


def _check_grid(reading: Reading) -> None:
    """Add a doubt if x is a northing of UTM, and y an easting."""
    x, y = np.nanmedian(np.concatenate([v.fix for v in reading.log.vehicles]), axis=0).tolist()
    if _is_easting(y) and not _is_easting(x) and 1e6 < x < 1e7:
        cause = f"x is {x:.0f} and y {y:.0f} m: x is a northing of UTM, and y an easting"
        option = reading.option(**reading.swapped("x", "y"))
        reading.doubt(Quantity.FRAME, 0.0, cause, option)


def _is_easting(metres: float) -> bool:
    return 1e5 < metres < 9e5


def _find_ego_frame(reading: Reading) -> None:
    """Read positions as relative to an ego whose poses the table has, if they then agree better.

    The parameter `columns` decides if it names the column of ego_x.
    """
    if not reading.has("ego_x"):
        return
    ego = reading.log.columns["ego_x"].option()
    columns = {"ego_x": ego}
    changes = [
        Change("positions and headings are relative to the ego", columns, _on_ground),
        Change(
            "positions are relative to the ego",
            columns,
            lambda vehicle: replace(_on_ground(vehicle), heading=vehicle.heading),
        ),
    ]
    disagreements = [reading.compared(change.convert).disagreement for change in changes]
    best = int(np.argmin(disagreements))
    as_recorded = reading.compared().disagreement
    if "ego_x=" not in reading.config.columns:
        if as_recorded == np.inf:
            cause = "the table has poses of an ego; positions may be relative to it"
            options = f"{reading.option(**columns)}, or else {reading.option(ego_x='none')}"
            reading.doubt(Quantity.FRAME, 0.0, cause, options)
            return
        if as_recorded <= disagreements[best]:
            return
        reading.notes.append(f"{changes[best].text}, whose poses the table has")
    ego_track = _ego_track(reading.log)
    reading.apply(changes[best])
    reading.log = replace(reading.log, vehicles=(*reading.log.vehicles, *ego_track))


def _on_ground(vehicle: Observations) -> Observations:
    """Return a vehicle whose pose was relative to the ego."""
    if vehicle.ego is None:
        return vehicle
    ahead, left = vehicle.fix.T
    x, y, turn = vehicle.ego.T
    fix = np.column_stack(
        (
            x + np.cos(turn) * ahead - np.sin(turn) * left,
            y + np.sin(turn) * ahead + np.cos(turn) * left,
        )
    )
    return replace(vehicle, fix=fix, heading=vehicle.heading + turn, ego=None)


def _ego_track(log: RawLog) -> list[Observations]:
    """Return the ego as a vehicle, unless one of the vehicles stays at its place."""
    recorded = [vehicle for vehicle in log.vehicles if vehicle.ego is not None]
    if any(
        np.nanmax(np.abs(vehicle.fix), initial=0.0) < EVIDENCE.origin_m for vehicle in recorded
    ):
        return []
    stamps = np.concatenate([vehicle.fix_ns for vehicle in recorded])
    rows = np.concatenate([vehicle.fix_row for vehicle in recorded])
    stamps, first = np.unique(stamps, return_index=True)
    poses = np.concatenate([vehicle.ego for vehicle in recorded if vehicle.ego is not None])[first]
    states = np.column_stack((poses, np.zeros(len(poses))))
    nothing = (np.nan, np.nan)
    return [Observations.of_rows("ego", stamps, states, rows[first], nothing, measured=False)]


def _check_staying(reading: Reading) -> None:
    """Add a doubt if vehicles stay in one place while their speeds say that they drive."""
    staying = [
        vehicle
        for vehicle in reading.log.vehicles
        if len(vehicle.speed) >= EVIDENCE.min_leg_count
        and 0.0 <= _extent(vehicle.fix) < EVIDENCE.standing_m
        and np.nanmedian(np.append(0.0, np.abs(vehicle.speed))) > EVIDENCE.max_crawl_mps
    ]
    if len(staying) <= EVIDENCE.many_share * len(reading.log.vehicles):
        return
    vehicle = staying[0]
    x, y = vehicle.fix[0].tolist()
    speed = float(np.nanmedian(vehicle.speed))
    cause = (
        f"vehicle {vehicle.id} stays at {x:g}, {y:g} while it drives at {speed:.1f} m/s: "
        "positions may be relative to it, which moves"
    )
    reading.doubt(Quantity.SPEED, speed, cause, "record positions on the ground")


def _check_starts(reading: Reading) -> None:
    """Add a doubt if several vehicles begin at the origin at the same time."""
    starts = {}
    for vehicle in reading.log.vehicles:
        if not len(vehicle.fix) or is_before_fix(vehicle.fix).any():
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
    ratios = compared.ratio[np.isfinite(compared.ratio)]
    if not len(ratios):
        _check_pixels(reading, compared)
        return
    if median_period(reading.log.vehicles) > EVIDENCE.slowest_period_s:
        return  # cleaning says that fixes are too far apart
    if not compared.contradicts("speed_off"):
        _check_pairs(reading, compared)
        return
    ratio = float(np.median(ratios))
    changes = reading.agreeing(chain(_frame_rates(reading), _units(reading)), _speeds_agree)
    changes = _distinct(changes)
    if changes:
        is_named = not any(reading.is_assumed(*change.columns) for change in changes)
        positions_decide = is_named and set(changes[0].columns) == {"speed"}
        fact = _SPEED_FACT.format(ratio)
        reading.resolve(Quantity.SPEED, ratio, fact, changes, stops=not positions_decide)
    elif np.log(compared.deviation[np.isfinite(compared.ratio)]).max() >= np.log(
        EVIDENCE.wrong_ratio
    ):  # else parts of the recording are off, which the check of the result says
        _doubt_speeds(reading, compared)


def _check_pixels(reading: Reading, compared: Comparison) -> None:
    """Add a doubt if vehicles without speeds drive as no vehicle does."""
    speed = _typical_speed(compared)
    is_time = reading.has("time") and not reading.log.columns["time"].counts_frames
    if speed > EVIDENCE.max_speed_mps and is_time and reading.is_assumed("x", "y"):
        cause = f"vehicles drive at {speed:.0f} m/s by x, y: are they pixels, or in feet?"
        option = reading.option(**reading.units(_scale(speed), "x", "y"))
        reading.doubt(Quantity.POSITION, speed, cause, f"name the metres of one, e.g. {option}")


def _doubt_speeds(reading: Reading, compared: Comparison) -> None:
    """Add a doubt about speeds that no unit explains."""
    is_known = np.isfinite(compared.ratio)
    ratios = compared.ratio[is_known]
    ratio = float(np.median(ratios))
    fact = _SPEED_FACT.format(ratio)
    names = [v.id for v, known in zip(reading.tried(), is_known, strict=True) if known]
    if len(names) <= 5 and np.ptp(ratios) > 0.2 * ratio:
        parts = [f"{r:.2f} times for vehicle {n}" for n, r in zip(names, ratios, strict=True)]
        fact = f"the recorded speeds over those of the positions differ: {', '.join(parts)}"
    cause = f"{fact}: check the units of time, positions and speeds"
    scales = list(_scales(reading, ratio))
    is_fixed = np.ptp(ratios) < 0.1 * ratio and np.nanmedian(compared.spread) < np.log(1.1)
    if is_fixed and len(scales) > 1:
        reading.resolve(Quantity.SPEED, ratio, fact, scales)
        return
    remedy = "convert the rows that differ" if len(names) > 1 and reading.log.columns else ""
    is_steady = compared.spread[is_known] < np.log(1.1)
    is_scaled = is_steady & (compared.deviation[is_known] > EVIDENCE.wrong_ratio)
    is_bad = is_scaled | (compared.gross_off[is_known] > EVIDENCE.gross_share)
    is_serious = is_bad.mean() > EVIDENCE.many_share and bool(reading.log.columns)
    reading.doubt(Quantity.SPEED, ratio, cause, remedy, stops=bool(is_serious))


def _scales(reading: Reading, ratio: float) -> Iterator[Change]:
    """Yield the scales with which speeds agree that are a fixed ratio of the positions' ones."""
    for text, scale, names in (
        ("x, y are scaled", ratio, ("x", "y")),
        ("speeds are scaled", 1.0 / ratio, ("speed",)),
    ):
        if reading.has(*names):
            factor = reading.log.columns[names[0]].factor * scale
            columns = reading.units(f"{factor:.3g}", *names)
            yield Change(text, columns, scaled(), is_unit=False)


def _extent(fix: Floats) -> float:
    """Return the diagonal [m] of the rectangle around positions (F, 2); -1 without any."""
    sides = [
        np.fmax.reduce(axis, initial=-np.inf) - np.fmin.reduce(axis, initial=np.inf)
        for axis in fix.T
    ]
    return float(np.hypot(*sides)) if np.isfinite(sides).all() else -1.0


def _speeds_agree(compared: Comparison) -> bool:
    """Return whether the speeds of nearly all vehicles agree with their positions."""
    ratios = compared.deviation[np.isfinite(compared.ratio)]
    fits = len(ratios) and (ratios < EVIDENCE.same_ratio).mean() >= EVIDENCE.agreeing_share
    is_possible = _typical_speed(compared) < EVIDENCE.max_speed_mps
    return bool(fits and is_possible and not compared.contradicts("speed_off"))


def _distinct(changes: Sequence[Change]) -> list[Change]:
    """Return the first of changes to the same columns, without those that change more columns.

    Data does not tell 30 from 29.97 frames a second.
    """
    first = {frozenset(each.columns): each for each in reversed(changes)}
    return [each for names, each in first.items() if not any(other < names for other in first)]


def _frame_rates(reading: Reading) -> Iterator[Change]:
    """Yield the rates of a time that may count frames; maybe the speeds have another unit, too."""
    if not reading.has("time") or not counts_steps(reading.log.vehicles):
        return
    units = _SPEED_UNITS if reading.is_assumed("speed", "time") else {}
    for unit, rate in product(("", *units), _FRAME_RATES_HZ):
        columns = reading.units(f"{rate:g}fps", "time")
        text = f"the time is in frames, {rate:g} per second"
        if unit:
            columns |= reading.units(unit, "speed")
            text += f", and speeds are in {units[unit]}"
        yield Change(text, columns, scaled(time=1.0 / rate, speed=UNITS["speed"].get(unit, 1.0)))


def _units(reading: Reading) -> Iterator[Change]:
    """Yield the units, and the order of columns, that speeds may ask for."""
    if reading.has("time") and reading.log.columns["time"].counts_frames:
        return
    speeds = ("speed",) if reading.has("speed") else ("vx", "vy")
    if reading.has(*speeds):
        for unit, name in _SPEED_UNITS.items():
            columns = reading.units(unit, *speeds)
            yield Change(f"speeds are in {name}", columns, scaled(speed=UNITS["speed"][unit]))
    if reading.has("lat", "lon"):
        swap = reading.swapped("lat", "lon")
        yield Change("lat and lon are swapped", swap, with_fix(swapped_fix), is_unit=False)
        columns = reading.units("rad", "lat", "lon")
        yield Change("lat and lon are in radians", columns, with_fix(np.degrees))
    if reading.has("x", "y"):
        for unit, name in _POSITION_UNITS.items():
            factor = UNITS["x"][unit]
            columns = reading.units(unit, "x", "y")
            yield Change(f"x, y are in {name}", columns, scaled(x=factor, y=factor))


def _check_pairs(reading: Reading, compared: Comparison) -> None:
    """Add a doubt if units of both positions and speeds explain a small, steady ratio."""
    if not reading.is_assumed("x", "y", "speed"):
        return
    ratios = np.log(compared.ratio[np.isfinite(compared.ratio)])
    middle = float(np.median(ratios))
    scatter = max(float(np.ptp(ratios)), float(np.nanmedian(compared.spread)))
    if scatter > np.log(EVIDENCE.tight_ratio) or abs(middle) < np.log(EVIDENCE.same_ratio):
        return
    pairs = [
        Change(
            f"x, y are in {_POSITION_UNITS[place]} and speeds in {_SPEED_UNITS[unit]}",
            reading.units(place, "x", "y") | reading.units(unit, "speed"),
            scaled(),
            is_unit=False,
        )
        for place, unit in product(_POSITION_UNITS, _SPEED_UNITS)
        if abs(middle + np.log(UNITS["speed"][unit] / UNITS["x"][place]))
        < np.log(EVIDENCE.exact_ratio)
    ]
    if pairs:
        ratio = float(np.exp(middle))
        reading.resolve(Quantity.SPEED, ratio, _SPEED_FACT.format(ratio), pairs)
