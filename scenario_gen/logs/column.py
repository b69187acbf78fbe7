# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A column of a table: its name and its unit."""

from dataclasses import dataclass
import re

_BRACKETED_UNIT = re.compile(r"(.+?)\s*[\[(]\s*([^\])]+?)\s*[\])]")  # x [m]
_UNIT_SUFFIXES = {
    "m/s": "mps",
    "km/h": "kmh",
    "°": "deg",
    "degrees": "deg",
    "seconds": "s",
    "metres": "m",
    "meters": "m",
    "feet": "ft",
}
_FRAME_NAMES = ("frame", "frame_id", "frame_number", "frame_no", "frame_idx")


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        name: of the column.
        factor: to our unit; negative if the axis is flipped.
        clockwise: a heading clockwise from north.
        minutes: degrees and minutes, as receivers of NMEA write them.
        types: (number, type) of a column of kinds that are numbers; a car if no type is named.
        unit: as it is written in the parameter `columns` or in the name; "" if neither names one.
    """

    name: str
    factor: float = 1.0
    clockwise: bool = False
    minutes: bool = False
    types: tuple[tuple[float, str], ...] = ()
    unit: str = ""

    @property
    def counts_frames(self) -> bool:
        """Whether a time is a number of frames by its name, at an unknown rate."""
        return not self.unit and normalized(self.name) in _FRAME_NAMES

    @property
    def is_gentime(self) -> bool:
        """Whether a time is that of SPMD: microseconds since 2004."""
        return normalized(self.name) == "gentime"

    def option(self, unit: str = "", *, flipped: bool = False) -> str:
        """Return the column as in the parameter `columns`, in a unit or in its own one."""
        if not unit and not normalized(self.name).endswith(f"_{self.unit}"):
            unit = self.unit
        sign = "-" if flipped != (self.factor < 0.0) else ""
        return f"{sign}{self.name}:{unit}" if unit else f"{sign}{self.name}"


def normalized(name: str) -> str:
    """Return a column's name in lower case, its unit as a suffix: `Speed [m/s]` is `speed_mps`."""
    name = name.strip().lower()
    match = _BRACKETED_UNIT.fullmatch(name)
    return f"{match[1]}_{_UNIT_SUFFIXES.get(match[2], match[2])}" if match else name
