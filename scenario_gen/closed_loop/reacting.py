# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios that test a planner: a non-reactive one collides, a simple reactive one passes."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.parameters import updated
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.planners import IdmFollower, NonReactive, ReferenceFollower
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.method.sampling import Progress, TargetError
from scenario_gen.method.segmentation import segment
from scenario_gen.method.suitable_roads import suitable_roads
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.situation import Situation
from scenario_gen.types import (
    Encounter,
    GenerationResult,
    join_ego,
    join_pieces,
    Note,
    NoteKind,
    Request,
    Road,
    Scenario,
)

PROBE_COUNT = 12  # scenarios per vehicle to find out whether it has to react
TRIVIAL = "these scenarios hardly test a planner"
MORE_VARIATION = {
    "arrival_sigma": 3.0,
    "wait_sigma": 2.0,
    "pace_sigma": 0.12,
    "end_speed_sigma": 2.0,
    "longitudinal_sigma": 6.0,
}
"""Least sampling parameters if those of the user yield too few scenarios that test."""


def needs_reaction(loop: ClosedLoop) -> bool:
    """Whether the baseline collides, while the reference drive and an IDM follower pass."""
    if judge(loop, loop.drive(NonReactive())).collision is None:
        return False
    references = (ReferenceFollower(loop), IdmFollower(speed=loop.task().speed))
    return all(judge(loop, loop.drive(reference)).passed for reference in references)


