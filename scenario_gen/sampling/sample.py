# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The loop: draw candidates, have them checked, keep the valid ones, account for the others."""

from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
import itertools
from typing import Any

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.errors import InputError, RefusedError
from scenario_gen.sampling.candidates import Batch, CandidateModel, Scale
from scenario_gen.sampling.config import SamplingConfig
from scenario_gen.sampling.directed import (
    Aim,
    CHUNK,
    estimated,
    FAIR,
    GOOD,
    Measures,
    PATIENCE,
    PLAIN,
    Proposal,
    reachable,
    Seen,
    STAGE,
    STAGES,
    TargetError,
)
from scenario_gen.sampling.diverse import POOL_SHARE, spread_out
from scenario_gen.sampling.lazy import LazyScenarios
from scenario_gen.sampling.prepare import prepare
from scenario_gen.template.interaction import closest_crossing, Conflict, find_conflicts, pair_conflict, Wait
from scenario_gen.types.ego import with_witness
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.request import Request
from scenario_gen.types.road import Road
from scenario_gen.types.route import Route
from scenario_gen.types.scenario import BoundaryStates, Cause, EgoSlot, Scenario, ScenarioSet, Verdict
from scenario_gen.types.segmentation import Segmentation
from scenario_gen.types.target import Reached, Target

Check = Callable[[Sequence[Scenario]], list[Verdict]]
Progress = Callable[[int, int, int], None]  # of scenarios so far, scenarios wanted, candidates so far
Cancelled = Callable[[], bool]
Label = Callable[[Scenario], dict[str, str]]
OnValid = Callable[[Scenario, BoundaryStates, EgoSlot | None], None]  # a valid one, the states asked, what the ego is asked

LEVELS = (
    Scale(),
    Scale(lateral=0.5),
    Scale(lateral=0.5, longitudinal=0.5),
    Scale(lateral=0.25, longitudinal=0.25, time=0.5),
    Scale(lateral=0.1, longitudinal=0.1, time=0.25),
)
LEVEL_SIZE = 1 << 20  # candidates of one level whose indices follow each other
LEVEL_SLOTS = 8  # levels that an index has room for; after them come the next LEVEL_SIZE candidates of the first
KEPT = 1000  # scenarios up to which a set stays in memory
BLOCK = 32  # candidates whose random numbers are drawn together
PILOT = 2 * BLOCK  # candidates by which a level is judged
ENOUGH = 0.3  # share of valid candidates below which the next level is tried
DIRECTED, STAGED = 5, 6  # slots of the candidates of a proposal, and of those by which it is found
DIRECTED_BUDGET = 10  # times the budget of a request without a target
HOPELESS = 20 * BLOCK  # candidates of a proposal after which it is given up if none of them is valid and in the range


def index_of(level: int, candidate: int) -> int:
    """Return the index of a level's candidate: level * LEVEL_SIZE + candidate while that suffices, and unique beyond."""
    page, within = divmod(candidate, LEVEL_SIZE)
    return (page * LEVEL_SLOTS + level) * LEVEL_SIZE + within


def place_of(index: int) -> tuple[int, int]:
    """Return level and number of the candidate with this index.

    Raises:
        InputError: no candidate has it.
    """
    slot, within = divmod(index, LEVEL_SIZE)
    page, level = divmod(slot, LEVEL_SLOTS)
    if index < 0 or level > DIRECTED:
        raise InputError(f"no candidate has the index {index}; take one of `scenarios/info`")
    return level, page * LEVEL_SIZE + within


