# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Validate the scenarios of any bag with the conventions of this suite.

A scenario is checked against the messages with its stamp in its namespace: the requested states
and their tolerances (its entry on `scenarios/info`); the conflicts of its template (`tracks`) in
the requested order; the waits of its template (if there are `changepoints`); and the road. The
road is the `map` that its entry names by hash, otherwise the newest map with its stamp, or the
newest of all. Checks without data are skipped and reported. Vehicles are matched by id, so an ego
may be missing; with a reference drive of the ego, all vehicles are checked together. If the bag
has entries, no scenario may replace a published one; scenarios without an entry are counted, and
checked as far as possible.
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path

from scenario_gen.bags.recordings.read import (
    INFO,
    Namespace,
    read_recording,
    ScenarioEntry,
    SCENARIOS,
    WITNESS,
)
from scenario_gen.bags.storage.bag import naming_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError
from scenario_gen.method.validity import Checker, Limits
from scenario_gen.numerics import Bools
from scenario_gen.situation import (
    Conflict,
    LaneGaps,
    red_runners,
    required_orders,
    Situation,
    Wait,
)
from scenario_gen.types import (
    at_ends,
    BoundaryStates,
    Cause,
    Facts,
    join_ego,
    Reaction,
    Road,
    Scenario,
    Segmentation,
    SignalStop,
    tokens,
)

UNUSABLE = "unusable_message"  # damaged, not finite, or in a frame other than the road's
NO_WITNESS = f"the ego: its reference drive is not on {WITNESS}"
ALTERED = "altered_message"  # its bytes differ from those in its entry on scenarios/info


@dataclass
class CauseSummary:
    """The number of scenarios with violations of one cause, and the first of them."""

    count: int
    scenario: int
    message: str


@dataclass
class Validation:
    """The validation of one namespace.

    Attributes:
        namespace: its name.
        scenarios: number of checked scenarios.
        invalid: number of invalid scenarios.
        unaccounted: number of scenarios without an entry on `scenarios/info`, though others have
            one; they are valid if nothing else is wrong.
        causes: summaries of the violations by cause.
        left_out: number of scenarios by each check that was skipped.
        missing: notes on incomplete requests.
        proven: number of scenarios that keep each reaction in their entries.
    """

    namespace: str
    scenarios: int = 0
    invalid: int = 0
    unaccounted: int = 0
    causes: dict[str, CauseSummary] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)
    missing: tuple[str, ...] = ()
    proven: Counter[str] = field(default_factory=Counter)

    def add(
        self, index: int, violations: Sequence[tuple[str, str]], left_out: Collection[str]
    ) -> None:
        """Count one scenario with its violations (cause, sentence)."""
        self.scenarios += 1
        self.invalid += bool(violations)
        messages: dict[str, str] = {}
        for cause, message in violations:
            messages.setdefault(cause, message)
        for cause, message in messages.items():
            self.causes.setdefault(cause, CauseSummary(0, index, message)).count += 1
        for sentence in left_out:
            self.left_out[sentence] = self.left_out.get(sentence, 0) + 1


