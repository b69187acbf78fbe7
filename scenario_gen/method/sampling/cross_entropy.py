# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The proposal towards a target, found stage by stage by the cross-entropy method.

Source: the cross-entropy method (Rubinstein & Kroese 2004), with the samples of all stages
weighted together (adaptive multiple importance sampling, Cornuet et al. 2012).
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scenario_gen.method.sampling.filters import Candidate, ValidityFilter
from scenario_gen.method.sampling.plan import Cancelled
from scenario_gen.method.sampling.sampler import (
    BLOCK_CANDIDATES,
    directions,
    LEVELS,
    Proposal,
    Sampler,
    STAGE_SLOT,
    TargetSet,
)
from scenario_gen.numerics import Bools, Floats
from scenario_gen.types import Cause, Scenario, UNITS

STAGE_CANDIDATES = 64
STAGE_BLOCKS_COUNT = STAGE_CANDIDATES // BLOCK_CANDIDATES


@dataclass(frozen=True)
class _Search:
    """When the search ends, and how a proposal is made; tuned on benchmarks (docs/variety.md).

    Attributes:
        natural_share: of natural candidates that are hits, from which no proposal is needed.
        good_share: of a proposal's candidates that are hits, from which it is good enough.
        fair_share: with this share, one stage without a better one ends the search.
        patience: stages without a better one that end the search, with fewer hits.
        stages: at most.
        elite: candidates from which a proposal is made, at least.
        chunk: candidates that are checked together, the nearest to the range first.
        pool: latest candidates for the regression.
        invalid_distance: added to the distance of candidates that are not known to be valid.
        widening: the proposal's standard deviations over the elite's.
        sigma: least and greatest standard deviation.
        min_unit: least unit of a distance [s, m or m/s].
    """

    natural_share: float = 0.35
    good_share: float = 0.4
    fair_share: float = 0.1
    patience: int = 4
    stages: int = 10
    elite: int = 16
    chunk: int = 16
    pool: int = 256
    invalid_distance: float = 1.0
    widening: float = 1.25
    sigma: tuple[float, float] = (0.3, 1.5)
    min_unit: float = 0.05


_SEARCH = _Search()


@dataclass(eq=False)
class Stage:
    """The candidates of one stage.

    Attributes:
        z: (S, d) standard normal numbers.
        proposal: from which they were drawn, None for the natural distribution.
        figures: (S, k) of the targets; NaN without a speed profile.
        guides: (S, g) what the regression explains.
        distance: (S,) from the range; 0 for a hit.
        valid: (S,) whether a candidate was checked and is valid.
    """

    z: Floats
    proposal: Proposal | None
    figures: Floats
    guides: Floats
    distance: Floats
    valid: Bools

    @classmethod
    def of(
        cls,
        target: TargetSet,
        z: Floats,
        proposal: Proposal | None,
        drawn: Sequence[Scenario | None],
    ) -> "Stage":
        """Measure a stage's candidates; none of them is checked yet."""
        count = len(z)
        figures = np.full((count, len(target.targets)), np.nan)
        guides = np.full((count, target.guide_count), np.nan)
        for k, scenario in enumerate(drawn):
            if scenario is not None:
                values = target.values(scenario)
                figures[k], guides[k] = values, target.guides(scenario, values)
        return cls(z, proposal, figures, guides, np.zeros(count), np.zeros(count, dtype=np.bool_))

    def measure(self, target: TargetSet, unit: Floats) -> None:
        """Compute the distances in units (k,) [s, m or m/s] of the targets."""
        units = unit.tolist()
        for k, (figures, guides) in enumerate(
            zip(self.figures.tolist(), self.guides.tolist(), strict=True)
        ):
            hit = self.valid[k] and target.holds(figures)
            self.distance[k] = 0.0 if hit else target.distance(figures, guides, units)

    @property
    def hits(self) -> int:
        """Number of candidates that are valid and in the range."""
        return int((self.valid & (self.distance == 0.0)).sum())


