# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Check and measure the scenarios of any bag with the conventions of this suite.

A scenario is checked against the messages with its stamp in its namespace: the requested states
and their tolerances (its entry on `scenarios/info`); the conflicts of its template (`tracks`) in
the requested order; the waits of its template (if there are `changepoints`); and the road. The
road is the `map` that its entry names by hash, otherwise the newest map with its stamp, or the
newest of all. Checks without data are skipped and reported. Vehicles are matched by id: if some
are missing, the template is reduced to the others. With a reference drive of the ego, all vehicles
are checked together. If the bag has entries, no scenario may replace a published one; scenarios
without an entry are counted, and checked as far as possible.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np

from scenario_gen.bags.recordings.read import (
    INFO,
    Namespace,
    NO_ENTRY,
    read_recording,
    ScenarioEntry,
    SCENARIOS,
    WITNESS,
)
from scenario_gen.bags.storage.bag import naming_bag
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import replaced_folder
from scenario_gen.method.evaluation import coverage_of, evaluate
from scenario_gen.method.validity import Checker, Limits
from scenario_gen.output.results import EVALUATED, write_evaluation
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.situation import red_runners, required_orders, Situation
from scenario_gen.types import (
    at_ends,
    Cause,
    EgoSlot,
    Encounter,
    Facts,
    GenerationResult,
    join_ego,
    NamedReaction,
    Note,
    NoteKind,
    Reaction,
    Scenario,
    ScenarioSet,
    Segmentation,
    tokens,
    Verdict,
    Violation,
)


@dataclass(frozen=True, eq=False)
class BagEvaluation:
    """The scenarios of one namespace, checked and measured.

    Attributes:
        namespace: its name.
        verdicts: one per scenario.
        notes: on incomplete requests, scenarios without an entry, and checks that were skipped;
            without a result, the last one has the reason.
        result: the readable scenarios with their measures; None if they cannot be measured.
    """

    namespace: str
    verdicts: tuple[Verdict, ...]
    notes: tuple[Note, ...]
    result: GenerationResult | None

    @property
    def valid(self) -> int:
        """Number of valid scenarios."""
        return sum(verdict.valid for verdict in self.verdicts)

    @property
    def causes(self) -> dict[Cause, dict[int, str]]:
        """The first violation of each cause by scenario."""
        causes: dict[Cause, dict[int, str]] = {}
        for k, verdict in enumerate(self.verdicts):
            for violation in verdict.violations:
                causes.setdefault(violation.cause, {}).setdefault(k, violation.message)
        return causes