@dataclass(frozen=True, eq=False)
class Reference:
    """The requirements on the scenarios with one stamp.

    Attributes:
        road: the road; None if the bag has none.
        template: ids of the template's vehicles.
        conflicts: conflicts of the template.
        waits: waits of the template; None if they are unknown.
        first: index in `template` of the vehicle that must pass each conflict first, None for
            either; empty: the order of the template.
        reactions: reactions of the template that the scenarios must keep.
        ends: (N, 2) whether each vehicle is present at the first and at the last instant.
        lane_gaps: the template's smallest gaps to leaders.
        stops: the template's stops for lights.
        at_red: vehicles that run red in the template.
    """

    road: Road | None
    template: tuple[str, ...] | None
    conflicts: tuple[Conflict, ...]
    waits: tuple[Wait, ...] | None
    first: tuple[int | None, ...] = ()
    reactions: tuple[Reaction, ...] = ()
    ends: Bools | None = None
    lane_gaps: LaneGaps = field(default_factory=dict)
    stops: tuple[SignalStop, ...] = ()
    at_red: frozenset[int] = frozenset()

    @classmethod
    def of(
        cls,
        situation: Situation,
        segmentation: Segmentation | None,
        road: Road | None,
        entry: ScenarioEntry | None,
    ) -> "Reference":
        """Return the requirements on a scenario with this entry.

        Without a segmentation, waits are unknown.
        """
        encounter, conflicts = situation.encounter, situation.conflicts
        waits: tuple[Wait, ...] | None = None
        if segmentation is not None:
            waits = situation.waits_to_keep(segmentation)
        return cls(
            road,
            tokens(encounter.ids),
            tuple(conflicts),
            waits,
            required_orders(conflicts, entry.facts.order if entry else "keep"),
            kept_reactions(situation, entry),
            at_ends(encounter.present, len(encounter.time)),
            kept_gaps(situation, entry),
            situation.reactions.stops,
            red_runners(encounter),
        )

    def checker(
        self, scenario: Scenario, limits: Limits | None, requested: BoundaryStates | None
    ) -> Checker:
        """Return the checker for scenarios with the vehicles of `scenario`.

        They must meet the `requested` boundary states.
        """
        ids = tokens(scenario.ids)
        if self.template is None or not set(ids) <= set(self.template):
            return Checker(self.road, requested, None, None, limits)
        rows = {self.template.index(name): k for k, name in enumerate(ids)}
        conflicts, first = self._conflicts_of(rows)
        waits = self._waits_of(rows)
        reactions = [
            replace(edge, who=rows[edge.who], whom=rows[edge.whom])
            for edge in self.reactions
            if {edge.who, edge.whom} <= rows.keys()
        ]
        ends = None if self.ends is None else self.ends[list(rows)]
        gaps = {
            (rows[who], rows[whom]): gap
            for (who, whom), gap in self.lane_gaps.items()
            if {who, whom} <= rows.keys()
        }
        template = conflicts, waits, limits, first, reactions, ends, gaps
        stops = [replace(s, who=rows[s.who]) for s in self.stops if s.who in rows]
        at_red = [rows[n] for n in self.at_red if n in rows]
        return Checker(self.road, requested, *template, stops, at_red)

    def _conflicts_of(self, rows: Mapping[int, int]) -> tuple[list[Conflict], list[int | None]]:
        """Return the conflicts between vehicles in `rows`, and who must pass each one first.

        `rows` maps indices in the template to indices in the scenario.
        """
        required = self.first or tuple(conflict.first for conflict in self.conflicts)
        conflicts: list[Conflict] = []
        first: list[int | None] = []
        for conflict, leader in zip(self.conflicts, required, strict=True):
            if {conflict.first, conflict.second} <= rows.keys():
                renumbered = replace(
                    conflict, first=rows[conflict.first], second=rows[conflict.second]
                )
                conflicts.append(renumbered)
                first.append(None if leader is None else rows[leader])
        return conflicts, first

    def _waits_of(self, rows: Mapping[int, int]) -> list[Wait] | None:
        """Return the waits of the vehicles in `rows`; None if they are unknown."""
        if self.waits is None:
            return None
        known = [wait for wait in self.waits if wait.vehicle in rows]
        return [replace(wait, vehicle=rows[wait.vehicle]) for wait in known]


