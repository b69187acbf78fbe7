# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The quantities of each vehicle compared with each other, as recorded or in another reading."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from scenario_gen.logs.columns import with_columns
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.legs import Legs, legs_of
from scenario_gen.logs.quality import Doubt, Quantity
from scenario_gen.logs.raw import Observations, RawLog
from scenario_gen.numerics import Floats, Ints, wrap_angle

Convert = Callable[[Observations], Observations]
_MAX_TRIED_COUNT = 100  # vehicles with which a reading is tried
_FRAMES_PER_LEG_COUNT = 10


@dataclass(frozen=True)
class EvidenceLimits:
    """Bounds beyond which two quantities of a vehicle contradict each other.

    Attributes:
        min_leg_count: displacements of a vehicle that are compared.
        wrong_ratio: of a recorded speed to that of the positions, or its inverse.
        same_ratio: the same, with the right units.
        gross_ratio: the same, which no sensor explains.
        tight_ratio: scatter of such ratios by which a pair of units is known.
        exact_ratio: the same, for the ratio of a pair of units.
        slow_share: of a vehicle's highest speed, below which the noise of places counts more.
        gross_share: of a vehicle's displacements whose speeds no sensor explains.
        off_share: of a vehicle's displacements that contradict.
        agreeing_share: of the vehicles, with a right reading.
        many_share: of the vehicles; contradictions of fewer are noted.
        off_rad: a direction that contradicts the displacement.
        min_leg_m: shorter displacements have no direction.
        max_speed_mps: of road vehicles.
        degrees_m: where no vehicle drives farther, x and y may be degrees.
        max_reverse_mps: no vehicle drives backwards faster.
        standing_m: no vehicle that drives stays within it.
        max_crawl_mps: where no vehicle is faster, whole numbers may be frames.
        min_crawl_m: distance that such a vehicle drives.
        min_crawl_count: rows of such a vehicle.
        min_driven_m: from its first place, by which a vehicle shows that it drives.
        origin_m: from the origin, within which only one vehicle can begin.
        usual_period_s: between fixes.
        slowest_period_s: between fixes; more has another unit.
        fastest_period_s: between fixes; less may have another unit.
    """

    min_leg_count: int = 10
    wrong_ratio: float = 1.2
    same_ratio: float = 1.03
    gross_ratio: float = 2.0
    tight_ratio: float = 1.02
    exact_ratio: float = 1.01
    slow_share: float = 0.3
    gross_share: float = 0.6
    off_share: float = 0.1
    agreeing_share: float = 0.9
    many_share: float = 0.2
    off_rad: float = float(np.radians(25.0))
    min_leg_m: float = 1.0
    max_speed_mps: float = 70.0
    degrees_m: float = 0.05
    max_reverse_mps: float = 5.0
    standing_m: float = 1.0
    max_crawl_mps: float = 3.0
    min_crawl_m: float = 20.0
    min_crawl_count: int = 50
    min_driven_m: float = 5.0
    origin_m: float = 0.5
    usual_period_s: tuple[float, float] = (0.005, 2.0)
    slowest_period_s: float = 5.0
    fastest_period_s: float = 0.005


EVIDENCE = EvidenceLimits()


@dataclass(frozen=True)
class Change:
    """Another reading of some columns.

    Attributes:
        text: the reading, for people, as a clause.
        columns: as in the parameter `columns`, by quantity.
        convert: applies it to a vehicle.
        is_unit: whether only units change; else the order of columns.
    """

    text: str
    columns: Mapping[str, str]
    convert: Convert
    is_unit: bool = True


