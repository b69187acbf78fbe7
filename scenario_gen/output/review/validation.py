# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Is every scenario of a bag valid? For any bag of the conventions, ours or not.

A scenario is checked against what bears its stamp in its own namespace: the states asked of it and how far they may be left
(its own in `scenarios/info`), the conflicts and waits of its template (`tracks`; waits if there are `changepoints`), in the
order that was asked, and the road: the `map` that its entry on `scenarios/info` names by hash, else the newest one of the
stamp, or of all. What is not there is not checked, and said. Vehicles are matched by id, so one may be left out for an ego;
with its witness, all are checked together. Where there are entries, a scenario is not to stand in the place of another that was
published; one without any entry is counted, and checked as far as that goes.
"""

from collections import Counter
from collections.abc import Callable, Collection, Sequence
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
    tokens,
)

UNUSABLE = "unusable_message"  # damaged, not finite, in another frame than its road: beside the checker's causes
NO_WITNESS = f"the ego: its reference drive is not on {WITNESS}"
ALTERED = "altered_message"  # not the bytes that scenarios/info has an entry for


@dataclass
class Found:
    """How many scenarios have violations of one cause, and the first of them."""

    count: int
    scenario: int
    message: str


@dataclass
class Validation:
    """What was found in one namespace: `found` by cause; `left_out` says what could not be checked, and of how many scenarios.

    `unaccounted` scenarios have no entry on `scenarios/info`, though others have; they are valid if nothing else is wrong.
    `missing` says which requests are not there whole, `proven` how many scenarios keep each reaction that their entries name.
    """

    namespace: str
    scenarios: int = 0
    invalid: int = 0
    unaccounted: int = 0
    found: dict[str, Found] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)
    missing: tuple[str, ...] = ()
    proven: Counter[str] = field(default_factory=Counter)

    def add(
        self, index: int, violations: Sequence[tuple[str, str]], left_out: Collection[str]
    ) -> None:
        """Count one scenario with its violations (cause, sentence)."""
        self.scenarios += 1
        self.invalid += bool(violations)
        for cause in dict.fromkeys(cause for cause, _ in violations):
            first = next(message for other, message in violations if other == cause)
            self.found.setdefault(cause, Found(0, index, first)).count += 1
        for sentence in left_out:
            self.left_out[sentence] = self.left_out.get(sentence, 0) + 1


@dataclass(frozen=True, eq=False)
class Reference:
    """What the scenarios of one stamp are held against.

    `first` says who must go first at each conflict, by index in `template`, None for anyone; nothing: as in the template.
    `reactions` are those of the template that the entry says are kept. `ends` (N, 2) says who of `template` is there at its first
    and last instant, `lane_gaps` how near they come to one ahead of them.
    """

    road: Road | None
    template: tuple[str, ...] | None
    conflicts: tuple[Conflict, ...]
    waits: tuple[Wait, ...] | None
    first: tuple[int | None, ...] = ()
    reactions: tuple[Reaction, ...] = ()
    ends: Bools | None = None
    lane_gaps: LaneGaps = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        situation: Situation,
        segmentation: Segmentation | None,
        road: Road | None,
        entry: ScenarioEntry | None,
    ) -> "Reference":
        """Return what a scenario with this entry is held against; without a segmentation its waits are not known."""
        encounter, conflicts = situation.encounter, situation.conflicts
        waits: tuple[Wait, ...] | None = None
        if segmentation is not None:
            waits = situation.waits_to_keep(segmentation)
        return cls(
            road,
            tokens(vehicle.id for vehicle in encounter.vehicles),
            tuple(conflicts),
            waits,
            required_orders(conflicts, entry.facts.order if entry else "keep"),
            kept_reactions(situation, entry),
            at_ends(encounter.present, len(encounter.time)),
            kept_gaps(situation, entry),
        )

    def checker(
        self, scenario: Scenario, limits: Limits | None, requested: BoundaryStates | None
    ) -> Checker:
        """Return the checker of scenarios with the same vehicles as this one, which must meet the states `requested`."""
        ids = tokens(vehicle.id for vehicle in scenario.vehicles)
        if self.template is None or not set(ids) <= set(self.template):
            return Checker(self.road, requested, None, None, limits)
        at = {self.template.index(name): k for k, name in enumerate(ids)}
        known = [k for k, c in enumerate(self.conflicts) if {c.first, c.second} <= set(at)]
        conflicts = [
            replace(c, first=at[c.first], second=at[c.second])
            for c in (self.conflicts[k] for k in known)
        ]
        required_first = self.first or tuple(c.first for c in self.conflicts)
        first = [
            None if leader is None else at[leader] for leader in (required_first[k] for k in known)
        ]
        waits = (
            None
            if self.waits is None
            else [replace(w, vehicle=at[w.vehicle]) for w in self.waits if w.vehicle in at]
        )
        edges = [
            replace(e, who=at[e.who], whom=at[e.whom])
            for e in self.reactions
            if {e.who, e.whom} <= set(at)
        ]
        ends = None if self.ends is None else self.ends[list(at)]
        gaps = {
            (at[who], at[whom]): found
            for (who, whom), found in self.lane_gaps.items()
            if {who, whom} <= set(at)
        }
        return Checker(self.road, requested, conflicts, waits, limits, first, edges, ends, gaps)


def validate_bag(
    path: Path,
    limits: Limits | None = None,
    config: BagConfig = BagConfig(),
    *,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> tuple[Validation, ...]:
    """Check every scenario of every namespace that holds any.

    Args:
        path: the bag.
        limits: of validity.
        config: says how much is read at most.
        progress: called with the number of scenarios checked, and of all.

    Raises:
        InputError: the bag is missing or damaged, holds no scenarios, or one of its tracks, maps, … cannot be read.
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
    """The checkers of the scenarios of a namespace; those that are held against the same share one."""

    def __init__(self, namespace: Namespace, limits: Limits | None) -> None:
        self._namespace, self._limits = namespace, limits
        self._references: dict[tuple[object, ...], Reference] = {}
        self._checkers: dict[tuple[object, ...], Checker] = {}

    def of(self, k: int, stamp: int, scenario: Scenario, states: BoundaryStates | None) -> Checker:
        """Return the checker of scenario `k`, its ego among its vehicles, which must meet the `states`, if they are known.

        Raises:
            InputError: a message of what it is held against is damaged.
        """
        entry = self._namespace.entry(k) or self._namespace.unknown.get(k)
        is_lost = k in self._namespace.unknown and entry is None
        facts = Facts() if entry is None else entry.facts
        place = (
            stamp,
            is_lost,
            entry and entry.template_hash,
            entry and entry.map_hash,
            facts.order,
            facts.reactions,
            facts.lost_reactions,
        )
        of_these = b"" if states is None else states.start.tobytes() + states.end.tobytes()
        key = (place, tuple(vehicle.id for vehicle in scenario.vehicles), of_these)
        if key not in self._checkers:
            if place not in self._references:
                self._references[place] = _reference(self._namespace, stamp, entry, is_lost)
            self._checkers[key] = self._references[place].checker(scenario, self._limits, states)
        return self._checkers[key]


