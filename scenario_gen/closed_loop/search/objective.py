# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What counts as a failure of a planner, and how near to one a drive was."""

from dataclasses import dataclass
import math
import re

import numpy as np

from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.closed_loop.search.estimate import Response
from scenario_gen.closed_loop.trials import Outcome
from scenario_gen.method.evaluation import min_time_shift

AT_FAULT, COLLISION, OFF_ROAD, GOAL, TTC, PET = (
    "at_fault",
    "collision",
    "off_road",
    "goal",
    "ttc",
    "pet",
)
NAMES = (AT_FAULT, COLLISION, OFF_ROAD, GOAL)
CONTACT = 0.1  # added to the speed of an impact, so that every contact is a failure
LEAST = 1e-3  # s, margin of a drive in which footprints met at no instant that counts
NO_MARGIN = 100.0  # margin where a figure does not exist and nothing says how near it is


@dataclass(frozen=True)
class Objective:
    """A failure: at_fault, collision, off_road, goal (missed), or ttc or pet below a limit [s]."""

    name: str = AT_FAULT
    limit: float = 0.0

    @classmethod
    def parsed(cls, text: str) -> "Objective":
        """Return the objective of a text: a name, or e.g. `ttc<1.5`.

        Raises:
            InputError: it is none of these.
        """
        bound = re.fullmatch(rf"({TTC}|{PET})\s*<\s*(\d+\.?\d*|\.\d+)", text.strip())
        if bound is not None:
            return cls(bound[1], float(bound[2]))
        if text.strip() not in NAMES:
            known = f"{', '.join(NAMES)}, or e.g. {TTC}<1.5, {PET}<1 (seconds)"
            raise InputError(
                f"objective {text!r} is not known; take {known}{did_you_mean(text, NAMES)}"
            )
        return cls(text.strip())

    def __str__(self) -> str:
        return f"{self.name}<{self.limit:g}" if self.limit else self.name

    def response(self, outcome: Outcome) -> Response:
        """Return how near to failure a drive was; for collisions by how far in time [s] each of the others was."""
        verdict = outcome.verdict
        apart = _apart(outcome)
        hit = verdict.collision
        contact = -math.inf if hit is None else -(CONTACT + hit.speed)
        nearest = min(apart, default=NO_MARGIN)
        if self.name in (AT_FAULT, COLLISION):
            counts = hit is not None and (self.name == COLLISION or verdict.at_fault)
            margin = contact if counts else max(nearest, LEAST)
        elif self.name == OFF_ROAD:
            margin = verdict.road_margin + verdict.off_road_depth
        elif self.name == GOAL:
            margin = (
                verdict.progress - 1.0 - 1e-3
                if math.isnan(verdict.goal)
                else 1.0 / (1.0 + max(verdict.delay, 0.0))
            )
        elif self.name == TTC:
            margin = verdict.min_ttc - self.limit if hit is None else contact
            if margin > 0.0:
                margin += (
                    0.1 * nearest
                )  # many drives have no time to collision: the nearer, the better
        else:
            margin = (
                NO_MARGIN + nearest
                if math.isnan(verdict.min_pet)
                else verdict.min_pet - self.limit
            )
        margin = NO_MARGIN if math.isnan(margin) else float(margin)
        parts = apart if self.name in (AT_FAULT, COLLISION) else ()
        events = ((COLLISION,) if hit is not None else ()) + (
            (AT_FAULT,) if verdict.at_fault else ()
        )
        return Response(margin, parts, _kind(outcome, self.name) if margin <= 0.0 else "", events)


def _apart(outcome: Outcome) -> tuple[float, ...]:
    """Return how far in time [s] each of the others was from a collision with the ego."""
    drive = outcome.drive
    others = (i for i in range(len(drive.motion.vehicles)) if i != drive.ego)
    return tuple(min_time_shift(drive.motion, drive.present, drive.ego, i) for i in others)


def _kind(outcome: Outcome, name: str) -> str:
    """Return which failure it was: who and how."""
    hit = outcome.verdict.collision
    if name in (AT_FAULT, COLLISION, TTC) and hit is not None:
        return f"the ego and {hit.vehicle} meet: {hit.reason.value.replace('_', ' ')}"
    if name == OFF_ROAD:
        return "the ego leaves the road"
    if name == GOAL:
        why = (
            " after a collision"
            if hit is not None
            else ": it stands"
            if outcome.verdict.fault == "standing"
            else ""
        )
        return f"the ego does not come to its goal{why}"
    others = [i for i in range(len(outcome.drive.motion.vehicles)) if i != outcome.drive.ego]
    nearest = others[int(np.argmin(_apart(outcome)))] if others else 0
    return f"{name} too short with {outcome.drive.motion.vehicles[nearest].id}"
