# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A log while its units, axes and conventions are determined."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from scenario_gen.logs.column import Column
from scenario_gen.logs.columns import with_columns
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.doubts import Doubt, Quantity
from scenario_gen.logs.legs import Legs, legs_of
from scenario_gen.logs.raw import Observations, RawLog

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
