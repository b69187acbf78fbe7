# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How a table is read: its columns, units, and headings."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scenario_gen.logs.column import Column
from scenario_gen.logs.columns import with_columns
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.legs import Legs, legs_of
from scenario_gen.logs.quality import Doubt, Quantity
from scenario_gen.logs.raw import Observations, RawLog
from scenario_gen.numerics import Floats, wrap_angle

_FRAMES_PER_LEG_COUNT = 10


@dataclass
class Reading:
    """A log while its units are determined.

    Attributes:
        log: with the units found so far.
        config: names columns.
        changes: columns as in the parameter `columns`, by quantity, for units that were found.
        notes: on what was found.
        doubts: contradictions that remain.
    """

    log: RawLog
    config: LogConfig
    changes: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    doubts: list[Doubt] = field(default_factory=list)

    def column(self, quantity: str) -> Column | None:
        """Return the column of a quantity, if the log is a table that has it."""
        return self.log.columns.get(quantity)

    def is_assumed(self, quantity: str) -> bool:
        """Return whether neither the name of a column nor the parameter names its unit."""
        column = self.column(quantity)
        return column is not None and not column.unit

    def is_column(self, quantity: str) -> bool:
        """Return whether the log is a table with a column of a quantity."""
        return self.column(quantity) is not None

    def option(self, **changes: str) -> str:
        """Return the option of the commands with all units found, and further changes."""
        return with_columns(self.config.columns, self.changes | changes)

    def use_unit(self, unit: str, *quantities: str) -> None:
        """Note the unit of some columns for the option."""
        for quantity in quantities:
            column = self.column(quantity)
            if column is not None:
                self.changes[quantity] = column.option(unit)

    def change(self, function: Callable[[Observations], Observations]) -> None:
        """Replace each vehicle."""
        self.log = replace(self.log, vehicles=tuple(map(function, self.log.vehicles)))

    def legs(self) -> Legs:
        """Return the legs in the units found so far."""
        counts_frames = self.is_assumed("time") and "time" not in self.changes
        counts_frames = counts_frames and counts_steps(self.log.vehicles)
        least_steps = _FRAMES_PER_LEG_COUNT if counts_frames else 1
        vehicles = self.log.vehicles
        return legs_of(vehicles, geographic=self.log.geographic, least_steps=least_steps)

    def add_doubt(self, quantity: Quantity, size: float, cause: str, remedy: str) -> None:
        """Add a doubt about the whole log."""
        self.doubts.append(Doubt("", 0.0, 0.0, quantity, size, "", cause, remedy))


def counts_steps(vehicles: Sequence[Observations]) -> bool:
    """Return whether all stamps are whole numbers of seconds, as a number of frames is."""
    return all((vehicle.fix_ns % 10**9 == 0).all() for vehicle in vehicles)


_FIT_RAD = float(np.radians(15.0))  # a heading in the right convention is nearer to the course
_CONTRADICTION_RAD = float(np.radians(25.0))
_MIN_FIT_SHARE = 0.9  # of the legs, for an explanation
_MIN_GAIN_SHARE = 0.05  # of the legs that an explanation adds
_MIN_LEGS_COUNT = 10
_MIN_LEG_M = 1.0  # shorter legs have no course
_MIN_LEG_MPS = 1.0
_QUARTER_RAD = float(np.pi / 2.0)


@dataclass(frozen=True)
class _Convention:
    """A convention of headings that a column may have: `convert` returns ours."""

    text: str
    unit: str
    convert: Callable[[Floats], Floats]


_DEGREES = _Convention("in degrees", "deg", np.radians)
_NORTH_DEGREES = _Convention(
    "in degrees clockwise from north", "north_deg", lambda h: _QUARTER_RAD - np.radians(h)
)
_NORTH = _Convention("clockwise from north, in radians", "", lambda h: _QUARTER_RAD - h)
_ASSUMABLE = (_DEGREES, _NORTH_DEGREES, _NORTH)
_RECORDED = _Convention("as recorded", "", lambda h: h)
_CLOCKWISE = _Convention("clockwise", "", lambda h: -h)
_MIRRORS: dict[str, Callable[[Floats], Floats]] = {
    "x": lambda course: np.pi - course,
    "y": lambda course: -course,
}


