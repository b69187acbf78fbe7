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
from dataclasses import dataclass, field
import itertools
from typing import Any

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.errors import InputError, RefusedError
from scenario_gen.sampling.candidates import Batch, CandidateModel, Scale
from scenario_gen.sampling.config import SamplingConfig
from scenario_gen.sampling.lazy import LazyScenarios
from scenario_gen.sampling.prepare import prepare
from scenario_gen.template.interaction import Wait
from scenario_gen.types.ego import with_witness
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.request import Request
from scenario_gen.types.road import Road
from scenario_gen.types.route import Route
from scenario_gen.types.scenario import BoundaryStates, Cause, EgoSlot, Scenario, ScenarioSet, Verdict
from scenario_gen.types.segmentation import Segmentation

Check = Callable[[Sequence[Scenario]], list[Verdict]]
Progress = Callable[[int, int, int], None]  # of scenarios so far, scenarios wanted, candidates so far
Cancelled = Callable[[], bool]
OnValid = Callable[[Scenario, BoundaryStates, EgoSlot | None], None]  # a valid one, the states asked, what the ego is asked

LEVELS = (
    Scale(),
    Scale(lateral=0.5, own=0.5),
    Scale(lateral=0.5, longitudinal=0.5, own=0.25),
    Scale(lateral=0.25, longitudinal=0.25, time=0.5, own=0.1),
    Scale(lateral=0.1, longitudinal=0.1, time=0.25, own=0.03),
)
LEVEL_SIZE = 1 << 20  # candidates of one level whose indices follow each other
LEVEL_SLOTS = 8  # levels that an index has room for; after them come the next LEVEL_SIZE candidates of the first
KEPT = 1000  # scenarios up to which a set stays in memory
BLOCK = 32  # candidates whose random numbers are drawn together
LEAST_COUNT = (
    20  # preset `wide`: candidates as for so many scenarios are drawn, however few are wanted, so that levels can be tried
)
PILOT = 2 * BLOCK  # candidates by which a level is judged
ENOUGH = {"narrow": 0.3, "wide": 0.1}  # share of valid candidates below which the next level is tried


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
    if index < 0 or level >= len(LEVELS):
        raise InputError(f"no candidate has the index {index}; take one of `scenarios/info`")
    return level, page * LEVEL_SIZE + within


