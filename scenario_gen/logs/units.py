# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Units, axes and conventions that a log does not name, by what agrees within its data.

A unit that is assumed gives way to the only one that explains the data; a note says so. If the
data contradicts what the log names, or if several explanations remain, there is a `Doubt`.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.legs import Legs, legs_of, median_period
from scenario_gen.logs.quality import Doubt, Quantity
from scenario_gen.logs.raw import Observations, RawLog
from scenario_gen.logs.reading import counts_steps, interpret_headings, Reading
from scenario_gen.numerics import Floats, Ints

_SAME_RATIO = 0.03  # tolerance of a ratio of speeds
_EQUAL_RATIO = 0.005  # of frame rates that no data tells apart
_WRONG_RATIO = 1.2  # a ratio of speeds, or its inverse, that no sensor error explains
_SPREAD_RATIO = 1.3  # the ratio of most legs is within this factor of the median
_SAME_SPEED_RATIO = 1.1  # of legs whose speeds fit the positions
_SWAP_STRETCH_RATIO = 0.1  # logarithm of a change of length that shows the order of columns
_SWAPPED_SHARE = 0.75  # of those legs fit with swapped columns, and do not without
_GROSS_RATIO = 2.0  # a ratio of speeds that noise does not explain
_AGREEING_SHARE = 0.6  # of the legs have the median ratio
_MIN_LEGS_COUNT = 10
_MAX_SPEED_MPS = 70.0  # of road vehicles
_MIN_FRAMES_COUNT = 50  # of a vehicle: whole numbers in shorter logs may be seconds
_MAX_CRAWL_MPS = 3.0  # no vehicle is faster: whole numbers may be frames
_MIN_CRAWL_M = 20.0
_FRAME_RATES_HZ = (10, 12.5, 15, 20, 24, 25, 30, 29.97, 50, 60, 100)
_SPEED_UNITS = {
    "kmh": 3.6,
    "mph": 1 / 0.44704,
    "kn": 3600 / 1852,
    "fps": 1 / 0.3048,
    "cmps": 100.0,
}
_SPEED_NAMES = {"kmh": "km/h", "mph": "mph", "kn": "knots", "fps": "ft/s", "cmps": "cm/s"}
_POSITION_UNITS_M = {"ft": 0.3048, "cm": 0.01, "km": 1000.0}
_POSITION_NAMES = {"ft": "feet", "cm": "centimetres", "km": "kilometres"}
_TIME_UNITS_S = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_USUAL_PERIOD_S = (0.005, 2.0)
_SLOWEST_PERIOD_S = 5.0
_DEGREE_UNITS = {"e7": 1e-7, "ddmm": 1.0, "min": 1 / 60.0}
_RADIAN_TOLERANCE_RATIO = 1.15
_SCALED_POSITIONS = ("x", "y")


def interpret(log: RawLog, config: LogConfig) -> tuple[RawLog, list[str], list[Doubt]]:
    """Return a log in units that agree with each other, notes on changed ones, and doubts."""
    reading = Reading(log, config)
    _find_time_unit(reading)
    if log.geographic:
        _find_degrees(reading)
    _find_speed_ratio(reading)
    _find_frame_rate(reading)
    interpret_headings(reading)
    return reading.log, reading.notes, reading.doubts


def _scaled_stamps(factor: float) -> Callable[[Observations], Observations]:
    """Return a function that scales the stamps of a vehicle."""

    def scale(stamps: Ints) -> Ints:
        return np.round(stamps * factor).astype(np.int64)

    return lambda vehicle: replace(
        vehicle, fix_ns=scale(vehicle.fix_ns), speed_ns=scale(vehicle.speed_ns)
    )


def _scaled_positions(factor: float) -> Callable[[Observations], Observations]:
    return lambda vehicle: replace(vehicle, fix=vehicle.fix * factor)


def _scaled_speeds(factor: float) -> Callable[[Observations], Observations]:
    return lambda vehicle: replace(vehicle, speed=vehicle.speed * factor)


# Degrees


