# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Mutation score of scenarios: how many single faults of a planner they catch.

A mutant is the planner under test with one fault in what it sees or commands. Scenarios kill a
mutant if it fails in one of them that the planner itself passes.

Source: mutation analysis, DeMillo, Lipton & Sayward 1978.
"""

from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from scenario_gen.closed_loop.bars import FIGURES
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.simulation import Observation, Task
from scenario_gen.closed_loop.trials import find_planner, MakePlanner, Outcome, trial_runner
from scenario_gen.numerics import ahead_and_left, Bools, Floats

SAME_DIRECTION_RATIO = 0.7  # least cosine of the angle between two headings of one direction
KMH_PER_MPS = 3.6


@dataclass(frozen=True, eq=False)
class View:
    """The M others as the ego sees them.

    Attributes:
        seen: the observation.
        ahead: (M,) distance along the heading of the ego [m].
        left: (M,) distance to its left [m].
        direction: (M,) cosine of the angle between the headings.
    """

    seen: Observation
    ahead: Floats
    left: Floats
    direction: Floats

    @classmethod
    def of(cls, seen: Observation) -> "View":
        """Return the view of an observation."""
        ahead, left = ahead_and_left(seen.others[:, :2] - np.array(seen.ego[:2]), seen.ego.yaw)
        return cls(seen, ahead, left, np.cos(seen.others[:, 2] - seen.ego.yaw))

    @property
    def distance(self) -> Floats:
        """(M,) distance of the centres [m]."""
        return np.hypot(self.ahead, self.left)

    @property
    def nearest(self) -> Bools:
        """(M,) whether each is the nearest one."""
        return np.asarray(self.distance == self.distance.min(initial=np.inf))

    def is_type(self, name: str) -> Bools:
        """Return (M,) whether each is of a type."""
        return np.array([kind == name for kind in self.seen.types], dtype=np.bool_)

    def along(self, distance: float) -> Floats:
        """Return the vector (2,) [m] of a distance along the heading of the ego."""
        yaw = self.seen.ego.yaw
        return distance * np.array((np.cos(yaw), np.sin(yaw)))


IGNORES: Mapping[str, Callable[[View], Bools]] = {
    "ignores all others": lambda view: view.distance >= 0.0,
    "ignores vehicles on its left": lambda view: view.left > 1.0,
    "ignores vehicles on its right": lambda view: view.left < -1.0,
    "ignores oncoming vehicles": lambda view: view.direction < -SAME_DIRECTION_RATIO,
    "ignores crossing vehicles": lambda view: np.abs(view.direction) < SAME_DIRECTION_RATIO,
    "ignores vehicles in its direction": lambda view: view.direction > SAME_DIRECTION_RATIO,
    "ignores bicycles": lambda view: view.is_type("bicycle"),
    "ignores pedestrians": lambda view: view.is_type("pedestrian"),
    "ignores the nearest vehicle": lambda view: view.nearest,
    "ignores all but the nearest vehicle": lambda view: ~view.nearest,
    "ignores vehicles that stand": lambda view: view.seen.others[:, 3] < 0.5,
    "sees 15 m far": lambda view: view.distance > 15.0,
    "sees 45° to each side": lambda view: np.abs(view.left) > view.ahead,
}
"""Which others (M,) a mutant does not see."""

Distortion = Callable[[View], tuple[Floats, Floats]]  # others (M, 4) and sizes (M, 2)


def _scaled(view: View, speed: float = 1.0, size: float = 1.0) -> tuple[Floats, Floats]:
    return view.seen.others * (1.0, 1.0, 1.0, speed), view.seen.sizes * size


def _shifted(
    view: View, ahead: float = 0.0, y: float = 0.0, yaw: float = 0.0
) -> tuple[Floats, Floats]:
    others = view.seen.others.copy()
    others[:, :2] += view.along(ahead)
    others[:, 1] += y
    others[:, 2] += yaw
    return others, view.seen.sizes


DISTORTS: Mapping[str, Distortion] = {
    "reads km/h as m/s": partial(_scaled, speed=KMH_PER_MPS),
    "reads m/s as km/h": partial(_scaled, speed=1.0 / KMH_PER_MPS),
    "takes all others for stationary": partial(_scaled, speed=0.0),
    "takes all others for points": partial(_scaled, size=0.01),
    "places others 0.7 m to the north": partial(_shifted, y=0.7),
    "places others 3 m too far ahead": partial(_shifted, ahead=3.0),
    "confuses front and rear": partial(_shifted, yaw=np.pi),
}
"""How a mutant distorts the others that it sees."""

COMMANDS: Mapping[str, Callable[[Command], Command]] = {
    "brakes by 2 m/s² at most": lambda asked: asked._replace(acceleration=max(asked[0], -2.0)),
    "brakes only by 3 m/s² or more": lambda asked: (
        asked._replace(acceleration=0.0) if -3.0 < asked[0] < 0.0 else asked
    ),
    "never brakes": lambda asked: asked._replace(acceleration=max(asked[0], 0.0)),
    "accelerates by 1 m/s² too much": lambda asked: asked._replace(acceleration=asked[0] + 1.0),
    "steers 30 % too little": lambda asked: asked._replace(curvature=0.7 * asked[1]),
}
"""How a mutant distorts its commands."""

DELAYS_S = {
    "sees others 0.5 s late": (0.5, 0.0),
    "sees others 1 s late": (1.0, 0.0),
    "acts 0.3 s late": (0.0, 0.3),
}
"""Delays of what a mutant sees of the others, and of its commands."""

GOES_ON_RED = "ignores traffic lights"
MUTANTS = (*IGNORES, *DISTORTS, *COMMANDS, *DELAYS_S, GOES_ON_RED)


class Mutant:
    """A planner with one fault."""

    def __init__(self, planner: MakePlanner | str, fault: str) -> None:
        """Make a planner, or one of that name, with a fault from MUTANTS."""
        self._planner = (find_planner(planner) if isinstance(planner, str) else planner)()
        self._fault = fault

    def reset(self, task: Task) -> None:
        """Begin a new drive."""
        sight, action = DELAYS_S.get(self._fault, (0.0, 0.0))
        self._seen: deque[Observation] = deque(maxlen=1 + round(sight / task.step))
        self._asked: deque[Any] = deque(maxlen=1 + round(action / task.step))
        self._planner.reset(task)

    def act(self, observation: Observation) -> Command | Pose | None:
        """Return the planner's command."""
        self._seen.append(observation)
        seen = replace(self._seen[0], time=observation.time, ego=observation.ego)
        asked = self._planner.act(self._distorted(seen))
        if isinstance(asked, Command) and self._fault in COMMANDS:
            asked = COMMANDS[self._fault](asked)
        self._asked.append(asked)
        return self._asked[0]  # type: ignore[no-any-return]

    def _distorted(self, seen: Observation) -> Observation:
        """Return what the mutant sees."""
        if self._fault == GOES_ON_RED:
            return replace(seen, lights=())
        if self._fault in DISTORTS:
            others, sizes = DISTORTS[self._fault](View.of(seen))
            return replace(seen, others=others, sizes=sizes)
        if self._fault not in IGNORES:
            return seen
        rows = np.flatnonzero(~IGNORES[self._fault](View.of(seen))).tolist()
        return replace(
            seen,
            ids=tuple(seen.ids[row] for row in rows),
            types=tuple(seen.types[row] for row in rows),
            others=seen.others[rows],
            sizes=seen.sizes[rows],
        )