def interpret_headings(reading: Reading) -> None:
    """Convert headings whose convention is assumed and wrong; add a doubt for mirrored axes."""
    legs = reading.legs()
    length = np.hypot(*legs.step.T)
    used = np.isfinite(legs.heading) & (length > _MIN_LEG_M) & (legs.rate > _MIN_LEG_MPS)
    recorded = legs.heading[used]
    course = legs.course[used]
    if len(recorded) < _MIN_LEGS_COUNT:
        return
    error = np.abs(wrap_angle(recorded - course))
    fit = float((error < _FIT_RAD).mean())
    if (error > _CONTRADICTION_RAD).mean() < _MIN_GAIN_SHARE:
        return
    needed = max(_MIN_FIT_SHARE, fit + _MIN_GAIN_SHARE)

    def explains(convention: _Convention, direction: Floats) -> bool:
        off = np.abs(wrap_angle(convention.convert(recorded) - direction))
        return bool((off < _FIT_RAD).mean() >= needed)

    fact = (
        f"{100.0 * (error > _CONTRADICTION_RAD).mean():.0f} % of the recorded headings are far "
        "off the direction of travel"
    )
    if reading.is_assumed("heading"):
        fitting = [convention for convention in _ASSUMABLE if explains(convention, course)]
        if fitting:
            _convert(reading, fact, fitting[0])
            return
    mirrored = _mirrored_axis(reading, course, explains)
    if mirrored:
        _doubt_axis(reading, fact, mirrored, float((error > _CONTRADICTION_RAD).mean()))
        return
    reading.notes.append(
        f"{fact}; headings that contradict it are not used{_hint(explains, course)}"
    )


def _hint(explains: Callable[[_Convention, Floats], bool], course: Floats) -> str:
    """Return the other convention that headings with a named one fit; "" if there is none."""
    for convention in (_NORTH, _DEGREES, _NORTH_DEGREES, _CLOCKWISE):
        if explains(convention, course):
            return f"; they would fit if they were {convention.text}"
    if explains(_RECORDED, course + np.pi):
        return "; they would fit if they were turned by 180°"
    return ""


def _convert(reading: Reading, fact: str, convention: _Convention) -> None:
    """Convert the headings of all vehicles."""
    option = ""
    if convention.unit:
        reading.use_unit(convention.unit, "heading")
        option = f": {reading.option()}"
    elif not reading.log.geographic:
        option = ", or if x and y are swapped (log.columns=x=…,y=…)"
    reading.notes.append(f"{fact}: read as {convention.text}{option}")
    reading.change(lambda vehicle: replace(vehicle, heading=convention.convert(vehicle.heading)))


def _mirrored_axis(
    reading: Reading, course: Floats, explains: Callable[[_Convention, Floats], bool]
) -> str:
    """Return the axis that, mirrored, makes headings fit: x or y; "" if there is none."""
    order = ("x", "y") if reading.log.geographic else ("y", "x")
    conventions = [_RECORDED]
    if reading.is_assumed("heading"):
        conventions += [_NORTH_DEGREES, _DEGREES]
    for convention in conventions:
        for axis in order:
            if explains(convention, _MIRRORS[axis](course)):
                return axis
    return ""


def _doubt_axis(reading: Reading, fact: str, axis: str, share: float) -> None:
    """Add a doubt about an axis that is mirrored by the headings."""
    quantity = axis
    text = f"{axis} points the other way"
    if reading.log.geographic:
        quantity = {"x": "lon", "y": "lat"}[axis]
        text = "longitude is counted positive to the west"
        if axis == "y":
            text = "latitude is counted positive to the south"
    column = reading.column(quantity)
    remedy = f"mirror {quantity}"
    if column is not None:
        unit = reading.changes.get(quantity, "").rpartition(":")[2]
        remedy = reading.option(**{quantity: column.option(unit, flipped=True)})
    heading = reading.column("heading")
    if heading is not None and axis == "y" and not reading.log.geographic:
        flipped = reading.option(heading=heading.option(flipped=True))
        remedy += f" (if the headings, not y, are the other way round: {flipped})"
    reading.add_doubt(Quantity.FRAME, share, f"{fact}; they fit if {text}", remedy)
