# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sets that test a planner: every blind planner fails in most scenarios, and who looks passes.

Scenarios come in stages. A stage has one outcome of the encounter's decision in which the ego has
to react, and begins so late that speeds hardly matter any more: the blind planners of the family
then meet the other vehicle together. A scenario is kept if every blind planner still fails in 90 %
of the set, and if the reference drive and `IdmFollower` pass, the latter without braking hard.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
import math
from time import process_time
from typing import TypeVar

import numpy as np

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.parameters import updated
from scenario_gen.closed_loop.blind import blind_family, blind_passes
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.set_selection import Selection
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.method.chain import Chain
from scenario_gen.method.continuation import driven_on
from scenario_gen.method.decisions import decided
from scenario_gen.method.evaluation import replay
from scenario_gen.method.outcome_sets import requested_decisions
from scenario_gen.method.sampling import Callbacks, Progress, TargetError
from scenario_gen.method.segmentation import segment
from scenario_gen.method.shortening import fitting_part
from scenario_gen.method.suitable_roads import AUTO, suitable_roads
from scenario_gen.pipeline import completed, PipelineConfig
from scenario_gen.roads import road_and_template
from scenario_gen.situation import encroachment, Situation
from scenario_gen.types import (
    causes_in_words,
    Encounter,
    GenerationResult,
    join_pieces,
    Motion,
    Note,
    NoteKind,
    Outcome,
    Request,
    Road,
    Scenario,
    token,
    vehicle_index,
    YIELD,
)

AnyMotion = TypeVar("AnyMotion", bound=Motion)

CUT_STEP_S = 0.25  # between two begins that are tried
MIN_REMAINING_S = 4.0  # of a template from its begin on
BEGINS_COUNT = 3  # begins of a template
DELAYS_S = (0.0, 0.3, 0.6, 0.9, 1.2)  # by which the others may be later than in a template
MIN_GAP_S = 1.0  # in which the ego of a template enters behind the others
TRIED_PER_KEPT_COUNT = 60  # scenarios of a stage, before it is given up
MAX_MARGIN_S = 0.1  # of scenarios that sampling aims at
ATTEMPTS_COUNT = 200  # candidates per scenario, at most
MORE_ARRIVAL_S = 3.0  # `arrival_sigma` of a stage that gives no scenario without it
MORE_ALONG_M = 6.0  # `longitudinal_sigma`, likewise
MAX_TURNS_COUNT = 8  # in which stages are drawn from again


@dataclass(frozen=True, eq=False)
class Stage:
    """Scenarios from one template, planned on its road.

    Attributes:
        chain: the template and the parameters.
        planned: the template on its road.
        label: the outcome and the begin, in words.
        top_speed: highest speed of the ego in the template [m/s].
        extended: whether its variation is greater.
        notes: on its template.
    """

    chain: Chain
    planned: GenerationResult
    label: str
    top_speed: float
    extended: bool = False
    notes: tuple[Note, ...] = ()

    def with_more_variation(self) -> "Stage":
        """Return the stage with more variation."""
        config = self.chain.config
        sampling = replace(
            config.sampling,
            drivers=1.0,
            arrival_sigma=MORE_ARRIVAL_S,
            longitudinal_sigma=MORE_ALONG_M,
        )
        config = replace(config, sampling=sampling)
        label = f"{self.label}, with more variation"
        return replace(self, chain=replace(self.chain, config=config), label=label, extended=True)


@dataclass(frozen=True)
class TestSets:
    """Sets that test.

    Attributes:
        results: one set for each stage that gave scenarios.
        shortage: why there are less than requested, "" otherwise.
    """

    results: list[GenerationResult]
    shortage: str = ""


