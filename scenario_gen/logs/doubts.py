# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Doubts about a reading: contradictions between the result and the raw data."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from scenario_gen.base.errors import InputError

ALLOWED = "doubt"
"""Value of the parameter `allow` with which a log in doubt is read."""


class Quantity(Enum):
    """The quantity that is in doubt; the value is for people."""

    POSITION = "position"
    SPEED = "speed"
    HEADING = "heading"
    CLOCK = "clock"
    FRAME = "frame"
    ROWS = "rows"
    VEHICLE = "vehicle"


@dataclass(frozen=True)
class Doubt:
    """A contradiction between the result of reading and the raw data.

    Attributes:
        vehicle: its id; "" if the doubt concerns the whole log.
        start: seconds since the log's first stamp.
        end: seconds since the log's first stamp; equal to `start` for the whole log.
        quantity: what is in doubt.
        size: of the contradiction, in `unit`.
        unit: of `size`, e.g. "m"; "" for a ratio.
        cause: the contradiction, and its likely cause.
        remedy: the option that would read the log right; "" if unknown.
        stops: whether it stops the reading, unless the parameter `allow` is `doubt`.
    """

    vehicle: str
    start: float
    end: float
    quantity: Quantity
    size: float
    unit: str
    cause: str
    remedy: str = ""
    stops: bool = True

    def __str__(self) -> str:
        subject = f"vehicle {self.vehicle}, " if self.vehicle else ""
        interval = f"{self.start:.1f} to {self.end:.1f} s: " if self.end > self.start else ""
        remedy = f"; {self.remedy}" if self.remedy else ""
        return f"{subject}{interval}{self.cause}{remedy}"


class DoubtError(InputError):
    """The result of reading contradicts the raw data, and the parameter `allow` is not set."""


def check_doubts(place: str, doubts: Sequence[Doubt], allow: str) -> None:
    """Check that no doubt stops the reading.

    Raises:
        DoubtError: one does; the message names it, its remedy, and the option that continues.
    """
    stopping = [doubt for doubt in doubts if doubt.stops]
    if not stopping or allow == ALLOWED:
        return
    more = f" (and {len(stopping) - 1} more doubts)" if len(stopping) > 1 else ""
    raise DoubtError(
        f"{place}: {stopping[0]}{more}; --set log.allow={ALLOWED} (generate, mine: --allow "
        f"{ALLOWED}) reads it as it is"
    )