@dataclass(frozen=True, eq=False)
class Comparison:
    """How far the quantities of V vehicles agree; NaN where too little is known.

    Attributes:
        ratio: (V,) median of recorded speeds over those of the positions.
        speed_off: (V,) share of displacements whose speed contradicts.
        gross_off: (V,) share of displacements whose speed no sensor explains.
        spread: (V,) 90th percentile of the deviation from the median ratio, as a logarithm.
        heading_off: (V,) share of displacements that a heading contradicts.
        course_off: (V,) share of displacements that the direction of a velocity contradicts.
        fastest: (V,) 90th percentile of the speed of the positions [m/s].
    """

    ratio: Floats
    speed_off: Floats
    gross_off: Floats
    spread: Floats
    heading_off: Floats
    course_off: Floats
    fastest: Floats

    @property
    def deviation(self) -> Floats:
        """(V,) the ratio or its inverse, whichever is larger."""
        return np.asarray(np.exp(np.abs(np.log(self.ratio))))

    @property
    def disagreement(self) -> float:
        """Mean share of displacements that something contradicts; infinite if nothing is known."""
        shares = np.concatenate((self.speed_off, self.heading_off, self.course_off))
        known = shares[np.isfinite(shares)]
        return float(known.mean()) if len(known) else np.inf

    def contradicts(self, name: str) -> bool:
        """Return whether a share of displacements is off for more than a few vehicles."""
        values = getattr(self, name)
        known = values[np.isfinite(values)]
        is_agreeing = known <= EVIDENCE.off_share
        return bool(len(known) and is_agreeing.mean() < EVIDENCE.agreeing_share)


def _compare(legs: Legs, n_vehicles: int) -> Comparison:
    """Compare the quantities of each vehicle."""
    values = np.full((7, n_vehicles), np.nan)
    rate, course = legs.rate, legs.course
    is_directed = (np.hypot(*legs.step.T) > EVIDENCE.min_leg_m) & (rate > EVIDENCE.min_leg_m)
    edges = np.searchsorted(legs.vehicle, np.arange(n_vehicles + 1))
    for k, (begin, end) in enumerate(pairwise(edges.tolist())):
        part = slice(begin, end)
        rates = rate[part]
        speed = np.where(rates > 0.0, legs.speed[part], np.nan)
        known = speed > EVIDENCE.slow_share * np.nanmax([0.0, *speed])  # at a stop, noise moves
        if known.sum() >= EVIDENCE.min_leg_count:
            ratios = np.log(speed[known] / rates[known])
            middle = float(np.median(ratios))
            values[0, k] = np.exp(middle)
            values[1, k] = (np.abs(ratios) > np.log(EVIDENCE.wrong_ratio)).mean()
            values[2, k] = (np.abs(ratios) > np.log(EVIDENCE.gross_ratio)).mean()
            values[3, k] = np.percentile(np.abs(ratios - middle), 90.0)
        for row, direction in ((4, legs.heading), (5, legs.velocity)):
            used = is_directed[part] & np.isfinite(direction[part])
            if used.sum() >= EVIDENCE.min_leg_count:
                error = np.abs(wrap_angle(direction[part][used] - course[part][used]))
                values[row, k] = (error > EVIDENCE.off_rad).mean()
        if len(rates) >= EVIDENCE.min_leg_count:
            values[6, k] = np.percentile(rates, 90.0)
    return Comparison(*values)


