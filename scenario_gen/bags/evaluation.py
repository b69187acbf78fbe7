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

"""The evaluation of any bag that keeps the conventions of the suite, ours or not."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from msg_conventions.belonging import MAP_HASH
from msg_conventions.roads import decode_map
from msg_conventions.scenarios import decode_scenario, digest
from msg_conventions.tracks import decode_tracks
from scenario_gen.bags.accounts import INFO, missing_sentences
from scenario_gen.bags.belonging import accounts_of, is_ambiguous, map_of, unknown_scenarios, UNTOLD
from scenario_gen.bags.contents import read_namespaces
from scenario_gen.bags.reader import DEFAULT, within
from scenario_gen.bags.told import request_sentence, told_fit, told_numbers, told_requests, told_segmentation, told_values
from scenario_gen.bags.validation import Reference
from scenario_gen.errors import InputError
from scenario_gen.evaluation import Case, CheckCounts, evaluate, Evaluation, EvaluationConfig
from scenario_gen.interaction import find_conflicts, find_waits
from scenario_gen.scenario import Scenario, ScenarioSet
from scenario_gen.storage import BagConfig
from scenario_gen.validity import Checker, Limits

SCENARIOS, DIAGNOSTICS = "scenarios", "diagnostics"
TOPICS = ("tracks", "changepoints", "posterior", "map", "fit", "ego/track", SCENARIOS, INFO, DIAGNOSTICS)


def evaluate_bag(
    path: Path, config: EvaluationConfig | None = None, limits: Limits | None = None, seed: int = 0, bag: BagConfig = DEFAULT
) -> tuple[Evaluation, ...]:
    """Evaluate every namespace of a bag, as `bag_cases` does, and return the figures alone."""
    return tuple(case.evaluation for case in bag_cases(path, config, limits, seed, bag))


def bag_cases(
    path: Path, config: EvaluationConfig | None = None, limits: Limits | None = None, seed: int = 0, bag: BagConfig = DEFAULT
) -> tuple[Case, ...]:
    """Evaluate every namespace of a bag that holds both `tracks` and `scenarios`, ready for the report.

    The scenarios are checked anew, on the bag's map if it has one; start and end states are not asked. What the bag does not say
    is left out: without `changepoints` K counts as 0; fit and routes are shown if both are there, with what the fitting decided.

    Raises:
        InputError: the bag is missing or damaged, or no namespace has both topics.
    """
    found = read_namespaces(path, TOPICS, bag)
    whole = {name: topics for name, topics in found.items() if topics["tracks"] and topics[SCENARIOS]}
    if not whole:
        raise InputError(f"{path}: no namespace holds both `tracks` and `scenarios`; there is nothing to compare")
    common = found.get("", {}).get(DIAGNOSTICS, [])  # nodes speak on one topic for all namespaces
    config = config or EvaluationConfig()
    with within(path):
        return tuple(_case(path, name, topics, common, config, limits, seed, bag) for name, topics in whole.items())


def _case(
    path: Path,
    namespace: str,
    topics: Mapping[str, Sequence[bytes]],
    common: Sequence[bytes],
    config: EvaluationConfig,
    limits: Limits | None,
    seed: int,
    bag: BagConfig,
) -> Case:
    encounter = decode_tracks(topics["tracks"][-1], f"{path.stem}{namespace}")
    told = told_values(common, encounter.start_ns, f"{namespace}/") | told_values(topics[DIAGNOSTICS], encounter.start_ns)
    segmentation = told_segmentation(encounter, topics["changepoints"], topics["posterior"], told, f"{namespace}/changepoints")
    fit, routes = told_fit(path, namespace, encounter, segmentation, topics["fit"], told, bag)
    accounts = told_values(topics[INFO], encounter.start_ns).values()
    road_name = next((values["road"] for values in accounts if "road" in values), f"{namespace}/map")
    road = decode_map(topics["map"][-1], name=road_name)[1] if topics["map"] else None
    scenarios = _scenarios(topics, f"{namespace}/{SCENARIOS}")
    given = accounts_of(topics[INFO], INFO, lenient=True)
    of_scenario = {account["sha256"]: account for account in given}
    several = is_ambiguous(topics["map"], given)
    conflicts = find_conflicts(encounter.vehicles, encounter.time, encounter.position, encounter.heading)
    waits = find_waits(encounter) if segmentation.changepoints.size else ()
    names = tuple(vehicle.id for vehicle in encounter.vehicles)
    checkers: dict[tuple[str, ...], Checker] = {}
    verdicts = []
    for scenario, data in zip(scenarios, topics[SCENARIOS], strict=True):  # an ego may have been left out, the map been another
        account = of_scenario.get(digest(data), {})
        ids = (account.get(MAP_HASH, ""), *(vehicle.id for vehicle in scenario.vehicles))
        if ids not in checkers:
            grid = map_of(account, topics["map"], encounter.start_ns, f"{namespace}/map")
            there = road if not several else decode_map(grid, name=road_name)[1] if grid and ids[0] else None
            checkers[ids] = Reference(there, None, names, conflicts, waits).checker(scenario, limits)
        verdicts += checkers[ids].check([scenario])
    counts = CheckCounts.of_verdicts(verdicts)
    evaluation = evaluate(
        encounter,
        segmentation,
        {SCENARIOS: scenarios},
        checks={SCENARIOS: counts},
        road=road.name if road else "",
        config=config,
        seed=seed,
    )
    notes = list(missing_sentences(topics[SCENARIOS], topics[INFO]))
    lost = sum(account is None for account in unknown_scenarios(topics[SCENARIOS], given).values()) if given else 0
    if lost:
        notes.append(f"{lost} of {len(scenarios)} scenarios are unaccounted: {UNTOLD}")
    rows = [replace(row, notes=(*row.notes, *notes)) if row.name == SCENARIOS else row for row in evaluation.rows]
    evaluation = replace(evaluation, rows=tuple(rows))
    ego = decode_scenario(topics["ego/track"][-1], what=f"{namespace}/ego/track")[1] if topics["ego/track"] else None
    if ego is not None and ego.vehicles[0].id in evaluation.vehicles:
        ego = None  # of another request than these scenarios
    everything = ScenarioSet(len(scenarios), tuple(scenarios), counts.candidates, Counter(counts.refused), _left_out(topics), ego)
    return Case(
        encounter,
        segmentation,
        road,
        fit=fit,
        routes=routes,
        with_changepoints=everything,
        without_changepoints=None,
        evaluation=evaluation,
        without_refused="the bag holds one set of scenarios",
        row=SCENARIOS,
        valid=counts.candidates - sum(counts.refused.values()),
    )


def _scenarios(topics: Mapping[str, Sequence[bytes]], what: str) -> list[Scenario]:
    """Return the scenarios, numbered as `scenarios/info` says; those that it does not know by their places in the bag."""
    told = told_numbers(topics[INFO])
    numbers = [told.get(digest(data), (0, k)) for k, data in enumerate(topics[SCENARIOS])]
    return [
        decode_scenario(data, seed=seed, index=index, what=what)[1]
        for data, (seed, index) in zip(topics[SCENARIOS], numbers, strict=True)
    ]


def _left_out(topics: Mapping[str, Sequence[bytes]]) -> tuple[str, ...]:
    """Say what the bag has not, and what follows from it."""
    said = ["all scenarios of the bag are shown and measured, valid or not; start and end states were not asked"]
    if not topics["map"]:
        said.append("the bag has no map: whether vehicles leave the road was not checked")
    if not topics["changepoints"]:
        said.append("the bag has no changepoints: the template counts as one primitive, and its waits were not asked")
    return (*said, *(request_sentence(account) for account in told_requests(topics[INFO])))