def _validate(namespace: Namespace, limits: Limits | None, tick: Callable[[], None]) -> Validation:
    namespace.check_infos()
    result = Validation(namespace.name, missing=namespace.missing)
    message = () if namespace.entries else (f"sha256: there is no entry on {INFO}",)
    checkers = Checkers(namespace, limits)
    for k, sha256 in enumerate(namespace.hashes):
        tick()
        wrong, entry = [], namespace.unknown.get(k)
        if entry is not None:
            wrong = [(ALTERED, _altered(k, sha256, entry))]
        elif k in namespace.unknown:
            result.unaccounted += 1
        entry = namespace.entry(k) or entry
        silent = message
        if entry is not None and namespace.without_witness(entry):
            if namespace.strange_witnesses:
                wrong.append(
                    (
                        ALTERED,
                        f"the ego's reference drive is not what was published for scenario {entry.index}",
                    )
                )
            silent = (*message, NO_WITNESS)
        try:
            stamp, scenario = namespace.scenario(k)
        except InputError as error:
            result.add(k, [*wrong, (UNUSABLE, str(error))], ())
            continue
        states = None
        if entry is not None:
            states = entry.asked(
                namespace.where(INFO), witness=scenario.reference_drive is not None
            )
        scenario = join_ego(scenario)
        checker = checkers.of(k, stamp, scenario, states)
        try:
            (verdict,) = checker.check([scenario])
        except InputError as error:
            result.add(k, [*wrong, (UNUSABLE, str(error))], ())
            continue
        wrong += [(violation.cause.value, violation.message) for violation in verdict.violations]
        result.add(k, wrong, (*silent, *checker.not_applicable))
        broken = {
            violation.vehicles
            for violation in verdict.violations
            if violation.cause == Cause.REACTION
        }
        for edge in checker.reactions:
            result.proven[edge.words(scenario.vehicles)] += (edge.who, edge.whom) not in broken
    return result


def kept_reactions(situation: Situation, entry: ScenarioEntry | None) -> tuple[Reaction, ...]:
    """Return the reactions of a template that an entry says its scenario keeps."""
    names = tokens(vehicle.id for vehicle in situation.encounter.vehicles)
    kept = entry.facts.reactions if entry else ()
    return tuple(edge for edge in situation.reactions.edges if edge.named(names) in kept)


def kept_gaps(situation: Situation, entry: ScenarioEntry | None) -> LaneGaps:
    """Return the template's gaps in a lane; zeros for the pairs that an entry says its scenario is not held to."""
    names = tokens(vehicle.id for vehicle in situation.encounter.vehicles)
    lost = entry.facts.lost_reactions if entry else ()
    return {
        (who, whom): (speed, 0.0 * gap if (names[who], names[whom]) in lost else gap)
        for (who, whom), (speed, gap) in situation.lane_gaps.items()
    }


def _altered(k: int, sha256: str, entry: ScenarioEntry) -> str:
    """Return the sentence for a message that stands where another one was published."""
    published = (
        f"scenario {entry.index} of request {entry.request} was published as {entry.sha256[:12]}…"
    )
    return f"message {k} has SHA-256 {sha256[:12]}…, which {INFO} does not know; {published}"


def _reference(
    namespace: Namespace, stamp: int, entry: ScenarioEntry | None, is_lost: bool
) -> Reference:
    """Return what a scenario of the stamp and entry is held against; if its entry is lost, only what is beyond doubt.

    Raises:
        InputError: a message of it is damaged.
    """
    road = namespace.road_of(entry, stamp)
    if is_lost and namespace.roads_differ:
        road = None
    encounter = namespace.tracks_of(entry, stamp)
    if encounter is None:
        return Reference(road, None, (), None)
    return Reference.of(Situation.of(encounter), namespace.segmentation_of(encounter), road, entry)