@dataclass(frozen=True)
class MutantResult:
    """What scenarios show of a mutant.

    Attributes:
        fault: its fault.
        killed_by: names of the scenarios in which it fails and the planner passes.
        changed: number of scenarios in which it drives otherwise than the planner.
        riskier: number of scenarios that it passes, with a figure beyond its limit in `FIGURES`
            though that of the planner is not.
    """

    fault: str
    killed_by: tuple[str, ...]
    changed: int
    riskier: int = 0

    def __str__(self) -> str:
        if self.killed_by:
            return f"caught in {len(self.killed_by)}, first {self.killed_by[0]}"
        if self.riskier:
            bars = ", ".join(f"bars.{name}={each.limit:g}" for name, each in FIGURES.items())
            return f"survives: drives worse in {self.riskier}, and passes; see {bars}"
        if self.changed:
            return f"survives: drives otherwise in {self.changed}, not worse"
        return "survives: these scenarios never exercise it"


@dataclass(frozen=True)
class MutationScore:
    """The mutants of one planner, and where the scenarios that catch them are saved."""

    results: tuple[MutantResult, ...]
    saved: str = ""

    @property
    def caught(self) -> int:
        """Number of mutants that are caught."""
        return sum(bool(result.killed_by) for result in self.results)

    def smallest_set(self) -> list[str]:
        """Return the names of few scenarios that catch all these mutants, chosen greedily."""
        left = [set(result.killed_by) for result in self.results if result.killed_by]
        chosen: list[str] = []
        while left:
            names = sorted(set().union(*left))
            chosen.append(max(names, key=lambda name: sum(name in each for each in left)))
            left = [each for each in left if chosen[-1] not in each]
        return chosen

    def __str__(self) -> str:
        names = ", ".join(self.smallest_set())
        few = f"; these scenarios suffice: {names}{self.saved}" if names else ""
        return f"mutation score {self.caught} of {len(self.results)}{few}"

    def document(self) -> dict[str, Any]:
        """Return it as JSON's types."""
        return {
            "caught": self.caught,
            "mutants": [
                asdict(each) | {"killed_by": list(each.killed_by)} for each in self.results
            ],
            "smallest_set": self.smallest_set(),
        }


def mutation_score(
    trials: Sequence[Trial],
    planner: MakePlanner | str,
    outcomes: Sequence[Outcome],
    config: ClosedLoopConfig = ClosedLoopConfig(),
    workers: int = 1,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> MutationScore:
    """Drive all mutants of a planner in scenarios.

    Args:
        trials: the scenarios.
        planner: makes the planner, or its name.
        outcomes: those of the planner itself; scenarios that it does not pass are left out.
        config: the parameters.
        workers: number of processes.
        progress: called with the number of finished drives and that of all.
    """
    pairs = [pair for pair in zip(trials, outcomes, strict=True) if pair[1].verdict.passed]
    cases = [(fault, *pair) for fault in MUTANTS for pair in pairs]
    killed: dict[str, list[str]] = {fault: [] for fault in MUTANTS}
    changed: Counter[str] = Counter()
    riskier: Counter[str] = Counter()
    with trial_runner(planner, config, min(workers, max(len(cases), 1))) as run:
        driven = run(
            [trial for _, trial, _ in cases],
            [partial(Mutant, planner, fault) for fault, _, _ in cases],
        )
        for number, (case, mutant) in enumerate(zip(cases, driven, strict=True), start=1):
            fault, trial, sound = case
            if not mutant.verdict.passed:
                killed[fault].append(trial.name)
            same = np.array_equal(mutant.drive.motion.position, sound.drive.motion.position)
            changed[fault] += not same
            riskier[fault] += any(
                figure.is_risky(getattr(mutant.verdict, name))
                and not figure.is_risky(getattr(sound.verdict, name))
                for name, figure in FIGURES.items()
            )
            progress(number, len(cases))
    return MutationScore(
        tuple(
            MutantResult(fault, tuple(killed[fault]), changed[fault], riskier[fault])
            for fault in MUTANTS
        )
    )