@dataclass(frozen=True, eq=False)
class Testing:
    """A request for scenarios in which the ego has to react; arguments as in `pipeline.generate`.

    Attributes:
        extended: whether the sampling was extended to MORE_VARIATION.
    """

    encounter: Encounter
    road: Road | str
    config: PipelineConfig
    request: Request
    seed: int
    extended: bool = False

    def run(self, count: int, progress: Progress = lambda *_: None) -> GenerationResult:
        """Return `count` scenarios, or as many as possible.

        They are drawn with more variation if the parameters yield too few.

        Raises:
            InputError: no vehicle is named as ego.
            TargetError: there is no scenario; the message names vehicles and roads that have some.
            RefusedError: as `pipeline.generate`.
        """
        if not self.request.ego:
            ids = ", ".join(vehicle.id for vehicle in self.encounter.vehicles)
            raise InputError(
                "--for-testing: name the vehicle that the planner replaces with --ego, or use "
                f"--ego auto; there are {ids}"
            )
        best: GenerationResult | None = None
        for attempt in self.attempts():
            with suppress(TargetError):
                case = attempt._generate_noted(count, progress)
                if best is None or len(case.generated) > len(best.generated):
                    best = case
            if best is not None and len(best.generated) == count:
                return best
        kept = 0 if best is None else len(best.generated)
        note = Note.of(
            NoteKind.EGO_TESTS,
            ego=self.request.ego,
            kept=kept,
            requested=count,
            advice=self._advice(),
        )
        if best is None:
            raise TargetError(str(note))
        return _with_note(best, note)

    def _generate_noted(self, count: int, progress: Progress) -> GenerationResult:
        """Return scenarios with a note if the sampling has the values of MORE_VARIATION."""
        case = self.generate(count, progress)
        if not self.extended:
            return case
        sampling = self.config.sampling
        parameters = ", ".join(
            f"sampling.{name}={getattr(sampling, name):g}" for name in MORE_VARIATION
        )
        return _with_note(case, Note.of(NoteKind.MORE_FREEDOM, parameters=parameters))

    def _advice(self) -> str:
        """Return other vehicles that have to react as the ego, or else other roads, in words."""
        others = ", ".join(
            f"{vehicle} in {count} of {PROBE_COUNT}"
            for vehicle, count in self.who_reacts().items()
            if vehicle != self.request.ego
        )
        return f"has to react as ego: {others}" if others else self.other_roads()

    def generate(self, count: int, progress: Progress = lambda *_: None) -> GenerationResult:
        """Return `count` scenarios, or as many as the parameters yield.

        The ego's motion varies like that of the others. Sampling is directed to motions with which
        an ego that ignores all others collides.

        Raises:
            InputError, RefusedError: as `pipeline.generate`; a TargetError if there is none.
        """
        ego = self.request.ego
        targets = join_pieces(filter(None, [f"baseline_margin[{ego}]=..0", self.request.target]))

        def accepts(road: Road, whole: Scenario) -> bool:
            config = ClosedLoopConfig(limits=self.config.limits)
            return needs_reaction(ClosedLoop(whole, ego, road, config))

        return generate(
            self.encounter,
            self.road,
            updated(self.config, {"sampling.ego": "free"}),
            count=count,
            seed=self.seed,
            request=replace(self.request, target=targets),
            progress=progress,
            accepts=accepts,
        )

    def attempts(self) -> Iterator["Testing"]:
        """Yield the request, then one with MORE_VARIATION if that is different."""
        yield self
        sampling = self.config.sampling.at_least(MORE_VARIATION)
        if sampling != self.config.sampling:
            config = replace(self.config, sampling=sampling)
            yield replace(self, config=config, extended=True)

    def who_reacts(self) -> dict[str, int]:
        """Return in how many of PROBE_COUNT scenarios each vehicle has to react if it is the ego.

        The vehicle with the most scenarios is the first.
        """
        results: dict[str, tuple[int, float]] = {}
        for vehicle in self.encounter.vehicles:
            request = replace(self.request, ego=vehicle.id)
            with suppress(TargetError):
                drawn = replace(self, request=request).generate(PROBE_COUNT).generated
                share = drawn.reached.share if drawn.reached is not None else 0.0
                results[vehicle.id] = (len(drawn), share)
        order = sorted(results, key=lambda ego: results[ego], reverse=True)
        return {ego: results[ego][0] for ego in order}

    def who_reacts_most(self) -> str:
        """Return the vehicle that has to react in most scenarios if it is the ego.

        Raises:
            TargetError: no vehicle has to react; the message names other roads.
            RefusedError: as `pipeline.generate`.
        """
        for attempt in self.attempts():
            for ego in attempt.who_reacts():
                return ego
        raise TargetError(
            f"--ego auto: no vehicle has to react in any scenario; {self.other_roads()}"
        )

    def other_roads(self) -> str:
        """Return other roads on which a vehicle has to react, in words."""
        segmentation = segment(self.encounter, self.config.segmentation, self.seed)
        names = (
            name
            for name in suitable_roads(Situation.of(self.encounter), segmentation, self.config)
            if name != self.road
        )
        options: list[str] = []
        for name in islice(names, 2):
            with suppress(RefusedError):
                egos = replace(self, road=name).who_reacts()
                options += [f"--road {name} --ego {ego}" for ego in islice(egos, 1)]
        if not options:
            return "use an encounter in which a vehicle yields or follows more closely"
        return f"possible: {' or '.join(options)}"


def _with_note(case: GenerationResult, note: Note) -> GenerationResult:
    """Return a result with one more note on its sampling."""
    return replace(
        case, generated=replace(case.generated, adaptations=(*case.generated.adaptations, note))
    )


def trivial_note(passed: int, driven: int) -> str:
    """Return a sentence if the baseline passes more than 90 % of a set, else ""."""
    if passed <= 0.9 * driven:
        return ""
    return f"{TRIVIAL}: the non-reactive baseline passes {passed} of {driven}"


def baseline_passes(case: GenerationResult, config: ClosedLoopConfig = ClosedLoopConfig()) -> str:
    """Return in words how many scenarios the non-reactive baseline passes.

    It drives the first 50 scenarios at most. "" if the scenarios have no ego slot.
    """
    drawn = case.generated
    if drawn.ego is None or not drawn.scenarios:
        return ""
    ego = drawn.ego.vehicle.id
    scenarios = drawn.scenarios[:50]
    loops = [ClosedLoop(join_ego(scenario), ego, case.road, config) for scenario in scenarios]
    passed = sum(judge(loop, loop.drive(NonReactive())).passed for loop in loops)
    rate = f"the non-reactive baseline, in place of {ego}, passes {passed} of {len(loops)}"
    return f"{case.title}: {trivial_note(passed, len(loops)) or rate}"