@dataclass(frozen=True, eq=False)
class Sampler:
    """Draws candidates by their index: the same seed and index give the same candidate, whatever was drawn before."""

    model: CandidateModel
    seed: int
    frame_id: str
    ego: int | None = None  # of the vehicle that is left out of what is published, and is its witness

    def block(self, level: int, number: int) -> tuple[Batch, list[int]]:
        """Candidates number·BLOCK … of a level, and their indices."""
        first = index_of(level, number * BLOCK)
        return self.model.draw(self._normal(level, number), LEVELS[level]), list(range(first, first + BLOCK))

    def scenario(self, index: int) -> Scenario | None:
        """The candidate with this index, bit for bit as in a whole set; None if it has no speed profile."""
        level, candidate = place_of(index)
        number, row = divmod(candidate, BLOCK)
        batch = self.model.draw(self._normal(level, number)[row : row + 1], LEVELS[level])
        (whole,) = batch.scenarios(self.seed, [index], self.frame_id)
        return None if whole is None else self.published(whole)

    @property
    def free(self) -> bool:
        """Whether vehicles have clocks of their own."""
        return any(vehicle.freedom is not None for vehicle in self.model.vehicles)

    def undisturbed(self) -> Scenario | None:
        """The drive without deviations; None where nothing is free, or it has no speed profile."""
        if not self.free:
            return None
        return self.model.draw(np.zeros((1, self.model.size)), LEVELS[0]).scenarios(self.seed, [0], self.frame_id)[0]

    def redraw(self, index: Sequence[int]) -> list[Scenario]:
        """The scenarios of indices that are of one block, bit for bit as in a whole set."""
        level, candidate = place_of(index[0])
        batch, own = self.block(level, candidate // BLOCK)
        drawn = batch.scenarios(self.seed, own, self.frame_id)
        return [self.published(whole) for whole in (drawn[one - own[0]] for one in index) if whole is not None]

    def published(self, whole: Scenario) -> Scenario:
        """A candidate of all vehicles as it is published: the ego's motion apart, as witness."""
        return whole if self.ego is None else with_witness(whole, self.ego)

    def _normal(self, level: int, number: int) -> Floats:
        """Standard normal numbers (BLOCK, size), every other row the mirror image of the one before.

        The mean of a set is then the drive without deviations, to first order, however few samples the set has (antithetic
        variates, Hammersley and Morton 1956).
        """
        generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([self.seed, level, number])))
        z = exact.standard_normal(generator, (BLOCK // 2, self.model.size))
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
        request: which vehicle is left out of every scenario, its own motion given as witness; whether states were asked for.
        progress: called with (valid so far, count, candidates so far).
        cancelled: asked before each candidate; if True, the set so far is returned.
        found: called with each valid scenario as it is drawn, in the set's order.

    Returns:
        At most `count` scenarios; fewer if the budget did not suffice, which the account (`refused`) explains. Of more than KEPT
        only the indices are kept, so that memory hardly grows with their number.

    Raises:
        InputError: routes, segmentation and encounter disagree, or the ego is none of the vehicles.
        RefusedError: states were asked for, and not one candidate that meets them is valid.
    """
    ego = request.ego_of(encounter)
    prepared = prepare(encounter, segmentation, road, routes, asked, waits, config)
    slot = None if ego is None else EgoSlot(encounter.vehicles[ego], asked.start[ego], asked.end[ego])
    if prepared.model is None:
        made = ScenarioSet(count, (), 1, Counter({Cause.SPEED_PROFILE: 1}), (prepared.refusal,), slot)
    else:
        sampler = Sampler(prepared.model, seed, road.frame_id, ego)
        loop = _Loop(sampler, check, count, progress, cancelled, lambda scenario: found(scenario, asked, slot))
        loop.enough = ENOUGH[config.variety]
        loop.run(config.attempts * max(count, LEAST_COUNT if config.variety == "wide" else 1))
        sentences = (*prepared.adaptations, *loop.adaptations)
        made = ScenarioSet(count, loop.scenarios(), loop.candidates, loop.refused, sentences, slot)
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
) -> Scenario | None:
    """The scenario with this seed and index again, bit for bit, without the others; arguments as in `sample_scenarios`."""
    prepared = prepare(encounter, segmentation, road, routes, asked, waits, config)
    if prepared.model is None:
        return None
    return Sampler(prepared.model, seed, road.frame_id, request.ego_of(encounter)).scenario(index)


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
    enough: float = ENOUGH["narrow"]
    absent: int = 0  # conflicts of the template that the road or the clock of all leaves out; no candidate may lose more

    def run(self, budget: int) -> None:
        """Judge the levels by their first candidates, then stay with the first that is good enough, or the best."""
        undisturbed = self.sampler.undisturbed()
        if undisturbed is not None:
            self.absent = self.check([undisturbed])[0].not_applicable
        blocks = [self._blocks(level) for level in range(len(LEVELS))]
        share = []
        for level in range(len(LEVELS)):
            seen, good = self._spend(blocks[level], min(PILOT, budget - self.candidates))
            share.append(good / seen if seen else 0.0)
            if self._done(budget) or share[-1] >= self.enough:
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
            verdicts = iter(self.check([s for s in drawn if s is not None]))
            for number, scenario in zip(index, drawn, strict=True):
                if seen == most or len(self.index) == self.count or self.cancelled():
                    break
                seen += 1
                verdict = None if scenario is None else next(verdicts)
                lost = verdict is not None and verdict.valid and verdict.not_applicable > self.absent
                if scenario is not None and verdict is not None and verdict.valid and not lost:
                    good += 1
                    published = self.sampler.published(scenario)
                    self.index.append(number)
                    if len(self.kept) < KEPT:
                        self.kept.append(published)
                    self.found(published)
                else:
                    self.refused[_cause(verdict)] += 1
            self.progress(len(self.index), self.count, self.candidates + seen)
        self.candidates += seen
        return seen, good

    def _describe(self, best: int, tried: int) -> None:
        """Put what was adapted into sentences."""
        if tried > 1 and best == 0:
            self.adaptations.append("few candidates were valid, and smaller standard deviations did not help")
        elif tried > 1:
            s = LEVELS[best]
            own = f", {s.own:g} of each vehicle's own clock" if self.sampler.free else ""
            self.adaptations.append(
                f"few candidates were valid: standard deviations multiplied by {s.lateral:g} across the route, "
                f"{s.longitudinal:g} along it, {s.time:g} in time{own}"
            )
        if self.cancelled():
            self.adaptations.append("cancelled")


def _cause(verdict: Verdict | None) -> Cause:
    """Why a candidate is refused; without a verdict it has no speed."""
    if verdict is None:
        return Cause.SPEED_PROFILE
    return verdict.violations[0].cause if verdict.violations else Cause.CONFLICT_LOST
