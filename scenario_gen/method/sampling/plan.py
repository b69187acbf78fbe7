# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The input of the sampler: a template planned on a road, and the callbacks of its caller."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.variation import relaxed_states
from scenario_gen.method.validity import Limits
from scenario_gen.situation import (
    Abreast,
    abreast_in_lane,
    MAX_CLEARANCE_CHANGE_M,
    Situation,
    Wait,
)
from scenario_gen.types import (
    BoundaryStates,
    EgoSlot,
    Encounter,
    Fit,
    Planned,
    Request,
    Road,
    Route,
    Scenario,
    Segmentation,
)

Progress = Callable[[int, int, int], None]
"""Takes the scenarios so far, the scenarios wanted, and the candidates so far."""
Cancelled = Callable[[], bool]
OnValid = Callable[[Scenario, BoundaryStates, EgoSlot | None], None]
"""Takes a valid scenario, the requested states, and the slot of the ego."""


@dataclass(frozen=True, eq=False)
class Plan:
    """A template planned on a road.

    Attributes:
        situation: the template's.
        segmentation: its changepoints.
        road: the target road, for the room it leaves.
        routes: one per vehicle, with an anchor at start, changepoints and end.
        requested: start and end states; their speeds are met exactly.
        waits: when a vehicle stands, on the template's clock.
        limits: of the checker; speeds are planned within those of motion.
        abreast: who shares a lane side by side, at the offset that scenarios keep.
    """

    situation: Situation
    segmentation: Segmentation
    road: Road
    routes: Sequence[Route]
    requested: BoundaryStates
    waits: Sequence[Wait]
    limits: Limits = Limits()
    abreast: Sequence[Abreast] = ()

    @classmethod
    def of(
        cls,
        planned: Planned,
        config: SamplingConfig,
        limits: Limits,
        request: Request,
        waits: tuple[Wait, ...] | None = None,
        situation: Situation | None = None,
    ) -> "Plan":
        """Return the plan of a request, whose states are relaxed where drivers differ.

        Args:
            planned: the template on its road.
            config: the sampler's parameters.
            limits: of the checker.
            request: what is requested.
            waits: that are kept; the template's if None.
            situation: the template's, if it is known.
        """
        situation = situation or Situation.of(planned.encounter)
        fit, segmentation = planned.fit, planned.segmentation
        states = relaxed_states(fit.requested, situation, config, request)
        if waits is None:
            waits = situation.waits_to_keep(segmentation)
        abreast = [_placed_abreast(each, fit) for each in abreast_in_lane(situation.tracks)]
        road, routes = planned.road, planned.routes
        return cls(situation, segmentation, road, routes, states, waits, limits, abreast)

    @property
    def encounter(self) -> Encounter:
        """The template."""
        return self.situation.encounter


def _placed_abreast(abreast: Abreast, fit: Fit) -> Abreast:
    """Return a pair side by side, at its offset on the road where the recorded one is lost.

    Such a loss is reported by the fit, with both clearances.
    """
    first, second = (fit.fitted[n].path for n in abreast.pair)
    offset = abreast.offset_on(first, second)
    change = abs(offset) - abs(abreast.offset)
    pair = {fit.vehicles[n].id for n in abreast.pair}
    is_lost = any(pair == set(loss.vehicles) for loss in fit.losses)
    if not (is_lost and abs(change) > MAX_CLEARANCE_CHANGE_M):  # true for NaN
        return abreast
    return abreast._replace(offset=offset, clearance=abreast.clearance + change)


@dataclass(frozen=True)
class Callbacks:
    """Functions that the sampler calls while it draws.

    Attributes:
        progress: takes (valid so far, count, candidates so far).
        cancelled: called before each candidate; if True, the set so far is returned.
        accepts: called with each valid scenario; a scenario that it refuses is left out.
        on_valid: called with each scenario of the set as it is drawn, in the set's order.
    """

    progress: Progress = lambda *_: None
    cancelled: Cancelled = lambda: False
    accepts: Callable[[Scenario], bool] = lambda _: True
    on_valid: OnValid = lambda *_: None
