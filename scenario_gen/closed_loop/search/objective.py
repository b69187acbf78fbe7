# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The definition of a failure of a planner, and the distance of a drive to it."""

from dataclasses import dataclass, replace
import math
import re

import numpy as np

from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.criteria import CRITERIA, find_criteria
from scenario_gen.closed_loop.search.response import Response
from scenario_gen.closed_loop.trials import Outcome
from scenario_gen.closed_loop.verdict import DriveVerdict
from scenario_gen.method.evaluation import min_time_shift

AT_FAULT = "at_fault"
COLLISION = "collision"
OFF_ROAD = "off_road"
GOAL = "goal"
TTC = "ttc"
PET = "pet"
IMPOSED = "imposed_braking"
NAMES = (AT_FAULT, COLLISION, OFF_ROAD, GOAL)
CONTACT_SPEED_MPS = 0.1  # added to the impact speed, so that every contact has a negative margin
MIN_MARGIN_S = 1e-3  # of a drive without a contact that counts
UNKNOWN_MARGIN_S = 100.0  # of a drive for which the figure does not exist


@dataclass(frozen=True)
class Objective:
    """A failure: at_fault, collision, off_road, goal (missed), or a figure beyond a limit.

    The figures are ttc and pet, below it [s], and the imposed_braking, above it [m/s²].
    With `criterion`, its text, a failure is a drive that misses the criterion called `name`.
    """

    name: str = AT_FAULT
    limit: float = 0.0
    criterion: str = ""

    @classmethod
    def parsed(cls, text: str) -> "Objective":
        """Return the objective of a text: a name, or e.g. `ttc<1.5`, or a criterion.

        Raises:
            InputError: it is none of these.
        """
        bound = re.fullmatch(
            rf"({TTC}(?=\s*<)|{PET}(?=\s*<)|{IMPOSED}(?=\s*>))\s*[<>]\s*(\d+\.?\d*|\.\d+)",
            text.strip(),
        )
        if bound is not None:
            return cls(bound[1], float(bound[2]))
        if text.strip() in NAMES:
            return cls(text.strip())
        name = re.split("[<>]", text)[0].strip()
        if ":" not in name and name not in CRITERIA:
            figures = f"{TTC}<1.5, {PET}<1 (seconds) or {IMPOSED}>3 (m/s²)"
            known = f"{', '.join(NAMES)}, or e.g. {figures}, or a criterion"
            near = did_you_mean(text, (*NAMES, *CRITERIA.names()))
            raise InputError(f"objective {text!r} is not known; take {known}{near}")
        text = text.replace(",", " ")
        return cls(find_criteria(text)[0].name, criterion=text)

    def configured(self, config: ClosedLoopConfig) -> ClosedLoopConfig:
        """Return parameters of drives with the criterion of the objective among the criteria.

        Raises:
            InputError: they have the criterion with another threshold.
        """
        if not self.criterion:
            return config
        (wanted,) = find_criteria(self.criterion)
        listed = {each.name: each.threshold for each in find_criteria(config.criteria)}
        if listed.get(wanted.name) == wanted.threshold:
            return config
        texts = [text for text in (config.criteria, self.criterion) if text]
        return replace(config, criteria=",".join(texts))

    def __str__(self) -> str:
        if self.criterion:
            return self.criterion
        side = ">" if self.name == IMPOSED else "<"
        return f"{self.name}{side}{self.limit:g}" if self.limit else self.name

    def response(self, outcome: Outcome) -> Response:
        """Return the distance of a drive to failure.

        The parts of an objective of collisions are the time shifts [s] that would meet the others.
        """
        verdict = outcome.verdict
        events = []
        if verdict.collision is not None:
            events.append(COLLISION)
        if verdict.at_fault:
            events.append(AT_FAULT)
        if self.criterion:
            return self._criterion_response(verdict, events)
        shifts = _time_shifts(outcome)
        margin = self._margin(outcome, min(shifts, default=UNKNOWN_MARGIN_S))
        if math.isnan(margin):
            margin = UNKNOWN_MARGIN_S
        parts = shifts if self.name in (AT_FAULT, COLLISION) else ()
        kind = _kind(outcome, self.name) if margin <= 0.0 else ""
        return Response(float(margin), parts, kind, tuple(events))

    def _criterion_response(self, verdict: DriveVerdict, events: list[str]) -> Response:
        """Return the response of a drive by the objective's criterion."""
        (result,) = (each for each in verdict.criteria if each.name == self.name)
        limit = UNKNOWN_MARGIN_S
        margin = float(np.nan_to_num(result.margin, nan=limit, posinf=limit, neginf=-limit))
        if result.missed:
            return Response(margin, (), f"{self.name} missed", tuple(events))
        return Response(max(margin, 1e-9), events=tuple(events))  # equality meets a criterion

    def _margin(self, outcome: Outcome, nearest: float) -> float:
        """Return the margin of a drive whose least time shift to a collision is `nearest` [s].

        It is NaN if the verdict has no such figure.
        """
        verdict = outcome.verdict
        if self.name == OFF_ROAD:
            return verdict.road_margin + verdict.off_road_depth
        if self.name == GOAL:
            return _goal_margin(verdict)
        if self.name == PET:
            if math.isnan(verdict.min_pet):
                return UNKNOWN_MARGIN_S + nearest
            return verdict.min_pet - self.limit
        hit = verdict.collision
        counts = verdict.at_fault or self.name not in (AT_FAULT, IMPOSED)
        if hit is not None and counts:
            return -(CONTACT_SPEED_MPS + hit.speed)
        if self.name == TTC:
            margin = verdict.min_ttc - self.limit
        elif self.name == IMPOSED:
            margin = self.limit - verdict.imposed_braking
        else:
            return max(nearest, MIN_MARGIN_S)
        # Many drives have the same figure, or none: then the nearer one is better.
        return margin + 0.1 * nearest if margin > 0.0 else margin


def _goal_margin(verdict: DriveVerdict) -> float:
    """Return the margin of the goal: negative if it is missed, smaller with a larger delay."""
    if math.isnan(verdict.goal):
        return verdict.progress - 1.0 - 1e-3
    return 1.0 / (1.0 + max(verdict.delay, 0.0))


def _others(outcome: Outcome) -> list[int]:
    """Return the indices of the vehicles except the ego."""
    drive = outcome.drive
    return [i for i in range(len(drive.motion.vehicles)) if i != drive.ego]


def _time_shifts(outcome: Outcome) -> tuple[float, ...]:
    """Return the least time shift [s] with which each other vehicle would meet the ego."""
    drive = outcome.drive
    return tuple(
        min_time_shift(drive.motion, drive.present, drive.ego, i) for i in _others(outcome)
    )


def _kind(outcome: Outcome, name: str) -> str:
    """Return the kind of a failure: its way and the other vehicle."""
    hit = outcome.verdict.collision
    if name in (AT_FAULT, COLLISION, TTC) and hit is not None:
        return f"the ego and {hit.vehicle} meet: {hit.reason.value.replace('_', ' ')}"
    if name == OFF_ROAD:
        return "the ego leaves the road"
    if name == GOAL:
        reason = ""
        if hit is not None:
            reason = " after a collision"
        elif outcome.verdict.fault == "standing":
            reason = ": it stands"
        return f"the ego does not come to its goal{reason}"
    if name == IMPOSED:
        return "another vehicle brakes in its turn"
    others = _others(outcome)
    nearest = others[int(np.argmin(_time_shifts(outcome)))] if others else 0
    return f"{name} too short with {outcome.drive.motion.vehicles[nearest].id}"