@dataclass
class Reading:
    """A log while its evidence is compared.

    Attributes:
        log: in the units found so far.
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

    def is_assumed(self, *quantities: str) -> bool:
        """Return whether neither the names of columns nor the parameter name their units."""
        columns = [self.log.columns.get(quantity) for quantity in quantities]
        return bool(columns) and all(column and not column.unit for column in columns)

    def has(self, *quantities: str) -> bool:
        """Return whether the log is a table with columns of all quantities."""
        return all(quantity in self.log.columns for quantity in quantities)

    def option(self, **changes: str) -> str:
        """Return the option of the commands with all units found, and further changes."""
        return with_columns(self.config.columns, self.changes | changes)

    def column(self, quantity: str, unit: str = "", *, flipped: bool = False) -> dict[str, str]:
        """Return a column in another unit as in the parameter `columns`; empty without one."""
        column = self.log.columns.get(quantity)
        if column is None:
            return {}
        unit = unit or self.changes.get(quantity, "").rpartition(":")[2]
        return {quantity: column.option(unit, flipped=flipped)}

    def swapped(self, first: str, second: str) -> dict[str, str]:
        """Return two columns that change places, as in the parameter `columns`; empty without."""
        if not self.has(first, second):
            return {}
        return {first: self.column(second)[second], second: self.column(first)[first]}

    def units(self, unit: str, *quantities: str) -> dict[str, str]:
        """Return columns in another unit as in the parameter `columns`."""
        return {
            name: text
            for quantity in quantities
            for name, text in self.column(quantity, unit).items()
        }

    def apply(self, change: Change) -> None:
        """Read every vehicle so."""
        self.changes |= change.columns
        self.log = replace(self.log, vehicles=tuple(map(change.convert, self.log.vehicles)))

    def resolve(
        self,
        quantity: Quantity,
        size: float,
        fact: str,
        changes: Sequence[Change],
        *,
        stops: bool = True,
    ) -> None:
        """Use the only change to a unit that nothing names, and note it; else add a doubt."""
        options = [
            f"{each.text}: {self.option(**each.columns)}" if each.columns else each.text
            for each in changes
        ]
        units = [each.is_unit and self.is_assumed(*each.columns) for each in changes]
        if sum(units) == 1:
            used = units.index(True)
            self.apply(changes[used])
            text = f"{fact}, so it is assumed that {options.pop(used)}"
            self.notes.append(", or if ".join([text, *options]))
        else:
            cause = f"{fact}; it fits if {' or if '.join(options)}"
            self.doubt(quantity, size, cause, stops=stops)

    def tried(self) -> Sequence[Observations]:
        """Return the vehicles with which a reading is tried."""
        return self.log.vehicles[:: max(len(self.log.vehicles) // _MAX_TRIED_COUNT, 1)]

    def agreeing(
        self, changes: Iterable[Change], agrees: Callable[[Comparison], bool]
    ) -> list[Change]:
        """Return the changes with which the quantities of vehicles agree."""
        return [change for change in changes if agrees(self.compared(change.convert))]

    def compared(self, convert: Convert = lambda vehicle: vehicle) -> Comparison:
        """Compare the quantities of vehicles, after a change."""
        vehicles = self.tried()
        counts = self.is_assumed("time") and "time" not in self.changes and counts_steps(vehicles)
        least = _FRAMES_PER_LEG_COUNT if counts else 1
        changed = [convert(vehicle) for vehicle in vehicles]
        legs = legs_of(changed, geographic=self.log.geographic, least_steps=least)
        return _compare(legs, len(vehicles))

    def doubt(
        self,
        quantity: Quantity,
        size: float,
        cause: str,
        remedy: str = "",
        *,
        stops: bool = True,
    ) -> None:
        """Add a doubt about the whole log."""
        self.doubts.append(Doubt(quantity, size, cause, remedy, stops=stops))


def counts_steps(vehicles: Sequence[Observations]) -> bool:
    """Return whether all stamps are whole numbers of seconds, as a number of frames is."""
    return all((vehicle.fix_ns % 10**9 == 0).all() for vehicle in vehicles)


def scaled(**factors: float) -> Convert:
    """Return the conversion that multiplies time, x, y (or lat, lon) and speed."""

    def with_factor(stamps: Ints) -> Ints:
        time = factors.get("time", 1.0)
        return stamps if time == 1.0 else np.round(stamps * time).astype(np.int64)

    return lambda vehicle: replace(
        vehicle,
        fix_ns=with_factor(vehicle.fix_ns),
        speed_ns=with_factor(vehicle.speed_ns),
        fix=vehicle.fix * (factors.get("x", 1.0), factors.get("y", 1.0)),
        speed=vehicle.speed * factors.get("speed", 1.0),
    )


def with_fix(change: Callable[[Floats], Floats]) -> Convert:
    """Return the conversion of positions (F, 2)."""
    return lambda vehicle: replace(vehicle, fix=change(vehicle.fix))


def with_heading(change: Callable[[Floats], Floats]) -> Convert:
    """Return the conversion of headings (F,)."""
    return lambda vehicle: replace(vehicle, heading=change(vehicle.heading))


def swapped_fix(fix: Floats) -> Floats:
    """Return positions (F, 2) with swapped columns."""
    return fix[:, ::-1]
