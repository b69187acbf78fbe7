# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the readers of map formats return: lanes, faults and notes; and bounds of maps."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
import math
import re

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.numerics import Floats
from scenario_gen.roads.vector.signs import DraftRule
from scenario_gen.types import Note, NoteKind, Obstacle

SECTION_LENGTH_M = 1.0
"""The largest distance between two cross-sections of a lane."""
MAX_SECTIONS_COUNT = 2_000_000
"""Of a whole map."""
MAX_LANES_COUNT = 30_000
"""Of a whole map; a city with some 1000 km of streets has fewer."""
MAX_LINKS_COUNT = 100
"""From one lane to its successors, or to its neighbours."""

MPS_PER_UNIT = {
    "km/h": 1.0 / 3.6,
    "kmh": 1.0 / 3.6,
    "kph": 1.0 / 3.6,
    "mph": 0.44704,
    "m/s": 1.0,
    "mps": 1.0,
}
"""By the name of a unit of speed."""


class TooLargeError(InputError):
    """A map or a part of it exceeds a bound."""


@dataclass(frozen=True)
class Fault:
    """An element that was left out: its kind, its name, and the reason with its place."""

    kind: str
    name: str
    reason: str


@dataclass
class Faults:
    """The elements of a map that cannot be used and are left out."""

    faults: list[Fault] = field(default_factory=list)

    @property
    def first_reason(self) -> str:
        """The reason of the first fault, "" without one; a faulty link costs no lane."""
        return next((fault.reason for fault in self.faults if fault.kind != "link"), "")

    def add(self, kind: str, name: str, reason: str) -> None:
        """Add a fault."""
        self.faults.append(Fault(kind, name, reason))

    @contextmanager
    def leaving_out(self, kind: str, name: str) -> Iterator[None]:
        """Leave out an element that the body refuses.

        Raises:
            TooLargeError: the body exceeds a bound.
        """
        try:
            yield
        except TooLargeError:
            raise
        except InputError as error:
            self.add(kind, name, str(error))

    def notes(self) -> tuple[Note, ...]:
        """Return a note on each kind of element that was left out."""
        return tuple(map(self._note, dict.fromkeys(fault.kind for fault in self.faults)))

    def _note(self, kind: str) -> Note:
        faults = [fault for fault in self.faults if fault.kind == kind]
        names = [fault.name for fault in faults[:5]]
        listed = ", ".join(names if len(faults) == len(names) else [*names, "…"])
        return Note.of(
            NoteKind.FAULTY,
            count=len(faults),
            elements=f"{kind}s" if len(faults) > 1 else kind,
            names=listed,
            reason=faults[0].reason,
        )


@dataclass(frozen=True, eq=False)
class Draft:
    """A lane as a reader returns it, with the names of other lanes.

    Attributes:
        id: the lane's name.
        left: (A, 2) [m] the left border in driving direction, or (A, 3) with its height, NaN where
            it is not known.
        right: (B, 2) or (B, 3) [m] the right border.
        successors: names of lanes.
        neighbours: names of lanes to which traffic may change.
        speed_limit: [m/s] or NaN.
        junction: its junction or "".
        place: file and line, for messages.
        paired: whether the points of left and right are cross-sections already.
        users, crossing: as in `Lane`.
    """

    id: str
    left: Floats
    right: Floats
    successors: tuple[str, ...] = ()
    neighbours: tuple[str, ...] = ()
    speed_limit: float = math.nan
    junction: str = ""
    place: str = ""
    paired: bool = False
    users: frozenset[str] = frozenset()
    crossing: bool = False

    def __post_init__(self) -> None:
        for names, kind in ((self.successors, "successors"), (self.neighbours, "neighbours")):
            if len(names) > MAX_LINKS_COUNT:
                raise TooLargeError(
                    f"{self.place}: lane {self.id} has {len(names)} {kind}; at most "
                    f"{MAX_LINKS_COUNT} are read"
                )


@dataclass(frozen=True)
class MapLanes:
    """The contents of a map file.

    Attributes:
        drafts: its lanes.
        notes: on how it was read.
        unsupported: how many lanes were left out because no type of road user may use them.
        faults: other elements that were left out.
        rules: signs, lights and rights of way.
        other_signs: how many signs and lights have another meaning and are not read.
        origin: as in `LaneNetwork`.
        obstacles: as in `LaneNetwork`.
    """

    drafts: Sequence[Draft]
    notes: tuple[Note, ...]
    unsupported: int
    faults: Faults
    rules: Sequence[DraftRule]
    other_signs: int
    origin: tuple[float, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()


def by_id(elements: Iterable[Element], faults: Faults) -> dict[str, Element]:
    """Return elements by their attribute `id`.

    Those without an id, and all but the first with the same id, become faults.
    """
    named: dict[str, Element] = {}
    for element in elements:
        name = element.get("id")
        if name is None:
            faults.add(element.tag, "?", f"{element.place} has no attribute id")
        elif name in named:
            first = f"first on line {named[name].sourceline}"
            faults.add(element.tag, name, f"{element.place}: second {element.tag} {name}, {first}")
        else:
            named[name] = element
    return named


def refuse_too_many_lanes(count: int, place: str) -> None:
    """Refuse a map, or a part of it, before its lanes are drawn.

    Raises:
        TooLargeError: it has more than `MAX_LANES_COUNT`.
    """
    if count > MAX_LANES_COUNT:
        raise TooLargeError(f"{place}: more than {MAX_LANES_COUNT} lanes; cut the map")


def refuse_too_long(sections: int, place: str) -> None:
    """Refuse a map, or a part of it, before its cross-sections are computed.

    Raises:
        TooLargeError: it has more than `MAX_SECTIONS_COUNT`.
    """
    if sections > MAX_SECTIONS_COUNT:
        km = MAX_SECTIONS_COUNT * SECTION_LENGTH_M / 1000.0
        raise TooLargeError(
            f"{place}: lanes with more than {MAX_SECTIONS_COUNT} points, about {km:g} km; "
            "cut the map"
        )


def speed_of(text: str, unit: str) -> float:
    """Return the speed [m/s] of a text such as "50", "50 km/h" or "30mph"; NaN if it is none.

    Args:
        text: a number with or without a unit.
        unit: of a number without one: "km/h", "mph" or "m/s".
    """
    match = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([a-zA-Z/]*)\s*", text[:40])
    if match is None:
        return math.nan
    return float(match[1]) * MPS_PER_UNIT.get(match[2].lower() or unit, math.nan)