def validate_bag(
    path: Path,
    limits: Limits | None = None,
    config: BagConfig = BagConfig(),
    *,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> tuple[Validation, ...]:
    """Check every scenario in every namespace of a bag.

    Args:
        path: the bag.
        limits: limits of validity.
        config: limits on the size of the bag.
        progress: called with the number of checked scenarios and their total.

    Raises:
        InputError: the bag is missing or damaged, has no scenarios, or one of its tracks or maps
            cannot be read.
    """
    namespaces = read_recording(
        path,
        config,
        ("tracks", "changepoints", "map", "road/lanes", "fit", "fit/info", SCENARIOS, INFO),
    ).namespaces.values()
    checked = [namespace for namespace in namespaces if SCENARIOS in namespace.messages]
    if not checked:
        raise InputError(
            f"{path}: no topic `scenarios` in any namespace; there is nothing to check"
        )
    with naming_bag(path):
        total = sum(len(namespace.hashes) for namespace in checked)
        done = count(1)
        return tuple(
            _validate(namespace, limits, lambda: progress(next(done), total))
            for namespace in checked
        )


class Checkers:
    """The checkers of a namespace; scenarios with the same requirements share one."""

    def __init__(self, namespace: Namespace, limits: Limits | None) -> None:
        self._namespace, self._limits = namespace, limits
        self._references: dict[tuple[object, ...], Reference] = {}
        self._checkers: dict[tuple[object, ...], Checker] = {}

    def of(self, k: int, stamp: int, scenario: Scenario, states: BoundaryStates | None) -> Checker:
        """Return the checker of scenario `k`, which must meet the `states` if they are known.

        Args:
            k: number of the scenario in the namespace.
            stamp: its stamp [ns].
            scenario: the scenario, its ego among its vehicles.
            states: the requested boundary states.

        Raises:
            InputError: a message with its requirements is damaged.
        """
        entry = self._namespace.entry(k) or self._namespace.unknown.get(k)
        is_lost = k in self._namespace.unknown and entry is None
        facts = Facts() if entry is None else entry.facts
        source = (
            stamp,
            is_lost,
            entry and entry.template_hash,
            entry and entry.map_hash,
            facts.order,
            facts.reactions,
            facts.lost_reactions,
        )
        state_bytes = b"" if states is None else states.start.tobytes() + states.end.tobytes()
        key = (source, scenario.ids, state_bytes)
        if key not in self._checkers:
            if source not in self._references:
                self._references[source] = _reference(self._namespace, stamp, entry, is_lost)
            self._checkers[key] = self._references[source].checker(scenario, self._limits, states)
        return self._checkers[key]


def _validate(namespace: Namespace, limits: Limits | None, tick: Callable[[], None]) -> Validation:
    """Check every scenario of a namespace."""
    namespace.check_infos()
    result = Validation(namespace.name, missing=namespace.missing)
    checkers = Checkers(namespace, limits)
    for k in range(len(namespace.hashes)):
        tick()
        if k in namespace.unknown and namespace.unknown[k] is None:
            result.unaccounted += 1
        _validate_scenario(namespace, k, checkers, result)
    return result


def _validate_scenario(
    namespace: Namespace, k: int, checkers: Checkers, result: Validation
) -> None:
    """Check scenario `k` of a namespace and add it to the result."""
    entry = namespace.entry(k) or namespace.unknown.get(k)
    violations = _alterations(namespace, k)
    skipped = [] if namespace.entries else [f"sha256: there is no entry on {INFO}"]
    if entry is not None and namespace.without_witness(entry):
        skipped.append(NO_WITNESS)
    try:
        stamp, scenario = namespace.scenario(k)
    except InputError as error:
        result.add(k, [*violations, (UNUSABLE, str(error))], ())
        return
    states = None
    if entry is not None:
        has_witness = scenario.reference_drive is not None
        states = entry.asked(namespace.where(INFO), witness=has_witness)
    scenario = join_ego(scenario)
    checker = checkers.of(k, stamp, scenario, states)
    try:
        (verdict,) = checker.check([scenario])
    except InputError as error:
        result.add(k, [*violations, (UNUSABLE, str(error))], ())
        return
    violations += [(violation.cause.value, violation.message) for violation in verdict.violations]
    result.add(k, violations, (*skipped, *checker.not_applicable))
    broken = {
        violation.vehicles for violation in verdict.violations if violation.cause == Cause.REACTION
    }
    for edge in checker.reactions:
        result.proven[edge.words(scenario.vehicles)] += (edge.who, edge.whom) not in broken


def _alterations(namespace: Namespace, k: int) -> list[tuple[str, str]]:
    """Return the violations of scenario `k` whose message or reference drive was replaced."""
    violations = []
    published = namespace.unknown.get(k)
    if published is not None:
        violations.append((ALTERED, _altered(k, namespace.hashes[k], published)))
    entry = namespace.entry(k) or published
    if entry is not None and namespace.without_witness(entry) and namespace.strange_witnesses:
        message = f"the ego's reference drive is not what was published for scenario {entry.index}"
        violations.append((ALTERED, message))
    return violations


def kept_reactions(situation: Situation, entry: ScenarioEntry | None) -> tuple[Reaction, ...]:
    """Return the template's reactions that the scenario keeps, according to its entry."""
    names = tokens(situation.encounter.ids)
    kept = entry.facts.reactions if entry else ()
    return tuple(edge for edge in situation.reactions.edges if edge.named(names) in kept)


def kept_gaps(situation: Situation, entry: ScenarioEntry | None) -> LaneGaps:
    """Return the template's gaps in a lane; zero for the lost reactions in the entry."""
    names = tokens(situation.encounter.ids)
    lost = entry.facts.lost_reactions if entry else ()
    return {
        (who, whom): (speed, 0.0 * gap if (names[who], names[whom]) in lost else gap)
        for (who, whom), (speed, gap) in situation.lane_gaps.items()
    }


def _altered(k: int, sha256: str, entry: ScenarioEntry) -> str:
    """Return the message for a scenario that replaces a published one."""
    published = (
        f"scenario {entry.index} of request {entry.request} was published as {entry.sha256[:12]}…"
    )
    return f"message {k} has SHA-256 {sha256[:12]}…, which {INFO} does not know; {published}"


def _reference(
    namespace: Namespace, stamp: int, entry: ScenarioEntry | None, is_lost: bool
) -> Reference:
    """Return the requirements on a scenario; if its entry is lost, only the certain ones.

    Raises:
        InputError: a message with the requirements is damaged.
    """
    road = namespace.road_of(entry, stamp)
    if is_lost and namespace.roads_differ:
        road = None
    encounter = namespace.tracks_of(entry, stamp)
    if encounter is None:
        return Reference(road, None, (), None)
    return Reference.of(Situation.of(encounter), namespace.segmentation_of(encounter), road, entry)