@dataclass(frozen=True, eq=False)
class Sampler:
    """Draws candidates by their index: the same seed and index give the same candidate, whatever was drawn before."""

    model: CandidateModel
    seed: int
    frame_id: str
    ego: int | None = None  # of the vehicle that is left out of what is published, and is its witness
    base: int = 0  # level whose standard deviations the candidates of a proposal have
    proposal: Proposal | None = None
    label: Label = lambda _: {}  # facts of a candidate of all vehicles
    weighted: bool = True  # whether the candidates of a proposal say their weights

    def block(self, level: int, number: int) -> tuple[Batch, list[int]]:
        """Candidates number·BLOCK … of a level, and their indices."""
        first = index_of(level, number * BLOCK)
        return self.model.draw(self.numbers(level, number), self._scale(level)), list(range(first, first + BLOCK))

    def scenario(self, index: int) -> Scenario | None:
        """The candidate with this index, bit for bit as in a whole set; None if it has no speed profile."""
        level, candidate = place_of(index)
        number, row = divmod(candidate, BLOCK)
        batch = self.model.draw(self.numbers(level, number)[row : row + 1], self._scale(level))
        (whole,) = batch.scenarios(self.seed, [index], self.frame_id)
        return None if whole is None else self.published(whole)

    def redraw(self, index: Sequence[int]) -> list[Scenario]:
        """The scenarios of indices that are of one block, bit for bit as in a whole set."""
        level, candidate = place_of(index[0])
        batch, own = self.block(level, candidate // BLOCK)
        drawn = batch.scenarios(self.seed, own, self.frame_id)
        return [self.published(whole) for whole in (drawn[one - own[0]] for one in index) if whole is not None]

    def published(self, whole: Scenario) -> Scenario:
        """A candidate of all vehicles as it is published: with its facts, the ego's motion apart, as witness."""
        facts = self.label(whole)
        if self.proposal is not None and self.weighted:
            facts = {"weight": repr(self.weight(whole.index)), **facts}
        named = replace(whole, facts=facts) if facts else whole
        return named if self.ego is None else with_witness(named, self.ego)

    def weight(self, index: int) -> float:
        """The importance weight of the candidate with this index against natural ones; 1 where there is no proposal."""
        level, candidate = place_of(index)
        if self.proposal is None or level != DIRECTED:
            return 1.0
        number, row = divmod(candidate, BLOCK)
        return float(self.proposal.weights(self.numbers(level, number)[row : row + 1])[0])

    def numbers(self, level: int, number: int) -> Floats:
        """The numbers (BLOCK, size) of a block: standard normal ones, of a proposal moved by it."""
        if self.proposal is None or level < DIRECTED:
            return self._normal(level, number, self.model.size)
        z = self._normal(level, number, self.model.size + 1)
        return self.proposal.moved(z[:, :-1], z[:, -1])

    def _scale(self, level: int) -> Scale:
        return LEVELS[level if level < DIRECTED else self.base]

    def _normal(self, level: int, number: int, size: int) -> Floats:
        """Standard normal numbers (BLOCK, size), every other row the mirror image of the one before.

        The mean of a set is then the drive without deviations, to first order, however few samples the set has (antithetic
        variates, Hammersley and Morton 1956).
        """
        generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([self.seed, level, number])))
        z = exact.standard_normal(generator, (BLOCK // 2, size))
        return np.stack([z, -z], axis=1).reshape(BLOCK, -1)


def sample_scenarios(
    encounter: Encounter,
    segmentation: Segmentation,
    road: Road,
    routes: Sequence[Route],
    asked: BoundaryStates,
    check: Check,
    config: SamplingConfig = SamplingConfig(),
    *,
    count: int,
    seed: int = 0,
    waits: tuple[Wait, ...],
    request: Request = Request(),
    progress: Progress = lambda *_: None,
    cancelled: Cancelled = lambda: False,
    found: OnValid = lambda *_: None,
    measures: Measures | None = None,
) -> ScenarioSet:
    """Draw candidates until `count` are valid or the budget is spent.

    Source: paper III-C.

    Args:
        encounter: the template.
        segmentation: its changepoints.
        road: the target road, for the room it leaves.
        routes: one per vehicle, with an anchor at start, changepoints and end.
        asked: start and end states; their speeds are met exactly.
        check: the validity checker of all vehicles, the ego too; its verdicts decide.
        config: the standard deviations and limits.
        count: valid scenarios wanted.
        seed: of all randomness; with a scenario's index it gives that scenario again.
        waits: when a vehicle stands, on the template's clock.
        request: which vehicle is left out of every scenario, its own motion given as witness; whether states were asked for;
            which range, choice and order.
        progress: called with (valid so far, count, candidates so far).
        cancelled: asked before each candidate; if True, the set so far is returned.
        found: called with each valid scenario as it is drawn, in the set's order; of a chosen set, when it is chosen.
        measures: what measures a scenario for a target or a choice, see `Measures`; `check` knows the order asked.

    Returns:
        At most `count` scenarios; fewer if the budget did not suffice, which the account (`refused`) explains. Of more than KEPT
        only the indices are kept, so that memory hardly grows with their number.

    Raises:
        InputError: routes, segmentation and encounter disagree, or the ego is none of the vehicles.
        RefusedError: states or a target were asked for, and not one candidate that meets them is valid.
    """
    ego = request.ego_of(encounter)
    prepared = prepare(encounter, segmentation, road, routes, asked, waits, config)
    slot = None if ego is None else EgoSlot(encounter.vehicles[ego], asked.start[ego], asked.end[ego])
    if prepared.model is None:
        made = ScenarioSet(count, (), 1, Counter({Cause.SPEED_PROFILE: 1}), (prepared.refusal,), slot)
    else:
        aim = _aim(encounter, request, measures)
        sampler = Sampler(prepared.model, seed, road.frame_id, ego, label=_label(encounter, request, aim))
        loop = _Loop(sampler, check, count, progress, cancelled, lambda scenario: found(scenario, asked, slot))
        loop.aim, loop.measures = aim, measures
        loop.run_request(config.attempts, diverse=request.choose == "diverse")
        sentences = (*prepared.adaptations, *loop.adaptations)
        made = ScenarioSet(
            count, loop.scenarios(), loop.candidates, loop.refused, sentences, slot, loop.reached, loop.chosen_from
        )  # fmt: skip
    if request.moves and not made.scenarios and not cancelled():
        causes = ", ".join(f"{number} × {cause.value}" for cause, number in made.refused.most_common())
        more = f"; {'; '.join(made.adaptations)}" if made.adaptations else ""
        raise RefusedError(f"none of {made.candidates} candidate(s) with the asked states is valid ({causes}{more})")
    return made


def regenerate(
    encounter: Encounter,
    segmentation: Segmentation,
    road: Road,
    routes: Sequence[Route],
    asked: BoundaryStates,
    config: SamplingConfig = SamplingConfig(),
    *,
    seed: int,
    index: int,
    waits: tuple[Wait, ...],
    request: Request = Request(),
    check: Check | None = None,
    measures: Measures | None = None,
) -> Scenario | None:
    """The scenario with this seed and index again, bit for bit, without the others; arguments as in `sample_scenarios`.

    One of a proposal needs `check` and `measures`, by which that is found again.
    """
    prepared = prepare(encounter, segmentation, road, routes, asked, waits, config)
    if prepared.model is None:
        return None
    ego, aim = request.ego_of(encounter), _aim(encounter, request, measures)
    sampler = Sampler(prepared.model, seed, road.frame_id, ego, label=_label(encounter, request, aim))
    if place_of(index)[0] == DIRECTED:
        if aim is None or check is None:
            raise InputError(f"index {index} is of a proposal, but no target was asked for")
        sampler = _adapted(sampler, check, aim, lambda: False).sampler
    return sampler.scenario(index)


def _aim(encounter: Encounter, request: Request, measures: Measures | None) -> Aim | None:
    """What is aimed at: the targets, and for a swapped order the arrival gap of the other sign; None if nothing is.

    Raises:
        InputError: a target names a vehicle that does not exist, or nothing can be measured.
    """
    targets = request.targets
    if request.order == "swap":
        closest = closest_crossing(_conflicts(encounter))
        if closest is not None:
            names = tuple(encounter.vehicles[n].id for n in (closest.first, closest.second))
            targets = (Target("arrival_gap", -np.inf, 0.0, names), *targets)
    if not targets:
        return None
    if measures is None:
        raise InputError("a target or another order is asked for, but nothing is given that measures scenarios (`measures`)")
    return Aim.of(targets, encounter, measures.figure)


def _conflicts(encounter: Encounter) -> tuple[Conflict, ...]:
    return find_conflicts(encounter.vehicles, encounter.time, encounter.position, encounter.heading, encounter.present)


def _label(encounter: Encounter, request: Request, aim: Aim | None) -> Label:
    """Return what says a scenario's facts: the figures of the targets, and, unless it is kept, the order at each conflict."""
    conflicts = () if request.order == "keep" else _conflicts(encounter)

    def label(whole: Scenario) -> dict[str, str]:
        facts = {}
        if aim is not None:
            facts = {f"target.{t.label}": f"{v:.6g}" for t, v in zip(aim.targets, aim.values(whole), strict=True)}
        if request.order == "keep":
            return facts
        said = [_order(encounter, own, whole) for own in conflicts]
        return facts | {"order": request.order, "passing_order": "; ".join(said) or "nobody meets anybody"}

    return label


def _order(encounter: Encounter, own: Conflict, whole: Scenario) -> str:
    """Say who goes first in a scenario at one of the template's conflicts."""
    a, b = sorted((own.first, own.second))
    found = pair_conflict(whole.vehicles, whole.time, whole.position, whole.heading, a, b, whole.present)
    one, two = (encounter.vehicles[n].id for n in (own.first, own.second))
    if found is None:
        return f"{one} and {two} do not meet (in the template {one} goes first)"
    return f"{one} before {two}, as in the template" if found.first == own.first else f"{two} before {one}, swapped"


@dataclass(frozen=True, eq=False)
class _Adapted:
    """A sampler with its proposal, None where natural candidates do, and what was seen on the way."""

    sampler: Sampler
    seen: Seen
    stages: int
    candidates: int


def _adapted(sampler: Sampler, check: Check, aim: Aim, cancelled: Cancelled) -> _Adapted:
    """Find a proposal, stage by stage; the same request gives the same.

    The levels are judged by pilots as without a target, and the first that is good enough, or the best, is the natural one.
    """
    pilots, share = [], []
    for level in range(len(LEVELS)):
        pilots.append(Seen())
        share.append(_stage(sampler, level, 0, check, aim, pilots[-1], np.ones(len(aim.targets))))
        if share[-1] >= ENOUGH or cancelled():
            break
    best = int(np.argmax(share))
    seen = pilots[best]
    unit = seen.scale()
    candidates, hits = len(pilots) * STAGE, seen.hits()
    staged = replace(sampler, base=best)
    if hits >= PLAIN * STAGE:
        return _Adapted(staged, seen, 0, candidates)
    seen.rescale(aim, unit)
    most, since = hits, 0
    for stage in range(STAGES):
        proposal = seen.proposal()
        if proposal is None or cancelled():
            break
        _stage(replace(staged, proposal=proposal), STAGED, stage, check, aim, seen, unit)
        candidates += STAGE
        now = seen.hits() - hits
        hits, since = seen.hits(), 0 if now > most else since + 1
        most = max(most, now)
        if most >= GOOD * STAGE or (most >= FAIR * STAGE and since >= 1) or (most and since >= PATIENCE):
            break
    return _Adapted(replace(staged, proposal=seen.proposal() if seen.hits() else None), seen, len(seen.z) - 1, candidates)


def _stage(sampler: Sampler, level: int, stage: int, check: Check, aim: Aim, seen: Seen, unit: Floats) -> float:
    """Draw a stage's candidates, measure them, check those nearest to the range; return the share of the checked that is valid.

    Of a pilot all are checked.
    """
    blocks = range(stage * (STAGE // BLOCK), (stage + 1) * (STAGE // BLOCK))
    z = np.concatenate([sampler.numbers(level, number) for number in blocks])
    drawn: list[Scenario | None] = []
    for number in blocks:
        batch, index = sampler.block(level, number)
        drawn += batch.scenarios(sampler.seed, index, sampler.frame_id)
    seen.add(aim, z, sampler.proposal, drawn, unit)
    checked = good = 0
    nearest = [k for k in np.argsort(seen.distance[-1], kind="stable").tolist() if drawn[k] is not None]
    for start in range(0, len(nearest), CHUNK):
        rows = nearest[start : start + CHUNK]
        verdicts = check([scenario for k in rows if (scenario := drawn[k]) is not None])
        for k, verdict in zip(rows, verdicts, strict=True):
            checked, good = checked + 1, good + verdict.valid
            seen.judge(k, valid=verdict.valid)
        in_range = bool(seen.distance[-1][rows[-1]] == 0.0)
        if level >= DIRECTED and good >= CHUNK // 2 and not in_range:
            break
    return good / STAGE if level < DIRECTED else good / max(checked, 1)


@dataclass
class _Loop:
    """The account of one request."""

    sampler: Sampler
    check: Check
    count: int
    progress: Progress
    cancelled: Cancelled
    found: Callable[[Scenario], None]
    kept: list[Scenario] = field(default_factory=list)  # the first KEPT
    index: Any = field(default_factory=lambda: array("q"))  # of all that are valid
    refused: Counter[Cause] = field(default_factory=Counter)
    candidates: int = 0
    adaptations: list[str] = field(default_factory=list)
    aim: Aim | None = None
    measures: Measures | None = None
    reached: Reached | None = None
    chosen_from: int = 0
    keep: int = KEPT
    publish: bool = True

    def run_request(self, attempts: int, *, diverse: bool) -> None:
        """Sample what was asked: towards a target, and, if a choice is asked for, from a pool."""
        wanted = self.count
        if diverse:
            self.count, self.keep, self.publish = wanted * POOL_SHARE, 0, False
        if self.aim is None:
            self.run(attempts * self.count)
        else:
            self.run_directed(DIRECTED_BUDGET * attempts * self.count)
        if diverse:
            self.choose(wanted)

    def choose(self, wanted: int) -> None:
        """Keep those of the pool that cover best."""
        if self.measures is None:
            raise InputError("choose: nothing is given that measures scenarios (`measures`)")
        pool = list(self.index)
        features = [self.measures.features(whole) for whole in self._whole(pool)]
        chosen = spread_out(features, wanted)
        self.chosen_from, self.count, self.keep, self.publish = len(pool), wanted, KEPT, True
        self.index = array("q")
        self.adaptations.append(
            f"chosen for diversity: {len(chosen)} of {len(pool)} valid scenarios; such a set is no sample, so it has no weights"
        )
        self.sampler = replace(self.sampler, weighted=False)
        for k in sorted(chosen):
            scenario = self.sampler.scenario(pool[k])
            if scenario is not None and not self.cancelled():
                self._keep(pool[k], scenario)

    def _whole(self, index: Sequence[int]) -> Iterator[Scenario]:
        """Candidates of all vehicles, by ascending indices."""
        plain = replace(self.sampler, ego=None, label=lambda _: {}, weighted=False)
        for _, together in itertools.groupby(index, lambda one: one // BLOCK):
            yield from plain.redraw(list(together))

    def _keep(self, number: int, scenario: Scenario) -> None:
        self.index.append(number)
        if len(self.kept) < self.keep:
            self.kept.append(scenario)
        if self.publish:
            self.found(scenario)

    def run_directed(self, budget: int) -> None:
        """Find a proposal, then draw from it.

        Raises:
            TargetError: not one valid candidate in the range was found; the message says which range there is.
        """
        aim = self.aim
        assert aim is not None
        made = _adapted(self.sampler, self.check, aim, self.cancelled)
        self.sampler = made.sampler
        weights: list[float] = []
        if made.seen.hits() and not self.cancelled():
            level = self.sampler.base if made.sampler.proposal is None else DIRECTED
            blocks = self._blocks(level)
            while not self._done(budget) and (self.index or self.candidates < HOPELESS):
                before = len(self.index)
                if not self._spend(blocks, min(BLOCK, budget - self.candidates))[0]:
                    break
                weights += [self.sampler.weight(number) for number in self.index[before:]]
        share, low, high = estimated(np.array(weights), self.candidates)
        if self.candidates:
            directed = self.sampler.proposal is not None
            self.reached = Reached(aim.targets, made.stages, made.candidates, share, low, high, directed)
            self.adaptations.append(self.reached.sentence())
            if self.sampler.base:
                self._describe(self.sampler.base, 2)
        if len(self.index) < self.count and not self.cancelled():
            said = f"target {'; '.join(map(str, aim.targets))}: "
            drawn = f"{made.candidates} candidates of {1 + made.stages} stage(s) and {self.candidates} more"
            said += f"{len(self.index)} found in {drawn}; reachable: {reachable(aim, made.seen.values)}"
            if not self.index:
                raise TargetError(said)
            self.adaptations.append(said)

    def run(self, budget: int) -> None:
        """Judge the levels by their first candidates, then stay with the first that is good enough, or the best."""
        blocks = [self._blocks(level) for level in range(len(LEVELS))]
        share = []
        for level in range(len(LEVELS)):
            seen, good = self._spend(blocks[level], min(PILOT, budget - self.candidates))
            share.append(good / seen if seen else 0.0)
            if self._done(budget) or share[-1] >= ENOUGH:
                break
        best = int(np.argmax(share))
        while not self._done(budget) and self._spend(blocks[best], budget - self.candidates)[0]:
            pass
        self._describe(best, len(share))

    def scenarios(self) -> Sequence[Scenario]:
        """The valid candidates: themselves, or, where they are many, what draws them again."""
        if len(self.index) <= KEPT:
            return tuple(self.kept)
        return LazyScenarios(self.sampler.redraw, np.array(self.index, dtype=np.int64), BLOCK)

    def _done(self, budget: int) -> bool:
        return len(self.index) >= self.count or self.candidates >= budget or self.cancelled()

    def _blocks(self, level: int) -> Iterator[tuple[Batch, list[int]]]:
        for number in itertools.count():
            yield self.sampler.block(level, number)

    def _spend(self, blocks: Iterator[tuple[Batch, list[int]]], most: int) -> tuple[int, int]:
        """Check up to `most` candidates, whole blocks at a time; how many were seen, and how many of them were valid."""
        seen = good = 0
        while seen < most and len(self.index) < self.count and not self.cancelled():
            batch, index = next(blocks)
            drawn = batch.scenarios(self.sampler.seed, index, self.sampler.frame_id)
            aimed = [scenario is not None and self._in_range(scenario) for scenario in drawn]
            verdicts = iter(self.check([s for s, ok in zip(drawn, aimed, strict=True) if ok and s is not None]))
            for number, scenario, ok in zip(index, drawn, aimed, strict=True):
                if seen == most or len(self.index) == self.count or self.cancelled():
                    break
                seen += 1
                verdict = next(verdicts) if ok else None
                if scenario is not None and verdict is not None and verdict.valid:
                    good += 1
                    self._keep(number, self.sampler.published(scenario) if self.publish else scenario)
                elif verdict is not None:
                    self.refused[verdict.violations[0].cause] += 1
                else:
                    self.refused[Cause.SPEED_PROFILE if scenario is None else Cause.OUT_OF_RANGE] += 1
            self.progress(len(self.index), self.count, self.candidates + seen)
        self.candidates += seen
        return seen, good

    def _in_range(self, scenario: Scenario) -> bool:
        return self.aim is None or self.aim.holds(self.aim.values(scenario))

    def _describe(self, best: int, tried: int) -> None:
        """Put what was adapted into sentences."""
        if tried > 1 and best == 0:
            self.adaptations.append("few candidates were valid, and smaller standard deviations did not help")
        elif tried > 1:
            s = LEVELS[best]
            self.adaptations.append(
                f"few candidates were valid: standard deviations multiplied by {s.lateral:g} across the route, "
                f"{s.longitudinal:g} along it, {s.time:g} in time"
            )
        if self.cancelled():
            self.adaptations.append("cancelled")
