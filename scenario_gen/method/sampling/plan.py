# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What scenarios are drawn from, and whom the sampler calls while it draws."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from scenario_gen.situation import Situation, Wait
from scenario_gen.types import (
    BoundaryStates,
    EgoSlot,
    Encounter,
    Road,
    Route,
    Scenario,
    Segmentation,
    TypeLimits,
)

Progress = Callable[
    [int, int, int], None
]  # of scenarios so far, scenarios wanted, candidates so far
Cancelled = Callable[[], bool]
OnValid = Callable[
    [Scenario, BoundaryStates, EgoSlot | None], None
]  # a valid one, the states requested, what the ego is given


@dataclass(frozen=True, eq=False)
class Plan:
    """A template planned on a road.

    Attributes:
        situation: of the template.
        segmentation: its changepoints.
        road: the target road, for the room it leaves.
        routes: one per vehicle, with an anchor at start, changepoints and end.
        requested: start and end states; their speeds are met exactly.
        waits: when a vehicle stands, on the template's clock.
        limits: of each type's motion, within which speeds are planned.
    """

    situation: Situation
    segmentation: Segmentation
    road: Road
    routes: Sequence[Route]
    requested: BoundaryStates
    waits: Sequence[Wait]
    limits: TypeLimits = TypeLimits()

    @property
    def encounter(self) -> Encounter:
        """The template."""
        return self.situation.encounter


@dataclass(frozen=True)
class Callbacks:
    """Functions that the sampler calls while it draws.

    Attributes:
        progress: called with (valid so far, count, candidates so far).
        cancelled: called before each candidate; if True, the set so far is returned.
        accepts: asked of each valid scenario; one that it does not accept is left out of the set.
        found: called with each valid scenario as it is drawn, in the set's order; of a chosen set, when it is chosen.
    """

    progress: Progress = lambda *_: None
    cancelled: Cancelled = lambda: False
    accepts: Callable[[Scenario], bool] = lambda _: True
    found: OnValid = lambda *_: None