def _doubt_degrees(reading: Reading, latitude: float, others: Sequence[str]) -> None:
    """Add the doubt that latitudes and longitudes may have other units."""
    options = " or ".join(reading.option(**_unit_options(reading, other)) for other in others)
    reading.add_doubt(
        Quantity.POSITION,
        latitude,
        "latitude and longitude may be degrees and minutes (ddmm) or minutes (min), and no speeds "
        "tell which",
        f"{reading.option()}, or {options}",
    )


def _find_degrees(reading: Reading) -> None:
    """Convert latitudes and longitudes without a unit that cannot be degrees."""
    fix = np.concatenate([vehicle.fix for vehicle in reading.log.vehicles] or [np.zeros((0, 2))])
    fix = np.abs(fix[np.isfinite(fix).all(axis=1)])
    if not len(fix) or not (reading.is_assumed("lat") and reading.is_assumed("lon")):
        return
    latitude, longitude = np.median(fix, axis=0)
    if latitude <= 90.0 and longitude <= 180.0:
        _find_radians(reading)
        return
    units = [unit for unit in _DEGREE_UNITS if _suits_globe(fix, unit)]
    if len(units) > 1:
        units = _units_by_speeds(reading, units)
    if not units or (90.0 < latitude <= 180.0 and longitude <= 90.0):
        return  # cleaning says what they look like
    unit = units[0]
    reading.use_unit(unit, "lat", "lon")
    if len(units) > 1:
        _doubt_degrees(reading, float(latitude), units[1:])
    reading.notes.append(f"latitude and longitude are read in the unit {unit}: {reading.option()}")
    reading.change(_converted_degrees(unit))


def _unit_options(reading: Reading, unit: str) -> dict[str, str]:
    columns = {quantity: reading.column(quantity) for quantity in ("lat", "lon")}
    return {name: column.option(unit) for name, column in columns.items() if column is not None}


def _suits_globe(fix: Floats, unit: str) -> bool:
    """Return whether absolute latitudes and longitudes (F, 2) in a unit are on the globe."""
    if unit == "ddmm":
        if (np.median(fix % 100.0 >= 60.0, axis=0) > 0.0).any() or (fix % 100.0 >= 60.0).any():
            return False
        return bool((np.median(fix, axis=0) <= (9_000.0, 18_000.0)).all())
    degrees = np.median(fix, axis=0) * _DEGREE_UNITS[unit]
    is_small = unit == "e7" and degrees.max() < 0.01
    return bool((degrees <= (90.0, 180.0)).all()) and not is_small


def _in_degrees(values: Floats, unit: str) -> Floats:
    if unit != "ddmm":
        return values * _DEGREE_UNITS[unit]
    degrees = np.trunc(values / 100.0)
    return degrees + (values - 100.0 * degrees) / 60.0


def _converted_degrees(unit: str) -> Callable[[Observations], Observations]:
    return lambda vehicle: replace(vehicle, fix=_in_degrees(vehicle.fix, unit))


def _units_by_speeds(reading: Reading, units: list[str]) -> list[str]:
    """Return the units in which displacements agree with the recorded speeds; all if unknown."""
    spreads = []
    for unit in units:
        legs = legs_of(
            [_converted_degrees(unit)(vehicle) for vehicle in reading.log.vehicles],
            geographic=True,
        )
        ratios = _ratios(legs)
        if len(ratios) < _MIN_LEGS_COUNT:
            return units
        spreads.append(float(np.percentile(np.abs(np.log(ratios / np.median(ratios))), 90.0)))
    best = int(np.argmin(spreads))
    is_clear = all(
        spread > 2.0 * spreads[best] + 0.02 for k, spread in enumerate(spreads) if k != best
    )
    return [units[best]] if is_clear else units


