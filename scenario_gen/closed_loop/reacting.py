# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sets that test a planner: every speed law fails in most scenarios, and who looks passes.

The ego crosses or joins a stream with one gap. The gap opens at different times, and an ego that
has crossed then stands in a queue for a short or a long time. A scenario is kept if no speed law
of the family passes too many of the set, and if the reference drive and `IdmFollower` pass.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
import math
from time import process_time

import numpy as np

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.parameters import updated
from scenario_gen.closed_loop.blind import FAMILY, law_passes
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.planners import IdmFollower, ReferenceFollower
from scenario_gen.closed_loop.simulation import ClosedLoop, Planner
from scenario_gen.closed_loop.streams import Stream
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.method.chain import AUTO, Chain, Generation, suitable_roads
from scenario_gen.method.sampling import Callbacks, Progress, TargetError
from scenario_gen.method.segmentation import segment
from scenario_gen.numerics import Ints
from scenario_gen.pipeline import completed, PipelineConfig
from scenario_gen.situation import Situation
from scenario_gen.types import (
    causes_in_words,
    Encounter,
    GenerationResult,
    Note,
    NoteKind,
    Planned,
    Request,
    Road,
    Scenario,
    vehicle_index,
    YIELD,
)

OPEN_S = (3.0, 4.5, 6.0, 7.5, 9.0, 10.5, 12.0, 13.5, 15.0, 16.5)
"""Times at which the reference drive enters the gap of a stream that it crosses."""
MERGE_S = (3.0, 6.5, 10.0, 13.5, 17.0, 20.5, 24.0, 27.5, 31.0, 34.5)
"""Those of a stream that it joins: no queue follows, so speed laws pass for longer."""
QUEUE_S = (1.5, 5.5)  # of the ego behind the conflict area, alternately
TRIED_PER_KEPT_COUNT = 5  # valid scenarios of a template, before it is given up
MAX_LAW_SHARE = 0.1  # of a set that tests, which a speed law may pass
DRIVERS_SHARE = 0.2  # by which drivers of a stream differ, of that of recorded drivers
ATTEMPTS_COUNT = 20  # candidates per scenario, at most
ROUNDS_COUNT = 2  # in which scenarios are drawn from each template


@dataclass(frozen=True)
class TestSets:
    """Sets that test.

    Attributes:
        results: one set for each time and queue that gave scenarios.
        shortage: why there are less than requested, "" otherwise.
    """

    results: list[GenerationResult]
    shortage: str = ""


@dataclass
class Selection:
    """The scenarios that are kept so far, by the speed laws that pass them.

    Attributes:
        most: number of scenarios that a speed law may pass.
        passed: (M,) number of kept scenarios that each law passes.
        kept: number of kept scenarios.
        unfit: number of other scenarios, by cause.
        tries: number of scenarios that were asked about.
    """

    most: int
    passed: Ints = field(default_factory=lambda: np.zeros(len(FAMILY), dtype=np.int64))
    kept: int = 0
    unfit: Counter[str] = field(default_factory=Counter)
    tries: int = 0

    @property
    def reason(self) -> str:
        """Why most other candidates are refused, as the end of a sentence; "" without any."""
        (cause, number), *_ = self.unfit.most_common(1) or [("", 0)]
        return f"; most others, {number} of {self.unfit.total()}: {cause}" if number else ""

    def keeps(self, loop: ClosedLoop) -> bool:
        """Keep a scenario if the set tests with it; return whether it is kept."""
        self.tries += 1
        passes = law_passes(loop)
        planners: dict[str, Planner] = {
            "the reference drive": ReferenceFollower(loop),
            "IdmFollower": IdmFollower(speed=loop.task().speed),
        }
        if (self.passed + passes).max() > self.most:
            self.unfit["passed by speed laws"] += 1
            return False
        for name, planner in planners.items():
            if not judge(loop, loop.drive(planner)).passed:
                self.unfit[f"failed by {name}"] += 1
                return False
        self.passed += passes
        self.kept += 1
        return True