@dataclass(frozen=True, eq=False)
class Testing:
    """A request for scenarios in which the ego has to react; arguments as in `pipeline.generate`.

    Attributes:
        budget: computing time [s] after which no further candidate is drawn.
        notify: called with a line on each stage.
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
            TargetError: there is no scenario; the message has the stages and their causes.
            RefusedError: the encounter does not fit the road.
        """
        if not self.request.ego:
            ids = ", ".join(vehicle.id for vehicle in self.encounter.vehicles)
            raise InputError(
                "--for-testing: name the vehicle that the planner replaces with --ego, or use "
                f"--ego auto; there are {ids}"
            )
        self._refuse_over()
        end = process_time() + self.budget
        drawing = _Drawing(self, count, end, progress)
        waiting = drawing.draw(self._stages(drawing))
        for turn in range(1, MAX_TURNS_COUNT):
            waiting = drawing.draw(waiting, len(waiting), turn)
        shortage = self._shortage(drawing) if drawing.kept < count else ""
        if not drawing.results:
            raise TargetError(shortage)
        note = Note.of(NoteKind.TESTS, rate=str(drawing.selection.rate()))
        return TestSets([result.noted(note) for result in drawing.results], shortage)

    def _refuse_over(self) -> None:
        """Refuse an encounter in which all others leave before the ego can be where they meet.

        Raises:
            TargetError: it names the first of them.
        """
        situation = Situation.of(self.encounter)
        ego = vehicle_index(self.encounter, self.request.ego, "ego")
        met = [conflict for conflict in situation.conflicts if ego in conflict.pair]
        track = situation.tracks[ego]
        for conflict in met:
            spare = conflict.exit_first + DELAYS_S[-1]
            reach = spare * (track.speed[0] + 2.0 * spare)  # at 4 m/s² from the begin on
            driven = np.interp(conflict.entry_second, self.encounter.time, track.progress)
            if conflict.first == ego or conflict.following or reach > driven:
                return
        if met:
            first, name = met[0], self.encounter.ids[met[0].first]
            raise TargetError(
                f"for testing ego {self.request.ego}: nothing is left to react to, since vehicle "
                f"{name} leaves their conflict area {first.exit_first:.1f} s after the recording "
                f"begins, and the ego enters it {first.encroachment:.1f} s later: use a recording "
                "that begins earlier, or another ego"
            )

    def _shortage(self, drawing: "_Drawing") -> str:
        """Return why there are fewer scenarios than requested."""
        others = [ego for ego in reacting_vehicles(self.encounter) if ego != self.request.ego]
        advice = [f"vehicle {others[0]} may react more: --ego {others[0]}"] if others else []
        if process_time() > drawing.end:
            advice.append(f"search for more than {self.budget:g} s: --budget")
        note = Note.of(
            NoteKind.EGO_TESTS,
            ego=self.request.ego,
            kept=drawing.kept,
            requested=drawing.count,
            stages="; ".join(drawing.lines) or "it has to react in no outcome",
            advice=" or ".join(advice) or "use an encounter in which a vehicle yields",
        )
        return str(note)

    def _stages(self, drawing: "_Drawing") -> Iterator[Stage]:
        """Yield the stages; refused ones are reported.

        Raises:
            RefusedError: the encounter does not fit the road.
        """
        name = self.road
        if name == AUTO:
            segmentation = segment(self.encounter, self.config.segmentation, self.seed)
            names = suitable_roads(Situation.of(self.encounter), segmentation, self.config)
            name = next(names, AUTO)
        for outcome in self._templates(self.encounter):
            try:
                yield from self._stages_from(self._whole_stage(name, outcome), drawing)
            except RefusedError as error:
                drawing.report(f"{_outcome(outcome)}: {error}")

    def _templates(self, encounter: Encounter) -> Iterator[Encounter]:
        """Yield the outcomes of an encounter in which the ego goes second.

        Those in which it stops are first: blind planners that start together meet the others.
        """
        ego = token(self.request.ego)
        decisions = requested_decisions(encounter, self.config.sampling, self.request)
        second = [decision for decision in decisions.possible if decision.second == ego]
        for decision in sorted(second, key=lambda each: each.outcome is not Outcome.STOPS):
            yield decided(encounter, decision)
        if not second and self.request.ego in reacting_vehicles(encounter):
            yield encounter

    def _whole_stage(self, road: Road | str, template: Encounter) -> Stage:
        """Return the stage of a whole template, which is shortened if it does not fit.

        Raises:
            RefusedError: it does not fit the road.
        """

        def stage_of(part: Encounter) -> Stage:
            whole, _ = driven_on(part)
            return self._stage(*road_and_template(road, whole, self.config.road), 0)

        try:
            return stage_of(template)
        except RefusedError as error:
            if not self.config.fitting.shorten or self.request.moves:
                raise
            part, note = fitting_part(stage_of, template, error, self.config.fitting)
        return replace(stage_of(part), notes=(note,))

    def _stages_from(self, whole: Stage, drawing: "_Drawing") -> Iterator[Stage]:
        """Yield the stages from the begins of a template at which most blind planners fail.

        A recorded encounter has one begin, since its scenarios would count as of several else.
        """
        template = whole.planned.encounter
        road, fit = whole.planned.road_and_fit()
        scenario = replay(template, fit, road.frame_id)
        family = blind_family(whole.top_speed)
        options: list[tuple[float, float, int]] = []
        for delay in DELAYS_S:
            count = round(delay / template.dt)
            if count and not self._has_room(with_delay(template, self.request.ego, count)):
                break
            delayed = with_delay(scenario, self.request.ego, round(delay / scenario.dt))
            loop = ClosedLoop(delayed, self.request.ego, road, self.drive_config)
            first = max(loop.begin, delay)
            latest = max(first + CUT_STEP_S, template.duration - MIN_REMAINING_S)
            for begin in np.arange(first, latest, CUT_STEP_S).tolist():
                if options and process_time() > drawing.end:
                    break
                share = float(blind_passes(loop, family, begin).mean())
                options.append((share, -begin, count))
        for _, begin, count in sorted(options)[:BEGINS_COUNT]:
            encounter = with_delay(template, self.request.ego, count)
            first_row = round(-begin / template.dt)
            yield replace(self._stage(road, encounter, first_row), notes=whole.notes)
            if template.decision is None and drawing.results:
                return

    def _has_room(self, template: Encounter) -> bool:
        """Whether the ego, where it goes second, enters at least MIN_GAP_S after the other one."""
        ego = self.request.ego_of(template)
        gaps = [
            encroachment(template, conflict)
            for conflict in Situation.of(template).conflicts
            if conflict.second == ego
        ]
        return bool(gaps) and not min(gaps) < MIN_GAP_S

    def _stage(self, road: Road, template: Encounter, first: int) -> Stage:
        """Return the stage of a template from a sample on.

        Raises:
            RefusedError: it does not fit the road.
        """
        rows = np.flatnonzero(template.present[:, 1] > first + 1).tolist()
        encounter = template
        if first:
            encounter = template.select(rows, first)
            if template.decision is not None:
                name = f"{template.name}, from {first * template.dt:.1f} s"
                encounter = replace(encounter, name=name)
        aim = f"blind_margin[{self.request.ego}]=..{MAX_MARGIN_S}"
        targets = join_pieces(filter(None, [aim, self.request.target]))
        chain = Chain(
            Situation.of(encounter),
            segment(encounter, self.config.segmentation, self.seed),
            road,
            updated(
                self.config,
                {
                    "sampling.ego": "free",
                    "sampling.decisions": "recorded",
                    "sampling.attempts": ATTEMPTS_COUNT,
                },
            ),
            replace(self.request, target=targets),
        )
        ego = self.request.ego_of(encounter)
        label = f"{_outcome(template)}, from {first * template.dt:.1f} s"
        return Stage(chain, chain.plan(), label, float(encounter.speed[ego].max()))

    @property
    def drive_config(self) -> ClosedLoopConfig:
        """The parameters of the drives."""
        return ClosedLoopConfig(limits=self.config.limits)