def _find_radians(reading: Reading) -> None:
    """Convert latitudes and longitudes in radians, if the speeds show them."""
    legs = reading.legs()
    ratios = _ratios(legs)
    if len(ratios) < _MIN_LEGS_COUNT or np.median(ratios) < np.degrees(1.0) / 2.0:
        return
    radians = legs_of(
        [replace(vehicle, fix=np.degrees(vehicle.fix)) for vehicle in reading.log.vehicles],
        geographic=True,
    )
    deviation = np.abs(np.log(_ratios(radians)))
    if len(deviation) and np.percentile(deviation, 75.0) < np.log(_RADIAN_TOLERANCE_RATIO):
        reading.use_unit("rad", "lat", "lon")
        reading.notes.append(f"latitude and longitude are in radians: {reading.option()}")
        reading.change(lambda vehicle: replace(vehicle, fix=np.degrees(vehicle.fix)))


# Time and speed


def _find_time_unit(reading: Reading) -> None:
    """Convert times without a unit whose steps are too long for seconds."""
    period = median_period(reading.log.vehicles)
    if not reading.is_assumed("time") or not period > _SLOWEST_PERIOD_S:
        return
    shortest, longest = _USUAL_PERIOD_S
    units = [u for u, factor in _TIME_UNITS_S.items() if shortest <= period * factor <= longest]
    if len(units) == 1:
        reading.use_unit(units[0], "time")
        reading.notes.append(
            f"positions are {period:g} apart in time, so it is in {units[0]}: {reading.option()}"
        )
        reading.change(_scaled_stamps(_TIME_UNITS_S[units[0]]))


def _ratios(legs: Legs) -> Floats:
    """Return recorded speed over the rate of the positions (K,), where both are known."""
    known = np.isfinite(legs.speed) & (legs.rate > 0.0)
    ratios: Floats = legs.speed[known] / legs.rate[known]
    return ratios


@dataclass(frozen=True)
class _Explanation:
    """A unit that explains a ratio of speeds.

    Attributes:
        text: the unit, for people.
        unit: in the parameter `columns`.
        quantities: the columns with this unit.
        change: converts a vehicle.
    """

    text: str
    unit: str
    quantities: tuple[str, ...]
    change: Callable[[Observations], Observations]


def _find_speed_ratio(reading: Reading) -> None:
    """Convert the unit that explains speeds which contradict the positions, or add a doubt."""
    legs = reading.legs()
    ratios = _ratios(legs)
    is_slow = median_period(reading.log.vehicles) > _SLOWEST_PERIOD_S
    if len(ratios) < _MIN_LEGS_COUNT or is_slow:  # cleaning says what such a time looks like
        return
    ratio = float(np.median(ratios))
    if reading.log.geographic and _is_swapped(legs):
        _doubt_order(reading, ratio)
        return
    agreeing = np.abs(np.log(ratios / ratio)) < np.log(_SPREAD_RATIO)
    if _deviation(ratio) <= _WRONG_RATIO or agreeing.mean() < _AGREEING_SHARE:
        return
    fact = f"the recorded speeds are {ratio:.2f} times those of the positions"
    explanations = _best_explanations(reading, legs, ratio, reading.is_assumed)
    if explanations:
        _apply(reading, fact, explanations)
        return
    named = _best_explanations(reading, legs, ratio, reading.is_column)
    cause = f"{fact}: check the units of time, positions and speeds"
    remedy = "name them with --set log.columns=…" if reading.log.columns else ""
    if named:
        cause = f"{fact}; they would fit with {named[0].text}"
        remedy = _option_of(reading, named[0])
    # The positions decide, so a wrong unit of speeds alone does no harm.
    is_gross = _deviation(ratio) > _GROSS_RATIO or any(
        explanation.quantities != ("speed",) for explanation in named
    )
    is_harmless = bool(named) and named[0].quantities == ("speed",)
    stops = bool(reading.log.columns) and is_gross and not is_harmless
    reading.doubts.append(Doubt("", 0.0, 0.0, Quantity.SPEED, ratio, "", cause, remedy, stops))


def _best_explanations(
    reading: Reading, legs: Legs, ratio: float, may_change: Callable[[str], bool]
) -> list[_Explanation]:
    """Return what explains the median ratio, or else the ratio of the distances."""
    explanations = list(_explanations(reading, legs, ratio, may_change))
    return explanations or list(_explanations(reading, legs, legs_ratio(legs), may_change))