def evaluate_bag(
    path: Path,
    config: PipelineConfig = PipelineConfig(),
    *,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> tuple[BagEvaluation, ...]:
    """Check the scenarios in every namespace of a bag, and measure them if it has `tracks`.

    Args:
        path: the bag.
        config: parameters of the evaluation, limits of validity and of the size of the bag.
        progress: called with the number of checked scenarios and their total.

    Raises:
        InputError: the bag is missing or damaged, or has no scenarios.
    """
    recording = read_recording(path, config.bag)
    namespaces = [each for each in recording.namespaces.values() if SCENARIOS in each.messages]
    if not namespaces:
        raise InputError(f"{path}: no topic `scenarios` in any namespace; nothing to evaluate")
    total = sum(len(namespace.hashes) for namespace in namespaces)
    done = count(1)
    with naming_bag(path):
        return tuple(
            _evaluate(namespace, recording.provenance, config, lambda: progress(next(done), total))
            for namespace in namespaces
        )


def write_page(
    bag: Path, folder: Path, *, progress: Callable[[int, int], None] = lambda *_: None
) -> None:
    """Write the report on a bag; `progress` as in `evaluate_bag`.

    Raises:
        InputError: the bag is damaged or has nothing to measure, or the folder must not be
            replaced.
    """
    with replaced_folder(folder, EVALUATED, [bag]) as place:
        write_evaluation(place, measured(evaluate_bag(bag, progress=progress), bag), bag)


def measured(evaluations: Iterable[BagEvaluation], bag: Path) -> list[GenerationResult]:
    """Return the results of a bag.

    Raises:
        InputError: there is none; the message names the reasons.
    """
    results = [each.result for each in evaluations if each.result is not None]
    if not results:
        raise InputError("; ".join((str(bag), *(str(each.notes[-1]) for each in evaluations))))
    return results


def _evaluate(
    namespace: Namespace,
    provenance: Mapping[str, str],
    config: PipelineConfig,
    tick: Callable[[], None],
) -> BagEvaluation:
    """Check the scenarios of a namespace one after the other, and measure the readable ones."""
    namespace.check_infos()
    checkers: dict[tuple[object, ...], Checker] = {}
    scenarios: list[Scenario] = []
    verdicts: list[Verdict] = []
    skipped: Counter[str] = Counter()
    for k in range(len(namespace.hashes)):
        entry = namespace.entry(k) or namespace.unknown.get(k)
        violations = list(_alterations(namespace, k, entry))
        try:
            stamp, scenario = namespace.scenario(k)
            checker = _checker(namespace, entry, stamp, scenario, config.limits, checkers)
            (verdict,) = checker.check([join_ego(scenario)])
        except InputError as error:
            violations.append(Violation(Cause.UNUSABLE, 0.0, (), str(error)))
        else:
            violations += verdict.violations
            scenarios.append(scenario)
            skipped.update(checker.not_applicable)
            if not namespace.entries:
                skipped[f"sha256: there is no entry on {INFO}"] += 1
            if entry is not None and namespace.without_witness(entry):
                skipped[f"the ego: its reference drive is not on {WITNESS}"] += 1
        verdicts.append(Verdict(tuple(violations)))
        tick()
    notes = [Note.of(NoteKind.TEXT, text=text) for text in namespace.missing]
    lost = sum(entry is None for entry in namespace.unknown.values())
    if lost:
        values = {"count": lost, "total": len(verdicts), "reason": NO_ENTRY}
        notes.append(Note.of(NoteKind.UNACCOUNTED, **values))
    for check, number in skipped.items():
        notes.append(Note.of(NoteKind.NOT_CHECKED, count=number, check=check))
    result = None
    try:
        result = replace(_result(namespace, verdicts, notes, scenarios), provenance=provenance)
        result = replace(result, figures=evaluate(result, config.evaluation))
    except InputError as error:
        result = None
        notes.append(Note.of(NoteKind.NOT_MEASURED, reason=str(error)))
    return BagEvaluation(namespace.name, tuple(verdicts), tuple(notes), result)


def _result(
    namespace: Namespace,
    verdicts: Sequence[Verdict],
    notes: Sequence[Note],
    scenarios: Sequence[Scenario],
) -> GenerationResult:
    """Return the readable scenarios of a namespace as a result that is not yet evaluated.

    Raises:
        InputError: the bag lacks tracks or a readable scenario.
    """
    if "tracks" not in namespace.messages or not scenarios:
        raise InputError("that needs `tracks` and a readable scenario")
    encounter = namespace.encounter
    situation = Situation.of(encounter)
    kept = set.intersection(*(set(scenario.facts.reactions) for scenario in scenarios))
    total = len(verdicts)
    refused = Counter(each.violations[0].cause for each in verdicts if not each.valid)
    outcomes = [Note.of(NoteKind.TEXT, text=summary.sentence()) for summary in namespace.summaries]
    generated = ScenarioSet(
        total,
        scenarios,
        total,
        refused,
        (Note.of(NoteKind.BAG_MEASURED), *notes, *outcomes),
        _ego_slot(scenarios[0]),
        reactions=tuple(_named(situation, kept)),
        graph=situation.reactions,
    )
    return GenerationResult(
        encounter,
        namespace.segmentation,
        namespace.road,
        *namespace.fit,
        generated,
        row_name=SCENARIOS,
        valid=total - refused.total(),
        covered=coverage_of(encounter, scenarios),
    )


def _checker(
    namespace: Namespace,
    entry: ScenarioEntry | None,
    stamp: int,
    scenario: Scenario,
    limits: Limits,
    known: dict[tuple[object, ...], Checker],
) -> Checker:
    """Return the checker of a scenario, with its ego; equal requirements share one in `known`.

    Raises:
        InputError: a message with its requirements is damaged.
    """
    facts, states = Facts(), None
    if entry is not None:
        has_ego = scenario.reference_drive is not None
        facts, states = entry.facts, entry.asked(witness=has_ego)
    ids = tokens(join_ego(scenario).ids)
    key = (
        *(stamp, ids, facts.order, facts.reactions, facts.lost_reactions),
        entry and (entry.template_hash, entry.map_hash),
        states and tuple(array.tobytes() for array in vars(states).values()),
    )
    if key not in known:
        is_ambiguous = entry is None and namespace.roads_differ
        road = None if is_ambiguous else namespace.road_of(entry, stamp)
        checker = Checker(road, states, None, None, limits)
        encounter = namespace.tracks_of(entry, stamp)
        if encounter is not None and 2 <= len(ids) == len({*ids} & {*tokens(encounter.ids)}):
            segmentation = namespace.segmentation_of(encounter)
            checker = _with_template(checker, encounter, segmentation, ids, facts)
        known[key] = checker
    return known[key]


def _with_template(
    checker: Checker,
    encounter: Encounter,
    segmentation: Segmentation | None,
    ids: Sequence[str],
    facts: Facts,
) -> Checker:
    """Add the requirements of the template, reduced to the vehicles `ids`."""
    template = tokens(encounter.ids)
    encounter = encounter.select([template.index(name) for name in ids])
    situation = Situation.of(encounter)
    gaps = {
        (who, whom): (speed, 0.0 * gap if (ids[who], ids[whom]) in facts.lost_reactions else gap)
        for (who, whom), (speed, gap) in situation.lane_gaps.items()
    }
    is_whole = len(ids) == len(template)
    return replace(
        checker,
        conflicts=situation.conflicts,
        waits=None if segmentation is None else situation.waits_to_keep(segmentation),
        first=required_orders(situation.conflicts, facts.order if is_whole else "free"),
        reactions=_named(situation, facts.reactions),
        ends=at_ends(encounter.present, len(encounter.time)),
        lane_gaps=gaps,
        stops=situation.reactions.stops,
        at_red=red_runners(encounter),
    )


def _named(situation: Situation, names: Collection[NamedReaction]) -> list[Reaction]:
    """Return the reactions with these names."""
    ids = tokens(situation.encounter.ids)
    return [edge for edge in situation.reactions.edges if edge.named(ids) in names]


def _alterations(namespace: Namespace, k: int, entry: ScenarioEntry | None) -> Iterator[Violation]:
    """Yield how scenario `k` or its reference drive was replaced."""
    if entry is None:
        return
    if k in namespace.unknown:
        message = (
            f"message {k} has SHA-256 {namespace.hashes[k][:12]}…, which {INFO} does not know; "
            f"scenario {entry.index} of request {entry.request} was published as "
            f"{entry.sha256[:12]}…"
        )
        yield Violation(Cause.ALTERED, 0.0, (), message)
    if namespace.without_witness(entry) and namespace.strange_witnesses:
        message = f"the ego's reference drive is not what was published for scenario {entry.index}"
        yield Violation(Cause.ALTERED, 0.0, (), message)


def _ego_slot(scenario: Scenario) -> EgoSlot | None:
    """Return the ego slot by a scenario's reference drive; None without one."""
    drive = scenario.reference_drive
    if drive is None:
        return None
    (states,) = np.asarray(drive)
    return EgoSlot(drive.vehicles[0], states[0], states[-1])
