# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Criticality figures of a scenario, and the range of one that a request asks for."""

from collections.abc import Iterable
from dataclasses import dataclass
import math
import re

from scenario_gen.base.errors import InputError
from scenario_gen.types.encounter import Encounter, vehicle_index
from scenario_gen.types.notes import Note, NoteKind

UNITS = {
    "pet": "s",
    "ttc": "s",
    "gap": "m",
    "arrival_gap": "s",
    "closing_speed": "m/s",
    "blind_margin": "s",
}
"""Figures that a target can be set on, with units; see `method.evaluation.measures`."""
Pair = tuple[int, ...]  # of vehicle indices; one: with whom it is the most critical
_FORM = "NAME=LOW..HIGH, NAME < HIGH or NAME > LOW, with NAME[a] or NAME[a,b] for some vehicles"
_TARGET = re.compile(
    r"([^=<>\[]*)(?:\[([^=<>]*)\]\s*)?(?:=(.*)\.\.(.*)|<=?(.*)|>=?(.*))", re.DOTALL
)
_EXAMPLE = "pet=0.5..1.5; ttc[1,2] < 2"


@dataclass(frozen=True)
class Target:
    """A range of a figure, bounds included.

    Attributes:
        name: of the figure, one of UNITS.
        low, high: the bounds; one of them may be infinite.
        vehicles: ids of the pair it is of; of one vehicle: its most critical pair; none: the most
            critical of all pairs.
    """

    name: str
    low: float
    high: float
    vehicles: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """The figure's name, with its pair if there is one."""
        return f"{self.name}[{','.join(self.vehicles)}]" if self.vehicles else self.name

    def __str__(self) -> str:
        low, high = (
            "" if math.isinf(value) else f"{value:.10g}" for value in (self.low, self.high)
        )
        return f"{self.label}={low}..{high}"

    def holds(self, value: float) -> bool:
        """Whether a value is in the range; NaN is not."""
        return self.low <= value <= self.high

    def pair(self, encounter: Encounter) -> Pair | None:
        """Return the indices of its vehicles, None for all pairs.

        Raises:
            InputError: a vehicle is not the encounter's, or both are the same.
        """
        if not self.vehicles:
            return None
        pair = tuple(vehicle_index(encounter, name, "target") for name in self.vehicles)
        if len(set(pair)) < len(pair):
            raise InputError(f"target: {self.label} names one vehicle twice")
        return pair


@dataclass(frozen=True)
class Reached:
    """What directed sampling came to.

    Attributes:
        targets: what was requested.
        stages: of the adaptation; candidates: of all of them.
        share: estimated share of natural candidates that are valid and in the range, with its 95 %
            interval low, high.
        directed: whether a proposal was used; else candidates are as without a target, and all
            weights are 1.
    """

    targets: tuple[Target, ...]
    stages: int
    candidates: int
    share: float
    low: float
    high: float
    directed: bool

    def figures(self) -> dict[str, str]:
        """Return all of it as texts, by name."""
        return {
            "share": f"{self.share:.6g}",
            "share_low": f"{self.low:.6g}",
            "share_high": f"{self.high:.6g}",
            "stages": str(self.stages),
            "stage_candidates": str(self.candidates),
            "directed": str(self.directed).lower(),
        }

    def note(self) -> Note:
        """Return a note with the share and how the scenarios were drawn."""
        if self.directed:
            sampling = (
                f"drawn from a proposal (stages: {self.stages}, candidates: {self.candidates}), "
                "with weights"
            )
        else:
            sampling = "drawn as without a target, all weights are 1"
        return Note.of(
            NoteKind.TARGET_REACHED,
            target=join_pieces(self.targets),
            share=100.0 * self.share,
            low=100.0 * self.low,
            high=100.0 * self.high,
            sampling=sampling,
        )


def read_targets(text: str) -> tuple[Target, ...]:
    """Return the targets in a text such as `pet=0.5..1.5; ttc[1,2] < 2`.

    Raises:
        InputError: it is not of that form, a figure is unknown or comes twice, or a range is
            empty.
    """
    targets: list[Target] = []
    for piece in split_pieces(text):
        target = _read_target(piece)
        if target.label in {other.label for other in targets}:
            raise InputError(f"target: {target.label} comes twice")
        targets.append(target)
    return tuple(targets)


def _read_target(piece: str) -> Target:
    """Return the target in a text such as `ttc[1,2]=1..2` or `ttc < 2`."""
    match = _TARGET.fullmatch(piece)
    name, ids, *bounds = match.groups() if match else ("", "", "", "", "", "")
    name = name.strip()
    vehicles = () if ids is None else tuple(word.strip() for word in ids.split(","))
    if len(vehicles) > 2 or not all(vehicles):
        raise InputError(f"target: {piece!r} is not of the form `{_FORM}`, e.g. `{_EXAMPLE}`")
    if name not in UNITS:
        raise InputError(f"target: {name!r} is none of {', '.join(UNITS)}")
    low, high, below, above = ((word or "").strip() for word in bounds)
    return Target(name, *_range(piece, low or above, high or below), vehicles)


def _range(piece: str, low: str, high: str) -> tuple[float, float]:
    """Return the bounds of a target, infinite where there is none."""
    try:
        bounds = float(low or -math.inf), float(high or math.inf)
    except ValueError:
        raise InputError(
            f"target: {piece!r}: the bounds must be numbers, as in `{_EXAMPLE}`"
        ) from None
    if not bounds[0] < bounds[1] or all(map(math.isinf, bounds)):
        raise InputError(
            f"target: {piece!r}: the lower bound must be below the upper one, "
            "and one of them finite"
        )
    return bounds


def split_pieces(text: str) -> list[str]:
    """Return the pieces of a text that are not empty."""
    return [piece for part in text.split(";") if (piece := part.strip())]


def join_pieces(pieces: Iterable[object]) -> str:
    """Return the text of some pieces."""
    return "; ".join(map(str, pieces))


def read_numbers(text: str) -> tuple[float, ...]:
    """Return the numbers of a piece, separated by blanks or commas; () if one is not finite."""
    try:
        numbers = tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        return ()
    return numbers if all(map(math.isfinite, numbers)) else ()