@dataclass
class _Drawing:
    """The sets so far.

    Attributes:
        testing: the request.
        count: scenarios wanted.
        end: computing time [s] at which it ends.
        progress: of the caller.
        selection: the kept scenarios; it is made for the first stage.
        results: one set per stage.
        lines: on each stage.
    """

    testing: Testing
    count: int
    end: float
    progress: Progress
    selection: Selection = field(default_factory=lambda: Selection.of(0.0))
    results: list[GenerationResult] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    @property
    def kept(self) -> int:
        """Number of scenarios so far."""
        return self.selection.kept

    def report(self, line: str) -> None:
        """Report a line on a stage."""
        self.lines.append(line)
        self.testing.notify(line)

    def draw(self, stages: Iterable[Stage], count: int = 0, turn: int = 0) -> list[Stage]:
        """Draw from stages, an equal part from each; return those to draw from again.

        Those are the productive ones, or else all with more variation.

        Args:
            stages: in order.
            count: of the stages; 0 if it is not known: each has half of what is missing.
            turn: number of the turn.
        """
        productive, others = [], []
        for k, stage in enumerate(stages):
            if not self.kept:
                self.selection = Selection.of(stage.top_speed)
            left = count - k if count else 2
            wanted = -(-(self.count - self.kept) // left)
            seconds = (self.end - process_time()) / left
            if not wanted or seconds <= 0.0:
                break
            if self._draw_stage(stage, turn, wanted, seconds):
                productive.append(stage)
            elif not stage.extended:
                others.append(stage.with_more_variation())
        if self.kept == self.count or process_time() > self.end:
            return []
        return productive or others

    def _draw_stage(self, stage: Stage, turn: int, wanted: int, seconds: float) -> bool:
        """Draw from a stage for some seconds; return whether it gave a scenario."""
        testing, selection, begin = self.testing, self.selection, process_time()
        kept, unfit = selection.kept, Counter(selection.unfit)
        chain = replace(stage.chain, count=wanted, seed=testing.seed + turn)

        def accepts(scenario: Scenario) -> bool:
            loop = ClosedLoop(scenario, testing.request.ego, chain.road, testing.drive_config)
            return selection.keeps(loop)

        def cancelled() -> bool:
            tried = selection.unfit.total() - unfit.total()
            hopeless = tried >= TRIED_PER_KEPT_COUNT * (selection.kept - kept + 1)
            return hopeless or process_time() > begin + seconds

        def progress(_done: int, _total: int, candidates: int) -> None:
            self.progress(selection.kept, self.count, candidates)

        planned = replace(stage.planned, seed=chain.seed)
        causes: Counter[str] = Counter()
        try:
            drawn = chain.sample(planned, Callbacks(progress, cancelled, accepts))
            causes.update(dict(causes_in_words(drawn.generated.refused)))
            if len(drawn):
                self.results.append(_completed(drawn, stage))
        except RefusedError as error:
            causes[str(error)] += 1
        causes.update(selection.unfit - unfit)
        words = ", ".join(f"{number} {cause}" for cause, number in causes.most_common())
        self.report(
            f"{stage.label}: {selection.kept - kept} of {wanted} scenarios in "
            f"{process_time() - begin:.0f} s ({words or 'nobody was refused'})"
        )
        return selection.kept > kept


def _completed(drawn: GenerationResult, stage: Stage) -> GenerationResult:
    """Return a set with its evaluation; it has as many scenarios as were requested of it."""
    notes = [note for note in drawn.generated.adaptations if note.kind is not NoteKind.CANCELLED]
    generated = replace(drawn.generated, requested=len(drawn), adaptations=(*stage.notes, *notes))
    result = replace(drawn, generated=generated)
    return completed(result, stage.chain.config, stage.chain.request)


def with_delay(motion: AnyMotion, ego: str, count: int) -> AnyMotion:
    """Return a motion in which all but one vehicle are some samples later; the first are void."""
    rows = np.array([vehicle.id != ego for vehicle in motion.vehicles])
    arrays = {name: getattr(motion, name).copy() for name in motion.array_names}
    present = motion.present.copy()
    for values in arrays.values():
        values[rows, count:] = values[rows, : values.shape[1] - count]
    present[rows] = np.minimum(present[rows] + [0, count], len(motion.time) - 1)
    return replace(motion, present=present, **arrays)


def _outcome(template: Encounter) -> str:
    """Return the outcome of a template's decision, in words."""
    return "as recorded" if template.decision is None else str(template.decision)


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