@dataclass(eq=False)
class Evaluations:
    """All candidates of all stages.

    Attributes:
        target: the targets.
        stages: in order.
        refused: number of checked candidates by the cause of their refusal.
        checked: number of checked candidates.
    """

    target: TargetSet
    stages: list[Stage] = field(default_factory=list)
    refused: Counter[Cause] = field(default_factory=Counter)
    checked: int = 0

    @property
    def hits(self) -> int:
        """Number of candidates that are valid and in the range."""
        return sum(stage.hits for stage in self.stages)

    def record(self, k: int, cause: Cause | None) -> None:
        """Record the verdict on candidate k of the last stage."""
        stage = self.stages[-1]
        self.checked += 1
        stage.valid[k] = cause is None
        if cause is not None:
            self.refused[cause] += 1
        elif self.target.holds(stage.figures[k].tolist()):
            stage.distance[k] = 0.0  # though the search aims beyond

    def spread(self) -> Floats:
        """Return half of the middle two thirds (k,) of the natural candidates' figures."""
        spreads = []
        for values in self.stages[0].figures.T:
            known = np.sort(values[np.isfinite(values)])
            spread = 1.0
            if len(known) > 2:
                spread = 0.5 * float(known[int(0.83 * len(known))] - known[int(0.17 * len(known))])
            spreads.append(spread)
        return np.asarray(np.maximum(np.array(spreads), _SEARCH.min_unit))

    def proposal(self) -> Proposal | None:
        """Return the next proposal; None if nothing can be learned."""
        z = np.concatenate([stage.z for stage in self.stages])
        guides = np.concatenate([stage.guides for stage in self.stages])
        distance = np.concatenate([stage.distance for stage in self.stages])
        valid = np.concatenate([stage.valid for stage in self.stages])

        order = np.argsort(
            distance + np.where(valid, 0.0, _SEARCH.invalid_distance), kind="stable"
        )
        elite = order[np.isfinite(distance[order])][: max(_SEARCH.elite, self.hits)]
        basis = directions(z[-_SEARCH.pool :], guides[-_SEARCH.pool :])
        if len(elite) < 2 or not len(basis):
            return None
        mixture = np.zeros(len(elite))
        for stage in self.stages:
            ratio = 1.0 if stage.proposal is None else stage.proposal.density_ratio(z[elite])
            mixture += len(stage.z) / len(z) * ratio
        weight = 1.0 / mixture
        weight /= weight.sum()
        u = z[elite] @ basis.T
        mean = weight @ u
        sigma = _SEARCH.widening * np.sqrt(weight @ np.square(u - mean))
        return Proposal(basis, mean, np.clip(sigma, *_SEARCH.sigma))

    def reachable(self) -> str:
        """Return the range of each target among the valid candidates, or else among all."""
        figures = np.concatenate([stage.figures for stage in self.stages])
        valid = np.concatenate([stage.valid for stage in self.stages])
        messages = []
        for target, values in zip(self.target.targets, figures.T, strict=True):
            unit, finite = UNITS[target.name], np.isfinite(values)
            known, others = np.sort(values[finite & valid]), values[finite]
            message = f"{target.label}: no valid candidate has this figure, nor any other"
            if len(known):
                low, high = (
                    known[int(0.05 * (len(known) - 1))],
                    known[int(0.95 * (len(known) - 1))],
                )
                message = (
                    f"{target.label} from {low:.2f} to {high:.2f} {unit} "
                    f"(5 % to 95 % of {len(known)} valid candidates; "
                    f"all: {known[0]:.2f} to {known[-1]:.2f} {unit})"
                )
            elif len(others):
                message = (
                    f"{target.label}: no valid candidate has this figure, of {len(others)} others "
                    f"it is {others.min():.2f} to {others.max():.2f} {unit}"
                )
            messages.append(message)
        text = "; ".join(messages)
        if self.refused:
            causes = (f"{number} × {cause.value}" for cause, number in self.refused.most_common(3))
            text += f"; {self.checked} were checked; refused: {', '.join(causes)}"
        return text + self.target.note


@dataclass(frozen=True, eq=False)
class ProposalSearch:
    """The outcome of a search for a proposal.

    Attributes:
        sampler: with its proposal; None if natural candidates hit often enough.
        evaluations: of all candidates.
        candidates: number of candidates drawn.
        pilot: the natural candidates with their verdicts, if they hit often enough.
    """

    sampler: Sampler
    evaluations: Evaluations
    candidates: int
    pilot: Sequence[Candidate] = ()

    @property
    def stages(self) -> int:
        """Number of stages after the pilot."""
        return len(self.evaluations.stages) - 1