def _doubt_order(reading: Reading, ratio: float) -> None:
    """Add a doubt about swapped latitudes and longitudes."""
    latitude, longitude = reading.column("lat"), reading.column("lon")
    remedy = "swap latitude and longitude"
    if latitude is not None and longitude is not None:
        remedy = reading.option(lat=longitude.option(), lon=latitude.option())
    cause = "the recorded speeds fit the positions only if lat and lon are swapped"
    reading.add_doubt(Quantity.POSITION, ratio, cause, remedy)


def legs_ratio(legs: Legs) -> float:
    """Return the recorded speeds over the rates of the positions, by distance."""
    known = np.isfinite(legs.speed)
    distance = np.hypot(*legs.step[known].T).sum()
    return float((legs.speed[known] * legs.seconds[known]).sum() / max(distance, 1e-9))


def _deviation(ratio: float) -> float:
    """Return a ratio or its inverse, whichever is larger."""
    return max(ratio, 1.0 / max(ratio, 1e-9))


def _is_swapped(legs: Legs) -> bool:
    """Return whether speeds fit the positions of all legs only with swapped columns.

    Legs whose length depends on the order are compared with the others, in whatever unit the
    speeds are.
    """
    known = np.isfinite(legs.speed)
    swapped_rate = np.hypot(*legs.swapped[known].T) / legs.seconds[known]
    stretch = np.log(np.maximum(swapped_rate, 1e-9) / legs.rate[known])
    depends = np.abs(stretch - np.median(stretch)) > _SWAP_STRETCH_RATIO
    if min(depends.sum(), (~depends).sum()) < _MIN_LEGS_COUNT / 2:
        return False

    def fitting_share(ratios: Floats) -> float:
        deviation = np.abs(np.log(ratios[depends] / np.median(ratios[~depends])))
        return float((deviation < np.log(_SAME_SPEED_RATIO)).mean())

    plain = fitting_share(legs.speed[known] / legs.rate[known])
    swapped = fitting_share(legs.speed[known] / np.maximum(swapped_rate, 1e-9))
    return swapped > _SWAPPED_SHARE and plain < 1.0 - _SWAPPED_SHARE


def _explanations(
    reading: Reading, legs: Legs, ratio: float, may_change: Callable[[str], bool]
) -> Iterator[_Explanation]:
    """Yield the units that explain a ratio of recorded speeds to those of positions.

    Args:
        reading: the log.
        legs: its legs.
        ratio: of recorded speeds to the rates of the positions.
        may_change: whether the unit of a quantity may be another one.
    """
    known = np.isfinite(legs.speed)
    by_position = float(np.median(legs.rate[known]))
    by_speed = float(np.median(legs.speed[known]))
    column = reading.column("time")
    if may_change("time") and counts_steps(reading.log.vehicles):
        yield from _frame_rates(reading, ratio)
        if column is not None and column.counts_frames:
            return
    if may_change("speed") and by_position < _MAX_SPEED_MPS:
        for unit in _units_near(ratio, _SPEED_UNITS):
            change = _scaled_speeds(1.0 / _SPEED_UNITS[unit])
            yield _Explanation(f"speeds in {_SPEED_NAMES[unit]}", unit, ("speed",), change)
    is_metric = not reading.log.geographic and may_change("x") and may_change("y")
    if is_metric and by_speed < _MAX_SPEED_MPS:
        for unit in _units_near(ratio, _POSITION_UNITS_M):
            text = f"x, y in {_POSITION_NAMES[unit]}"
            change = _scaled_positions(_POSITION_UNITS_M[unit])
            yield _Explanation(text, unit, _SCALED_POSITIONS, change)


def _units_near(ratio: float, units: dict[str, float]) -> list[str]:
    return [unit for unit, factor in units.items() if _is_near(ratio, factor)]


