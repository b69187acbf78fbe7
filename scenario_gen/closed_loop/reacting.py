# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The scenarios that test a planner: one that looks at nobody collides in them, and a simple one that looks passes."""

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

MAX_BASELINE_DRIVES = 50  # scenarios of a set that are driven to say how many need no reaction
PROBED = 12  # scenarios by which it is told who has to react
ROADS_TRIED = 2  # that are tried where nobody has to react
EASY = 0.9  # share of a set that the baseline passes, from which on the set hardly tests
FREER = {
    "arrival_sigma": 3.0,
    "wait_sigma": 2.0,
    "pace_sigma": 0.12,
    "end_speed_sigma": 2.0,
    "longitudinal_sigma": 6.0,
}
"""Parameters of sampling where those given leave no scenario that tests."""


def needs_reaction(loop: ClosedLoop) -> bool:
    """Whether the non-reactive baseline collides, while the reference drive and an IDM follower pass."""
    if judge(loop, loop.drive(NonReactive())).collision is None:
        return False
    references = (ReferenceFollower(loop), IdmFollower(speed=loop.task().speed))
    return all(judge(loop, loop.drive(reference)).passed for reference in references)


@dataclass(frozen=True, eq=False)
class Testing:
    """A request for scenarios of an encounter on a road in which the ego has to react; arguments as of `pipeline.generate`."""

    encounter: Encounter
    road: Road | str
    config: PipelineConfig
    request: Request
    seed: int

    def run(self, count: int, progress: Progress = lambda *_: None) -> GenerationResult:
        """Return `count` scenarios, drawn with more freedom where the parameters give too few, or as many as there are.

        Raises:
            InputError: no vehicle is named as ego.
            TargetError: there is none; the message names vehicles and roads that have some.
            RefusedError: as `pipeline.generate`.
        """
        if not self.request.ego:
            ids = ", ".join(vehicle.id for vehicle in self.encounter.vehicles)
            raise InputError(
                f"--for-testing: name the vehicle in whose place the planner drives by --ego, or auto; there are {ids}"
            )
        most: GenerationResult | None = None
        for tried in self.attempts():
            with suppress(TargetError):
                case = tried.generate(count, progress)
                if tried is not self:
                    freer = ", ".join(
                        f"sampling.{name}={getattr(tried.config.sampling, name):g}"
                        for name in FREER
                    )
                    case = _noted(case, Note.of(NoteKind.MORE_FREEDOM, parameters=freer))
                if most is None or len(case.generated) > len(most.generated):
                    most = case
                if len(case.generated) == count:
                    return case
        ego, kept = self.request.ego, 0 if most is None else len(most.generated)
        others = ", ".join(
            f"{other} in {found} of {PROBED}"
            for other, found in self.who_reacts().items()
            if other != ego
        )
        advice = f"has to react as ego: {others}" if others else self.elsewhere()
        note = Note.of(NoteKind.EGO_TESTS, ego=ego, kept=kept, requested=count, advice=advice)
        if most is None:
            raise TargetError(str(note))
        return _noted(most, note)

    def generate(self, count: int, progress: Progress = lambda *_: None) -> GenerationResult:
        """Return `count` scenarios, or as many as the parameters give.

        The ego's motion varies as the others' does; sampling is directed to where it meets one of
        them if it ignores all.

        Raises:
            InputError, RefusedError: as `pipeline.generate`; a TargetError if there is none.
        """
        ego = self.request.ego
        targets = join_pieces(filter(None, [f"baseline_margin[{ego}]=..0", self.request.target]))

        def accepts(road: Road, whole: Scenario) -> bool:
            return needs_reaction(
                ClosedLoop(whole, ego, road, ClosedLoopConfig(limits=self.config.limits))
            )

        return generate(
            self.encounter, self.road, updated(self.config, {"sampling.ego": "free"}), count=count, seed=self.seed,
            request=replace(self.request, target=targets), progress=progress, accepts=accepts,
        )  # fmt: skip

    def attempts(self) -> Iterator["Testing"]:
        """Yield the request as it is, and with the freedom of FREER, where it had less."""
        yield self
        sampling = self.config.sampling.at_least(FREER)
        if sampling != self.config.sampling:
            yield replace(self, config=replace(self.config, sampling=sampling))

    def who_reacts(self) -> dict[str, int]:
        """Return in how many of PROBED scenarios each vehicle has to react if it is the ego; who does in most comes first."""
        found: dict[str, tuple[int, float]] = {}
        for vehicle in self.encounter.vehicles:
            with suppress(TargetError):
                drawn = (
                    replace(self, request=replace(self.request, ego=vehicle.id))
                    .generate(PROBED)
                    .generated
                )
                found[vehicle.id] = (
                    len(drawn),
                    drawn.reached.share if drawn.reached is not None else 0.0,
                )
        return {
            ego: found[ego][0] for ego in sorted(found, key=lambda ego: found[ego], reverse=True)
        }

    def who_reacts_most(self) -> str:
        """Return the vehicle that has to react in most scenarios if it is the ego.

        Raises:
            TargetError: nobody has to, with more freedom neither; the message names roads where
                somebody has.
            RefusedError: as `pipeline.generate`.
        """
        for tried in self.attempts():
            for ego in tried.who_reacts():
                return ego
        raise TargetError(
            f"--ego auto: nobody has to react in any scenario that was found; {self.elsewhere()}"
        )

    def elsewhere(self) -> str:
        """Say on which other roads somebody has to react."""
        segmentation = segment(self.encounter, self.config.segmentation, self.seed)
        names = (
            name
            for name in suitable_roads(Situation.of(self.encounter), segmentation, self.config)
            if name != self.road
        )
        found: list[str] = []
        for name in islice(names, ROADS_TRIED):
            with suppress(RefusedError):
                found += [
                    f"--road {name} --ego {ego}"
                    for ego in islice(replace(self, road=name).who_reacts(), 1)
                ]
        return (
            f"possible: {' or '.join(found)}"
            if found
            else "take an encounter in which somebody yields, or follows more closely"
        )


def _noted(case: GenerationResult, note: Note) -> GenerationResult:
    """Return a result with one more note on how it was drawn."""
    return replace(
        case, generated=replace(case.generated, adaptations=(*case.generated.adaptations, note))
    )


def is_trivial(passed: int, driven: int) -> str:
    """Say that a set hardly tests a planner, by how many of its scenarios the baseline passes; "" if it does test one."""
    if passed <= EASY * driven:
        return ""
    return f"these scenarios hardly test a planner: the non-reactive baseline passes {passed} of {driven}"


def baseline_passes(case: GenerationResult, config: ClosedLoopConfig = ClosedLoopConfig()) -> str:
    """Say how many scenarios (of MAX_BASELINE_DRIVES at most) the non-reactive baseline passes; "" if no vehicle was left out."""
    drawn = case.generated
    if drawn.ego is None or not drawn.scenarios:
        return ""
    ego = drawn.ego.vehicle.id
    loops = [
        ClosedLoop(join_ego(scenario), ego, case.road, config)
        for scenario in drawn.scenarios[:MAX_BASELINE_DRIVES]
    ]
    passed = sum(judge(loop, loop.drive(NonReactive())).passed for loop in loops)
    said = f"the non-reactive baseline, in place of {ego}, passes {passed} of {len(loops)}"
    return f"{case.title}: {is_trivial(passed, len(loops)) or said}"
