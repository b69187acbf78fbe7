# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a request aims at, and the proposal that gets there, found stage by stage."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.method.sampling.directed import (
    Aim,
    CHUNK,
    FAIR,
    GOOD,
    PATIENCE,
    PLAIN,
    Seen,
    STAGE,
    STAGES,
)
from scenario_gen.method.sampling.plan import Cancelled
from scenario_gen.method.sampling.sampler import BLOCK, DIRECTED, Label, LEVELS, Sampler, STAGED
from scenario_gen.numerics import Floats
from scenario_gen.situation import closest_crossing, Conflict, conflict_of, Situation
from scenario_gen.types import (
    Cause,
    Facts,
    Measures,
    OrderChange,
    PassingOrder,
    Reaction,
    Request,
    Scenario,
    Target,
    token,
    Verdict,
)

Check = Callable[[Sequence[Scenario]], list[Verdict]]

ANY = 1 << 30  # conflicts: with one clock for all a road alone says which there are
MOST_BEYOND = 3.0  # s
STARTS_INSIDE = (
    0.5  # s; who is in the shared area so soon has no way on which the other one could come first
)
Judged = tuple[
    int, Scenario | None, Cause | None
]  # an index, the candidate if it has a speed profile, why it is refused


@dataclass(frozen=True)
class Judge:
    """Says why a candidate is refused.

    Attributes:
        check: the validity checker.
        absent: conflicts of the template that candidates may leave out, where clocks are free: as many as the undisturbed drive
            does, or, where that leaves some out, as the best quarter of the first candidates.
        enough: share of valid candidates from which on a level of standard deviations is good enough.
        lost: reactions of the template, by their vehicles, that the undisturbed drive does not keep on this road, nor those of
            these candidates that leave out no more, with what is said of each; no candidate is refused for them.
    """

    check: Check
    absent: int
    enough: float
    lost: Mapping[tuple[int, ...], str] = field(default_factory=dict)

    @classmethod
    def of(cls, sampler: Sampler, check: Check, enough: float) -> "Judge":
        """Look what the drive without deviations loses."""
        undisturbed = sampler.undisturbed()
        if undisturbed is None:
            return cls(check, ANY, enough)
        (verdict,) = check([undisturbed])
        lost, absent = _reactions_lost(verdict), verdict.not_applicable
        if not sampler.free:
            return cls(check, ANY, enough, lost)
        first = [one for one in sampler.block(0, 0)[1] if one is not None] if absent else []
        if first:
            verdicts = sorted(check(first), key=lambda own: own.not_applicable)
            absent = min(absent, verdicts[len(verdicts) // 4].not_applicable)
            keep = [_reactions_lost(own) for own in verdicts if own.not_applicable <= absent]
            lost = {
                pair: message for pair, message in lost.items() if all(pair in own for own in keep)
            }
        return cls(check, absent, enough, lost)

    def __call__(self, scenarios: Sequence[Scenario]) -> list[Cause | None]:
        """Return the first cause for which each scenario is refused, None for a valid one."""
        return [self._cause(verdict) for verdict in self.check(scenarios)]

    def _cause(self, verdict: Verdict) -> Cause | None:
        for violation in verdict.violations:
            if violation.cause != Cause.REACTION or violation.vehicles not in self.lost:
                return violation.cause
        return Cause.CONFLICT_LOST if verdict.not_applicable > self.absent else None


def _reactions_lost(verdict: Verdict) -> dict[tuple[int, ...], str]:
    """Return the reactions that a drive does not keep, by their vehicles, and what is said of each."""
    return {own.vehicles: own.message for own in verdict.violations if own.cause == Cause.REACTION}


def aim_of(situation: Situation, request: Request, measures: Measures | None) -> Aim | None:
    """What is aimed at: the targets, and for a swapped order the arrival gap of the other sign; None if nothing is.

    Raises:
        InputError: a target names a vehicle that does not exist, or nothing can be measured.
    """
    encounter = situation.encounter
    targets, beyond, note = request.targets, 0.0, ""
    if request.order == "swap":
        closest = closest_crossing(situation.conflicts)
        if closest is not None:
            names = tuple(encounter.vehicles[n].id for n in (closest.first, closest.second))
            targets = (Target("arrival_gap", -np.inf, 0.0, names), *targets)
            beyond = min(
                closest.exit_first - closest.entry_first, MOST_BEYOND
            )  # it must have left by then
            if closest.entry_first <= STARTS_INSIDE:
                note = f"; in the recording vehicle {names[0]} is in the shared area {closest.entry_first:.1f} s after the start"
    if not targets:
        return None
    if measures is None:
        raise InputError(
            "a target or another order is requested, but nothing is given that measures scenarios (`measures`)"
        )
    return Aim.of(targets, encounter, measures.figure, beyond, note)


def label_of(
    situation: Situation,
    request: Request,
    aim: Aim | None,
    measures: Measures | None,
    reactions: Sequence[Reaction] = (),
    lost: Iterable[tuple[int, ...]] = (),
) -> Label:
    """Return what gives the facts of a scenario: nearness, figures of targets, kept reactions, passing orders.

    `lost` are the pairs (who, whom) whose reaction, or whose least gap, scenarios are not held to on this road.
    """
    names = [token(vehicle.id) for vehicle in situation.encounter.vehicles]
    kept = tuple(edge.named(names) for edge in reactions)
    lost_names = tuple((names[pair[0]], names[pair[1]]) for pair in lost)
    conflicts = () if request.order == "keep" else situation.conflicts

    def label(whole: Scenario) -> Facts:
        targets = {}
        if aim is not None:
            labels = [target.label for target in aim.targets]
            targets = dict(zip(labels, map(float, aim.values(whole)), strict=True))
        return replace(
            Facts() if measures is None else measures.facts(whole),
            targets=targets,
            order=request.order,
            passing_order=tuple(_passing_order(names, own, whole) for own in conflicts),
            reactions=kept,
            lost_reactions=lost_names,
        )

    return label


def _passing_order(names: Sequence[str], recorded: Conflict, whole: Scenario) -> PassingOrder:
    """Return who passes one of the template's conflicts first in a scenario."""
    conflict = conflict_of(whole, *sorted((recorded.first, recorded.second)))
    change = OrderChange.NONE
    if conflict is None:
        change = OrderChange.NO_CONFLICT
    elif conflict.first != recorded.first:
        change = OrderChange.SWAPPED
    return PassingOrder(names[recorded.first], names[recorded.second], change)


@dataclass(frozen=True, eq=False)
class Adapted:
    """A sampler with its proposal, None where natural candidates do, and what was seen on the way."""

    sampler: Sampler
    seen: Seen
    stages: int
    candidates: int
    pilot: Sequence[Judged] = ()


def adapted(sampler: Sampler, judge: Judge, aim: Aim, cancelled: Cancelled) -> Adapted:
    """Find a proposal, stage by stage; the same request gives the same.

    The levels are judged by pilots as without a target, and the first that is good enough, or the best, is the natural one.
    """
    pilots: list[Seen] = []
    share: list[float] = []
    judged: list[list[Judged]] = []
    for level in range(len(LEVELS)):
        pilots.append(Seen())
        judged.append([])
        share.append(
            _stage(
                sampler, level, 0, judge, aim, pilots[-1], np.ones(len(aim.targets)), judged[-1]
            )
        )
        if share[-1] >= judge.enough or cancelled():
            break
    best = int(np.argmax(share))
    seen = pilots[best]
    unit = seen.scale()
    candidates, hits = len(pilots) * STAGE, seen.hits()
    staged = replace(sampler, base=best)
    if hits >= PLAIN * STAGE:
        return Adapted(staged, seen, 0, candidates, judged[best])
    seen.rescale(aim, unit)
    most, since = hits, 0
    for stage in range(STAGES):
        proposal = seen.proposal()
        if proposal is None or cancelled():
            break
        _stage(replace(staged, proposal=proposal), STAGED, stage, judge, aim, seen, unit)
        candidates += STAGE
        now = seen.hits() - hits
        hits, since = seen.hits(), 0 if now > most else since + 1
        most = max(most, now)
        if (
            most >= GOOD * STAGE
            or (most >= FAIR * STAGE and since >= 1)
            or (most and since >= PATIENCE)
        ):
            break
    return Adapted(
        replace(staged, proposal=seen.proposal() if seen.hits() else None),
        seen,
        len(seen.z) - 1,
        candidates,
    )


def _stage(
    sampler: Sampler,
    level: int,
    stage: int,
    judge: Judge,
    aim: Aim,
    seen: Seen,
    unit: Floats,
    judged: list[Judged] | None = None,
) -> float:
    """Draw a stage's candidates, measure them, check those nearest to the range; return the share of the checked that is valid.

    Of a pilot all are checked.
    """
    blocks = range(stage * (STAGE // BLOCK), (stage + 1) * (STAGE // BLOCK))
    z = np.concatenate([sampler.numbers(level, number) for number in blocks])
    drawn: list[Scenario | None] = []
    numbers: list[int] = []
    causes: dict[int, Cause | None] = {}
    for number in blocks:
        index, scenarios = sampler.block(level, number)
        numbers += index
        drawn += scenarios
    seen.add(aim, z, sampler.proposal, drawn, unit)
    checked = good = 0
    nearest = [
        k for k in np.argsort(seen.distance[-1], kind="stable").tolist() if drawn[k] is not None
    ]
    for start in range(0, len(nearest), CHUNK):
        rows = nearest[start : start + CHUNK]
        verdicts = judge([scenario for k in rows if (scenario := drawn[k]) is not None])
        causes |= dict(zip(rows, verdicts, strict=True))
        for k, cause in zip(rows, verdicts, strict=True):
            checked, good = checked + 1, good + (cause is None)
            seen.judge(aim, k, cause)
        in_range = bool(seen.distance[-1][rows[-1]] == 0.0)
        if level >= DIRECTED and good >= CHUNK // 2 and not in_range:
            break
    if judged is not None:
        judged += [(number, drawn[k], causes.get(k)) for k, number in enumerate(numbers)]
    return good / STAGE if level < DIRECTED else good / max(checked, 1)
