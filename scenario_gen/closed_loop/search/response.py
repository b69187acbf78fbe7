# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The problem of a search, and the result of one drive."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from scenario_gen.numerics import Floats


@dataclass(frozen=True)
class Response:
    """The result of one drive.

    Attributes:
        margin: distance to failure; 0 or less if the drive failed.
        parts: figures whose minimum is the margin of a drive that did not fail; the same number
            for every drive, or none.
        kind: of the failure, "" for none.
        events: names of events during the drive, whose rates are estimated, too.
    """

    margin: float
    parts: tuple[float, ...] = ()
    kind: str = ""
    events: tuple[str, ...] = ()

    @property
    def failed(self) -> bool:
        """Whether the planner failed."""
        return self.margin <= 0.0


Candidate = TypeVar("Candidate")


class Problem(Protocol[Candidate]):
    """A planner among the candidates of a search."""

    @property
    def size(self) -> int:
        """Number of standard normal numbers of a candidate."""

    def candidates(self, z: Floats) -> list[Candidate | None]:
        """Return the certified scenarios of numbers (S, size), None for rejected ones."""

    def features(self, candidate: Candidate) -> tuple[float, ...]:
        """Return figures of a scenario that may influence its drive, the same number for each."""

    def drive(self, candidates: Sequence[Candidate]) -> list[Response]:
        """Drive the planner in each candidate."""