@dataclass(frozen=True, eq=False)
class Testing:
    """A request for scenarios in which the ego has to react; arguments as in `pipeline.generate`.

    Attributes:
        budget: computing time [s] after which no further candidate is drawn.
        notify: called with a line on the set.
    """

    encounter: Encounter
    road: Road | str
    config: PipelineConfig
    request: Request
    seed: int
    budget: float = math.inf
    notify: Callable[[str], None] = lambda _: None

    def run(self, count: int, progress: Progress = lambda *_: None) -> TestSets:
        """Return sets with `count` scenarios in all, or as many as the budget allows.

        Raises:
            InputError: no vehicle is named as ego.
            TargetError: there is no scenario; the message says why.
            RefusedError: the encounter does not fit the road.
        """
        if not self.request.ego:
            ids = ", ".join(vehicle.id for vehicle in self.encounter.vehicles)
            raise InputError(
                "--for-testing: name the vehicle that the planner replaces with --ego, or use "
                f"--ego auto; there are {ids}"
            )
        end = process_time() + self.budget
        selection = Selection(max(math.ceil(MAX_LAW_SHARE * count), 1))
        plans = self._plans(selection)
        results: list[GenerationResult] = []
        for turn in range(ROUNDS_COUNT):
            for k, plan in enumerate(plans):
                wanted = -(-(count - selection.kept) // (len(plans) - k))
                if wanted and process_time() < end:
                    results += self._drawn(plan, wanted, turn, selection, end, progress)
        shortage = ""
        if selection.kept < count:
            is_over = process_time() > end
            note = Note.of(
                NoteKind.EGO_TESTS,
                ego=self.request.ego,
                kept=selection.kept,
                requested=count,
                reason=selection.reason,
                advice=f"; search for more than {self.budget:g} s: --budget" if is_over else "",
            )
            shortage = str(note)
        if not results:
            raise TargetError(shortage)
        self.notify(f"{selection.kept} of {count} scenarios for testing{selection.reason}")
        return TestSets(results, shortage)

    def _plans(self, selection: Selection) -> list[tuple[Chain, Planned]]:
        """Return the templates, planned; refused ones are counted.

        Raises:
            TargetError: the ego waits for nobody.
        """
        try:
            stream = Stream.of(
                self.encounter, vehicle_index(self.encounter, self.request.ego, "ego")
            )
        except RefusedError as error:
            raise TargetError(f"for testing ego {self.request.ego}: {error}") from error
        sampling = {
            "sampling.ego": "free",
            "sampling.decisions": "recorded",
            "sampling.attempts": ATTEMPTS_COUNT,
            "sampling.drivers": DRIVERS_SHARE,
        }
        config = updated(self.config, sampling)
        road = self.road
        plans = []
        times = MERGE_S if stream.joins else OPEN_S
        for k, time in enumerate(times):
            queue = 0.0 if stream.joins else QUEUE_S[k % len(QUEUE_S)]
            try:
                template = stream.open_at(time, queue, 1.0 / len(times))
                if road == AUTO:
                    parts = segment(template, config.segmentation, self.seed)
                    names = suitable_roads(Situation.of(template), parts, config)
                    road = next(names, AUTO)
                plans.append(Generation(road, config, self.request, self.seed).plan(template))
            except RefusedError as error:
                selection.unfit[str(error)] += 1
        return plans

    def _drawn(
        self,
        plan: tuple[Chain, Planned],
        wanted: int,
        turn: int,
        selection: Selection,
        end: float,
        progress: Progress,
    ) -> list[GenerationResult]:
        """Return a set of scenarios of a template, or none."""
        config = ClosedLoopConfig(limits=self.config.limits)
        chain, planned = plan

        def accepts(scenario: Scenario) -> bool:
            return selection.keeps(ClosedLoop(scenario, self.request.ego, planned.road, config))

        def report(_done: int, _total: int, candidates: int) -> None:
            progress(selection.kept, selection.kept + wanted, candidates)

        chain = replace(chain, count=wanted, seed=self.seed + turn)
        tries, kept = selection.tries, selection.kept

        def cancelled() -> bool:
            useless = selection.tries - tries - TRIED_PER_KEPT_COUNT * (selection.kept - kept + 1)
            return useless > 0 or process_time() > end

        callbacks = Callbacks(report, cancelled, accepts)
        try:
            drawn = chain.sample(replace(planned, seed=chain.seed), callbacks)
        except RefusedError as error:
            selection.unfit[str(error)] += 1
            return []
        for cause, number in causes_in_words(drawn.generated.refused):
            selection.unfit[cause] += number
        if not len(drawn):
            return []
        notes = [
            note for note in drawn.generated.adaptations if note.kind is not NoteKind.CANCELLED
        ]
        generated = replace(drawn.generated, requested=len(drawn), adaptations=tuple(notes))
        return [completed(replace(drawn, generated=generated), chain.config, chain.request)]


def reacting_vehicles(encounter: Encounter) -> list[str]:
    """Return the ids of the vehicles that react, or go second at a conflict, in an encounter.

    Who yields is first, then who follows. No planner drives a vehicle with a trailer.
    """
    situation = Situation.of(encounter)
    edges = sorted(
        situation.reactions.edges, key=lambda edge: (edge.kind != YIELD, not edge.stands)
    )
    rows = [*(edge.who for edge in edges), *(each.second for each in situation.conflicts)]
    vehicles = [encounter.vehicles[row] for row in dict.fromkeys(rows)]
    return [each.id for each in vehicles if not (each.kind.walks or each.trailer)]
