# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Directions of a vehicle: its headings and velocities against its displacements."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from scenario_gen.logs.columns import with_columns
from scenario_gen.logs.comparison import (
    both,
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
from scenario_gen.numerics import Floats


@dataclass(frozen=True)
class _Heading:
    """A convention of headings that a column may have: `convert` returns ours."""

    text: str
    unit: str
    convert: Callable[[Floats], Floats]


_QUARTER_RAD = float(np.pi / 2.0)
_RECORDED = _Heading("as recorded", "", lambda h: h)
_CONVENTIONS = (
    _Heading("in degrees", "deg", np.radians),
    _Heading(
        "in degrees clockwise from north", "north_deg", lambda h: _QUARTER_RAD - np.radians(h)
    ),
    _Heading("clockwise from north, in radians", "north_rad", lambda h: _QUARTER_RAD - h),
)
_OTHER_HEADINGS = (
    *_CONVENTIONS,
    _Heading("clockwise", "", lambda h: -h),
    _Heading("turned by 180°", "", lambda h: h + np.pi),
)


def check_directions(reading: Reading) -> None:
    """Use the convention of headings that agrees with the positions, or doubt an axis."""
    compared = _without_body_frames(reading)
    quantity = next((q for q in ("heading", "course") if compared.contradicts(f"{q}_off")), "")
    if not quantity:
        return
    shares = getattr(compared, f"{quantity}_off")
    share = float(np.nanmean(shares))
    name = "headings" if quantity == "heading" else "velocities"
    fact = f"{100.0 * share:.0f} % of the recorded {name} are far off the direction of travel"
    conventions = _CONVENTIONS if reading.is_assumed("heading") else ()
    if quantity == "heading":
        for heading in conventions:
            convert = with_heading(heading.convert)
            if _directions_agree(reading, convert):
                swap = "" if heading.unit != "north_rad" else _swap_hint(reading)
                reading.apply(Change("", reading.units(heading.unit, "heading"), convert))
                text = f"{fact}: read as {heading.text}: {reading.option()}{swap}"
                reading.notes.append(text)
                return
    for (text, columns, turned), heading in product(_axes(reading), (_RECORDED, *conventions)):
        convert = both(with_fix(turned), with_heading(heading.convert))
        if _directions_agree(reading, convert):
            units = reading.units(heading.unit, "heading") if heading.unit else {}
            remedy = reading.option(**columns, **units) if columns else ""
            remedy += _other_way(reading, quantity, columns)
            reading.doubt(Quantity.FRAME, share, f"{fact}; they fit if {text}", remedy)
            return
    hints = [
        f"; they would fit if they were {each.text}"
        for each in _OTHER_HEADINGS
        if quantity == "heading" and _directions_agree(reading, with_heading(each.convert))
    ]
    hint = hints[0] if hints else ""
    reading.notes.append(f"{fact}; {name} that contradict it are not used{hint}")


def _without_body_frames(reading: Reading) -> Comparison:
    """Compare directions; velocities that point ahead all the time are those of a body frame."""
    ahead = [
        vehicle.course is not None
        and np.nanpercentile(np.abs([0.0, *vehicle.course]), 90.0) < EVIDENCE.off_rad
        for vehicle in reading.log.vehicles
    ]
    if any(ahead):
        vehicles = [
            replace(vehicle, course=None) if is_ahead else vehicle
            for vehicle, is_ahead in zip(reading.log.vehicles, ahead, strict=True)
        ]
        reading.log = replace(reading.log, vehicles=tuple(vehicles))
    return reading.compared()


def _directions_agree(reading: Reading, convert: Convert) -> bool:
    compared = reading.compared(convert)
    return not (compared.contradicts("heading_off") or compared.contradicts("course_off"))


def _axes(reading: Reading) -> list[tuple[str, dict[str, str], Callable[[Floats], Floats]]]:
    """Return the ways in which axes may be mirrored or swapped: text, columns, and conversion."""
    first, second = ("lat", "lon") if reading.log.geographic else ("x", "y")

    def flip(axis: int) -> Callable[[Floats], Floats]:
        return lambda fix: fix * ((-1.0, 1.0), (1.0, -1.0))[axis]

    texts = ("x points the other way", "y points the other way")
    if reading.log.geographic:
        texts = (
            "latitude is counted positive to the south",
            "longitude is counted positive to the west",
        )
    return [
        (texts[1], reading.column(second, flipped=True), flip(1)),
        (f"{first} and {second} are swapped", reading.swapped(first, second), swapped_fix),
        (texts[0], reading.column(first, flipped=True), flip(0)),
    ]


def _other_way(reading: Reading, quantity: str, columns: Mapping[str, str]) -> str:
    """Return the option for the case that the directions, not y, are the other way round."""
    if list(columns) != ["y"]:
        return ""
    other = "heading" if quantity == "heading" else "vy"
    if not reading.has(other):
        return ""
    option = reading.option(**reading.column(other, flipped=True))
    return f" (if {other}, not y, is the other way round: {option})"


def _swap_hint(reading: Reading) -> str:
    if reading.log.geographic or not reading.has("x", "y"):
        return ""
    option = with_columns(reading.config.columns, reading.swapped("x", "y"))
    return f", or if x and y are swapped: {option}"
