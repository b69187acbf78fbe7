# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Directions of a vehicle: its headings and velocities against its displacements."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from scenario_gen.logs.comparison import (
    Change,
    Comparison,
    Convert,
    EVIDENCE,
    Reading,
    swapped_fix,
    with_fix,
    with_heading,
)
from scenario_gen.logs.quality import Quantity
from scenario_gen.logs.raw import Observations
from scenario_gen.numerics import Floats

_QUARTER_RAD = float(np.pi / 2.0)
_CONVENTIONS: tuple[tuple[str, str, Callable[[Floats], Floats]], ...] = (
    ("deg", "headings are in degrees", np.radians),
    (
        "north_deg",
        "headings are in degrees clockwise from north",
        lambda heading: _QUARTER_RAD - np.radians(heading),
    ),
    (
        "north_rad",
        "headings are clockwise from north, in radians",
        lambda heading: _QUARTER_RAD - heading,
    ),
)
"""Conventions of headings that a column may have: unit, text, and conversion to ours."""


def check_directions(reading: Reading) -> None:
    """Use the convention of headings that agrees with the positions, or doubt an axis."""
    vehicles = reading.log.vehicles
    if not any(v.course is not None or np.isfinite(v.heading).any() for v in vehicles):
        return
    compared = _without_body_frames(reading)
    names = {"heading": "headings", "course": "velocities"}
    quantity = next((name for name in names if compared.contradicts(f"{name}_off")), "")
    if not quantity:
        return
    share = float(np.nanmean(getattr(compared, f"{quantity}_off")))
    fact = (
        f"{100.0 * share:.0f} % of the recorded {names[quantity]} are far off the direction of "
        "travel"
    )
    changes = _agreeing_changes(reading, quantity)
    names_off = _vehicles_off(reading, compared, f"{quantity}_off")
    if changes:
        reading.resolve(Quantity.FRAME, share, fact, changes)
    elif names_off and reading.has(quantity):
        cause = f"{fact}, nearly all of vehicles {names_off}; others agree"
        reading.doubt(Quantity.FRAME, share, cause, reading.option(**{quantity: "none"}))
    else:
        reading.notes.append(f"{fact}; {names[quantity]} that contradict it are not used")


def _vehicles_off(reading: Reading, compared: Comparison, name: str) -> str:
    """Return the vehicles that nothing but a direction contradicts, and too fast to reverse.

    None if few are so, if no vehicle agrees, or if all headings are one default value.
    """
    headings = np.unique(np.concatenate([vehicle.heading for vehicle in reading.tried()]))
    if name == "heading_off" and np.isfinite(headings).sum() < 2:
        return ""
    shares = getattr(compared, name)
    is_off = (shares > EVIDENCE.agreeing_share) & (compared.fastest > EVIDENCE.max_reverse_mps)
    n_known = np.isfinite(shares).sum()
    if is_off.sum() <= EVIDENCE.many_share * n_known or not (shares < EVIDENCE.off_share).any():
        return ""
    return ", ".join(v.id for v, off in zip(reading.tried(), is_off, strict=True) if off)


def _agreeing_changes(reading: Reading, quantity: str) -> list[Change]:
    """Return the conventions of headings, or else of axes, with which all directions agree."""
    conventions = list(_conventions(reading))
    mirrors = list(_mirrors(reading))
    changes = reading.agreeing(conventions, _directions_agree) if quantity == "heading" else []
    if changes:
        is_turned = changes[0].columns == reading.units("north_rad", "heading")
        return changes + [m for m in mirrors if is_turned and m.columns.keys() == {"x", "y"}]
    axes = [mirror for mirror in mirrors if "heading" not in mirror.columns]
    both = [_both(axis, convention) for axis in axes for convention in conventions]
    if conventions:
        columns = reading.column("heading", "deg", flipped=True)
        clockwise = with_heading(lambda heading: -np.radians(heading))
        text = "headings are counted clockwise, in degrees"
        both.append(Change(text, columns, clockwise, is_unit=False))
    agreeing = reading.agreeing(mirrors, _directions_agree)
    return agreeing or reading.agreeing(both, _directions_agree)


def _without_body_frames(reading: Reading) -> Comparison:
    """Compare directions; velocities that point ahead all the time are those of a body frame."""

    def in_frame(vehicle: Observations) -> Observations:
        if vehicle.course is None:
            return vehicle
        is_ahead = (
            np.nanpercentile(np.abs(np.append(0.0, vehicle.course)), 90.0) < EVIDENCE.off_rad
        )
        return replace(vehicle, course=None) if is_ahead else vehicle

    vehicles = tuple(map(in_frame, reading.log.vehicles))
    reading.log = replace(reading.log, vehicles=vehicles)
    return reading.compared()


def _directions_agree(compared: Comparison) -> bool:
    """Return whether all directions agree with the displacements."""
    return not (compared.contradicts("heading_off") or compared.contradicts("course_off"))


def _conventions(reading: Reading) -> Iterator[Change]:
    """Yield the conventions of headings whose unit nothing names."""
    if reading.is_assumed("heading"):
        for unit, text, convert in _CONVENTIONS:
            yield Change(text, reading.units(unit, "heading"), with_heading(convert))


def _mirrors(reading: Reading) -> Iterator[Change]:
    """Yield the ways in which axes or directions may be mirrored or swapped."""
    first, second = ("lat", "lon") if reading.log.geographic else ("x", "y")
    texts = {
        "x": "x points the other way",
        "y": "y points the other way",
        "lat": "latitude is counted positive to the south",
        "lon": "longitude is counted positive to the west",
        "heading": "headings are counted clockwise",
        "vy": "vy points the other way",
    }

    def change(name: str, convert: Convert) -> Change:
        return Change(texts[name], reading.column(name, flipped=True), convert, is_unit=False)

    yield change(second, with_fix(lambda fix: fix * (1.0, -1.0)))
    swap = reading.swapped(first, second)
    yield Change(f"{first} and {second} are swapped", swap, with_fix(swapped_fix), is_unit=False)
    yield change(first, with_fix(lambda fix: fix * (-1.0, 1.0)))
    if reading.has("heading"):
        yield change("heading", with_heading(np.negative))
    if reading.has("vy"):
        yield change("vy", _with_other_course)


def _with_other_course(vehicle: Observations) -> Observations:
    return replace(vehicle, course=None if vehicle.course is None else -vehicle.course)


def _both(mirror: Change, convention: Change) -> Change:
    """Return two changes in turn."""
    return Change(
        f"{mirror.text}, and {convention.text}",
        {**mirror.columns, **convention.columns},
        lambda vehicle: convention.convert(mirror.convert(vehicle)),
        is_unit=False,
    )