def find_proposal(
    sampler: Sampler, validity: ValidityFilter, target: TargetSet, cancelled: Cancelled
) -> ProposalSearch:
    """Search for a proposal, stage by stage; the same request gives the same one.

    Pilots judge the levels as without a target; the first one with enough valid candidates, or the
    best, is the natural one.
    """
    pilots, shares = [], []
    for level in range(len(LEVELS)):
        evaluations = Evaluations(target)
        pilots.append((evaluations, _pilot(sampler, level, validity, evaluations)))
        shares.append(sum(stage.valid.sum() for stage in evaluations.stages) / STAGE_CANDIDATES)
        if shares[-1] >= validity.enough or cancelled():
            break
    base = int(np.argmax(shares))
    evaluations, pilot = pilots[base]
    candidates = len(pilots) * STAGE_CANDIDATES
    sampler = replace(sampler, base=base)
    if evaluations.hits >= _SEARCH.natural_share * STAGE_CANDIDATES:
        return ProposalSearch(sampler, evaluations, candidates, pilot)

    unit = evaluations.spread()
    evaluations.stages[0].measure(target, unit)
    best, since_best = evaluations.hits, 0
    while len(evaluations.stages) <= _SEARCH.stages and not _is_settled(best, since_best):
        proposal = evaluations.proposal()
        if proposal is None or cancelled():
            break
        _directed_stage(replace(sampler, proposal=proposal), validity, evaluations, unit)
        hits = evaluations.stages[-1].hits
        since_best = 0 if hits > best else since_best + 1
        best = max(best, hits)
    candidates += (len(evaluations.stages) - 1) * STAGE_CANDIDATES
    proposal = evaluations.proposal() if evaluations.hits else None
    return ProposalSearch(replace(sampler, proposal=proposal), evaluations, candidates)


def _is_settled(best: int, since_best: int) -> bool:
    """Return whether a search with this many hits in its best stage is likely to find no more."""
    if best >= _SEARCH.good_share * STAGE_CANDIDATES:
        return True
    if best >= _SEARCH.fair_share * STAGE_CANDIDATES and since_best >= 1:
        return True
    return best > 0 and since_best >= _SEARCH.patience


def _draw_stage(
    sampler: Sampler, level: int, first: int, evaluations: Evaluations, unit: Floats
) -> tuple[list[int], list[Scenario | None], list[int]]:
    """Draw and measure a stage; return indices, scenarios, and rows, the nearest first."""
    numbers = range(first, first + STAGE_BLOCKS_COUNT)
    blocks = [sampler.block(level, number) for number in numbers]
    index = [each for block in blocks for each in block.indices]
    drawn = [each for block in blocks for each in block.scenarios]
    z = np.concatenate([sampler.numbers(level, number) for number in numbers])
    stage = Stage.of(evaluations.target, z, sampler.proposal, drawn)
    stage.measure(evaluations.target, unit)
    evaluations.stages.append(stage)
    order = np.argsort(stage.distance, kind="stable").tolist()
    return index, drawn, [k for k in order if drawn[k] is not None]


def _pilot(
    sampler: Sampler, level: int, validity: ValidityFilter, evaluations: Evaluations
) -> list[Candidate]:
    """Draw a natural stage, check all of it, and return its candidates."""
    unit = np.ones(len(evaluations.target.targets))
    index, drawn, nearest = _draw_stage(sampler, level, 0, evaluations, unit)
    causes: dict[int, Cause | None] = {}
    for k, cause in zip(nearest, validity(_present(drawn, nearest)), strict=True):
        evaluations.record(k, cause)
        causes[k] = cause
    return [
        Candidate(index[k], scenario, causes.get(k, Cause.SPEED_PROFILE))
        for k, scenario in enumerate(drawn)
    ]


def _directed_stage(
    sampler: Sampler, validity: ValidityFilter, evaluations: Evaluations, unit: Floats
) -> None:
    """Draw a proposal's stage, and check its candidates, the nearest to the range first."""
    first = (len(evaluations.stages) - 1) * STAGE_BLOCKS_COUNT
    _, drawn, nearest = _draw_stage(sampler, STAGE_SLOT, first, evaluations, unit)
    distance, valid = evaluations.stages[-1].distance, 0
    for start in range(0, len(nearest), _SEARCH.chunk):
        rows = nearest[start : start + _SEARCH.chunk]
        for k, cause in zip(rows, validity(_present(drawn, rows)), strict=True):
            evaluations.record(k, cause)
            valid += cause is None
        if valid >= _SEARCH.chunk // 2 and distance[rows[-1]] > 0.0:
            break


def _present(drawn: Sequence[Scenario | None], rows: Sequence[int]) -> list[Scenario]:
    """Return the scenarios of some rows that have one."""
    return [scenario for k in rows if (scenario := drawn[k]) is not None]