def _frame_rates(reading: Reading, ratio: float) -> Iterator[_Explanation]:
    """Yield the frame rates that explain a ratio, with speeds in m/s, or else in another unit."""
    units = {"": 1.0} | (_SPEED_UNITS if reading.is_assumed("speed") else {})
    for unit, factor in units.items():
        if unit and not reading.is_assumed("time"):
            return
        rates = [rate for rate in _FRAME_RATES_HZ if _is_near(ratio, rate * factor)]
        if not rates:
            continue
        rate = min(rates, key=lambda each: abs(ratio / (each * factor) - 1.0) // _EQUAL_RATIO)
        time = _scaled_stamps(1.0 / rate)
        speed = _scaled_speeds(1.0 / factor)
        text = f"time in frames, {rate:g} per second"
        if unit:
            text += f", and speeds in {_SPEED_NAMES[unit]} (speed=…:{unit})"
        yield _Explanation(text, f"{rate:g}fps", ("time",), _in_turn(time, speed))
        return


def _in_turn(
    first: Callable[[Observations], Observations], second: Callable[[Observations], Observations]
) -> Callable[[Observations], Observations]:
    return lambda vehicle: second(first(vehicle))


def _is_near(ratio: float, factor: float) -> bool:
    return abs(ratio / factor - 1.0) < _SAME_RATIO


def _apply(reading: Reading, fact: str, explanations: Sequence[_Explanation]) -> None:
    """Convert the units of the only explanation; of several, use none and add a doubt."""
    first = explanations[0]
    if len(explanations) == 1:
        reading.use_unit(first.unit, *first.quantities)
        reading.change(first.change)
        reading.notes.append(f"{fact}: read with {first.text}: {reading.option()}")
        return
    options = [f"{each.text}: {_option_of(reading, each)}" for each in explanations]
    reading.add_doubt(Quantity.SPEED, 0.0, fact, " or ".join(options))


def _option_of(reading: Reading, explanation: _Explanation) -> str:
    """Return the option that reads a log with the unit of an explanation."""
    columns = {name: reading.column(name) for name in explanation.quantities}
    changes = {n: c.option(explanation.unit) for n, c in columns.items() if c is not None}
    return reading.option(**changes)


def _find_frame_rate(reading: Reading) -> None:
    """Add a doubt if the time is a number of frames, and nothing shows their rate."""
    time = reading.column("time")
    if time is None or "time" in reading.changes or time.unit:
        return
    if any(doubt.quantity is Quantity.SPEED for doubt in reading.doubts):
        return
    vehicles = reading.log.vehicles
    if not time.counts_frames:
        if not (counts_steps(vehicles) and _crawls(reading)):
            return
        cause = (
            f"column {time.name} counts in steps of 1 and no vehicle is faster than "
            f"{_MAX_CRAWL_MPS:g} m/s: it looks like a number of frames"
        )
    else:
        ratios = _ratios(reading.legs())
        if len(ratios) >= _MIN_LEGS_COUNT and _deviation(float(np.median(ratios))) < _WRONG_RATIO:
            return
        cause = f"column {time.name} counts frames, and no speeds show how many there are a second"
    remedy = f"name the rate, e.g. {reading.option(time=time.option('25fps'))}"
    reading.add_doubt(Quantity.CLOCK, 1.0, cause, remedy)


def _crawls(reading: Reading) -> bool:
    """Return whether vehicles without measured speeds drive far, all of them very slowly."""
    vehicles = reading.log.vehicles
    if any(len(vehicle.speed_ns) for vehicle in vehicles):
        return False
    if len(vehicles) < 2 or abs(median_period(vehicles) - 1.0) > 1e-6:
        return False
    legs = reading.legs()
    if not len(legs.rate) or np.percentile(legs.rate, 99.0) > _MAX_CRAWL_MPS:
        return False
    extent = max(float(np.hypot(*np.ptp(vehicle.fix, axis=0))) for vehicle in vehicles)
    n_fixes = max(len(vehicle.fix_ns) for vehicle in vehicles)
    return extent > _MIN_CRAWL_M and n_fixes > _MIN_FRAMES_COUNT
