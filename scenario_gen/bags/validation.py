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

"""Is every scenario of a bag valid? For any bag of the conventions, ours or not.

A scenario is checked against what bears its stamp in its own namespace: the states asked of it (its own in `scenarios/info`,
else `fit`), the conflicts and waits of its template (`tracks`; waits if there are `changepoints`), and the road: the `map` that
its account on `scenarios/info` names by hash, else the newest one of the stamp, or of all. What is not there is not checked,
and said. Vehicles are matched by id, so one may be left out for an ego. Where there are accounts, a scenario is not to stand
in the place of another that was published; one without any account is counted, and checked as far as that goes.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from msg_conventions import trajectory
from msg_conventions.belonging import MAP_HASH, TEMPLATE_HASH
from msg_conventions.changepoints import decode_changepoints
from msg_conventions.diagnostics import decode_diagnostics, states_of
from msg_conventions.names import tokens
from msg_conventions.roads import decode_map
from msg_conventions.scenarios import decode_scenario, digest
from msg_conventions.tracks import decode_tracks
from scenario_gen.arrays import Floats
from scenario_gen.bags.accounts import INFO, missing_sentences
from scenario_gen.bags.belonging import Account, accounts_of, is_ambiguous, map_of, newest, tracks_of, unknown_scenarios
from scenario_gen.bags.contents import Contents, read_namespaces
from scenario_gen.bags.reader import DEFAULT, within
from scenario_gen.errors import InputError
from scenario_gen.interaction import Conflict, find_conflicts, find_waits, Wait
from scenario_gen.roads.road import Road
from scenario_gen.scenario import BoundaryStates, Scenario
from scenario_gen.storage import BagConfig
from scenario_gen.validity import Checker, Limits

REFERENCES = ("tracks", "changepoints", "map", "fit")
UNUSABLE = "unusable_message"  # damaged, not finite, in another frame than its road: beside the checker's causes
ALTERED = "altered_message"  # not the bytes that scenarios/info accounts for


@dataclass
class Found:
    """How many scenarios have violations of one cause, and the first of them."""

    count: int
    scenario: int
    message: str


@dataclass
class Validation:
    """What was found in one namespace: `found` by cause; `left_out` says what could not be checked, and of how many scenarios.

    `unaccounted` scenarios have no account on `scenarios/info`, though others have; they are valid if nothing else is wrong.
    `missing` says which requests are not there whole.
    """

    namespace: str
    scenarios: int = 0
    invalid: int = 0
    unaccounted: int = 0
    found: dict[str, Found] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)
    missing: tuple[str, ...] = ()

    def add(self, index: int, violations: Sequence[tuple[str, str]], left_out: Collection[str]) -> None:
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
    """What the scenarios of one stamp are held against; vehicles by id."""

    road: Road | None
    asked: dict[str, tuple[Floats, Floats]] | None
    template: tuple[str, ...] | None
    conflicts: tuple[Conflict, ...]
    waits: tuple[Wait, ...] | None

    def checker(self, scenario: Scenario, limits: Limits | None, asked: BoundaryStates | None = None) -> Checker:
        """Return the checker of scenarios with this one's vehicles; `asked` is in place of the template's states."""
        ids = tokens(vehicle.id for vehicle in scenario.vehicles)
        if asked is None and self.asked is not None and all(name in self.asked for name in ids):
            start, end = zip(*(self.asked[name] for name in ids), strict=True)
            asked = BoundaryStates(np.array(start), np.array(end))
        if self.template is None or not set(ids) <= set(self.template):
            return Checker(self.road, asked, None, None, limits)
        at = {self.template.index(name): k for k, name in enumerate(ids)}
        conflicts = [replace(c, first=at[c.first], second=at[c.second]) for c in self.conflicts if {c.first, c.second} <= set(at)]
        waits = None if self.waits is None else [replace(w, vehicle=at[w.vehicle]) for w in self.waits if w.vehicle in at]
        return Checker(self.road, asked, conflicts, waits, limits)


def asked_by_digest(infos: Sequence[tuple[str, bytes]]) -> dict[str, BoundaryStates]:
    """Return the states that `scenarios/info` says were asked of each scenario, by its SHA-256; `infos` are (name, bytes).

    Raises:
        InputError: a message is damaged.
    """
    found = {}
    for what, data in infos:
        for status in decode_diagnostics(data, what)[1]:
            values = status.values
            if {"sha256", "asked_start", "asked_end"} <= set(values):
                where = f"{what}: the asked states of {status.message}"
                found[values["sha256"]] = BoundaryStates(*(states_of(values[key], where) for key in ("asked_start", "asked_end")))
    return found


def validate_bag(path: Path, limits: Limits | None = None, config: BagConfig = DEFAULT) -> tuple[Validation, ...]:
    """Check every scenario of every namespace that holds any; `config` says how much is read at most.

    Raises:
        InputError: the bag is missing or damaged, holds no scenarios, or one of its tracks, maps, … cannot be read.
    """
    contents = read_namespaces(path, (*REFERENCES, "scenarios", INFO), config)
    found = {name: topics for name, topics in contents.items() if topics["scenarios"]}
    if not found:
        raise InputError(f"{path}: no topic `scenarios` in any namespace; there is nothing to check")
    with within(path):
        return tuple(_validate(namespace, topics, limits) for namespace, topics in found.items())


def _validate(namespace: str, topics: Contents, limits: Limits | None) -> Validation:
    result = Validation(namespace, missing=missing_sentences(topics["scenarios"], topics[INFO]))
    info = f"{namespace}/{INFO}"
    accounts = accounts_of(topics[INFO], info)
    own = {account["sha256"]: account for account in accounts}
    asked = asked_by_digest([(info, data) for data in topics[INFO]])
    unknown = unknown_scenarios(topics["scenarios"], accounts) if accounts else {}
    silent = () if accounts else (f"sha256: there is no account on {INFO}",)
    references: dict[tuple[object, ...], Reference] = {}
    checkers: dict[tuple[object, ...], Checker] = {}
    for index, data in enumerate(topics["scenarios"]):
        altered, account = [], unknown.get(index)
        if account is not None:
            altered = [(ALTERED, _altered(data, index, account))]
        elif index in unknown:
            result.unaccounted += 1
        try:
            stamp, scenario = decode_scenario(data, index=index, what=f"{namespace}/scenarios, message {index}")
            account, states = own.get(digest(data), account), asked.get(digest(data))
            is_lost = index in unknown and account is None
            place = (stamp, is_lost, *((account or {}).get(key) for key in (TEMPLATE_HASH, MAP_HASH)))
            if place not in references:
                references[place] = _reference(namespace, topics, accounts, stamp, account, is_lost)
            of_these = b"" if states is None else states.start.tobytes() + states.end.tobytes()
            key = (place, tuple(vehicle.id for vehicle in scenario.vehicles), of_these)
            if key not in checkers:
                checkers[key] = references[place].checker(scenario, limits, states)
        except _ReferenceError as error:
            raise InputError(str(error)) from error
        except InputError as error:
            result.add(index, [*altered, (UNUSABLE, str(error))], ())
            continue
        try:
            (verdict,) = checkers[key].check([scenario])
        except InputError as error:
            result.add(index, [*altered, (UNUSABLE, str(error))], ())
            continue
        violations = [(violation.cause.value, violation.message) for violation in verdict.violations]
        result.add(index, [*altered, *violations], (*silent, *checkers[key].not_applicable))
    return result


def _name(account: Account) -> str:
    return f"index {account.get('index', '?')} of request {account.get('request', '?')}"


def _altered(data: bytes, index: int, account: Account) -> str:
    """Return the sentence for a message that stands where another one was published."""
    published = f"{_name(account)} was published as {account['sha256'][:12]}…"
    return f"message {index} has SHA-256 {digest(data)[:12]}…, which {INFO} does not know; {published}"


class _ReferenceError(Exception):
    """What the scenarios are to be held against cannot be read itself."""


def _reference(
    namespace: str, topics: Contents, accounts: Sequence[Account], stamp: int, account: Account | None, is_lost: bool
) -> Reference:
    """Return what a scenario of the stamp and account is held against; if its account is lost, only what is beyond doubt.

    Raises:
        _ReferenceError: a message of it is damaged.
    """
    try:
        found = {topic: newest(topics[topic], stamp, f"{namespace}/{topic}") for topic in REFERENCES}
        tracks = tracks_of(account, topics["tracks"], stamp, f"{namespace}/tracks")
        grid = map_of(account, topics["map"], stamp, f"{namespace}/map")
        if is_lost and is_ambiguous(topics["map"], accounts):
            grid = None
        road = decode_map(grid, name=f"{namespace}/map")[1] if grid else None
        asked, template, conflicts, waits = None, None, [], None
        if found["fit"] and not is_lost:
            asked = _asked(found["fit"], f"{namespace}/fit")
        if tracks:
            encounter = decode_tracks(tracks, f"{namespace}/tracks")
            template = tokens(vehicle.id for vehicle in encounter.vehicles)
            conflicts = list(find_conflicts(encounter.vehicles, encounter.time, encounter.position, encounter.heading))
            if found["changepoints"]:  # without changepoints there is no dwell to hold: its waits are not asked for
                segmentation = decode_changepoints(found["changepoints"], encounter, f"{namespace}/changepoints")
                waits = find_waits(encounter) if segmentation.changepoints.size else ()
    except InputError as error:
        raise _ReferenceError(str(error)) from error
    return Reference(road, asked, template, tuple(conflicts), waits)


def _asked(data: bytes, what: str) -> dict[str, tuple[Floats, Floats]]:
    """Return start and end (x, y, yaw, speed) by vehicle id."""
    fit = trajectory.decode(data, what)
    if len(fit.time_ns) < 2:
        raise InputError(f"{what}: {len(fit.time_ns)} point(s); a start and an end are needed")
    state = np.concatenate([fit.position, fit.heading[..., None], fit.speed[..., None]], axis=-1)
    return {vehicle.id: (state[k, 0], state[k, -1]) for k, vehicle in enumerate(fit.vehicles)}
