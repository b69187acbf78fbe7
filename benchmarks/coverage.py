# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How much unseen traffic a few recordings stand for: coverage of what is generated, beside nulls.

Recorded encounters of two vehicles (SCENARIO_GEN_DATA), each on its own road: with default
settings (the law is that of the template and the shipped one alone: encounters that are to be
reached say nothing), and with `sampling.decisions=drawn`. Without data the drawn motions of
test/support.

`_coverage_pairs.json` lists 107 pairs within 4 s at the conflict area or 15 m, whose road keeps
the kind, in five sessions. A session counts as one recording: unseen encounters are of other sessions.
A draw of templates counts if it leaves ten unseen encounters of two sessions. Definitions:
`_coverage_members`, with the radius in which 80 %, or 50 %, of recorded encounters have another
session's one: so 0.8 or 0.5 is the precision of recordings. *Shifted* moves each vehicle's record
in time (1 s), paces it (6 %), cuts both at their ends and keeps the valid ones; of each template's
generated scenarios as many count as there are valid shifted ones. *Mixed* takes each vehicle from
another one of the set.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
import json
from pathlib import Path
import sys

import numpy as np

from benchmarks._coverage_members import in_words, Members, members_of
from benchmarks._coverage_nulls import (
    at_precision,
    joint_gain,
    kinds_with,
    mixed,
    RADIUS_SHARES,
    shares_by_kind,
    shifted,
    speed_spread,
)
from benchmarks._sampling_cases import DATA
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.base.errors import RefusedError, ScenarioGenError
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.outcome_sets import for_one_set, outcome_sets
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.sampling.filters import CheckScenarios
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import Checker
from scenario_gen.roads import road_and_template
from scenario_gen.situation import EncounterKind, Situation
from scenario_gen.types import Encounter, GenerationResult, Request, Scenario

PAIRS = Path(__file__).with_name("_coverage_pairs.json")
SEED = 3
COUNT, STRIDE = sized((30, 1), (8, 4))
TEMPLATES = sized((5, 10), (5,))
GAIN_TARGET, PRECISION_TARGET = 0.15, 0.06  # over valid shifted records
JOINT_TARGETS = {"recorded": 0.05, "drawn": 0.08}
JOINT_KINDS = (
    EncounterKind.CROSSING,
    EncounterKind.LEFT_TURN,
    EncounterKind.MERGING,
    EncounterKind.FOLLOWING,
)


@dataclass(frozen=True)
class Set:
    """An encounter, its session and members that stand for it, as a result has them."""

    session: str
    encounter: Encounter
    members: tuple[Scenario, ...]

    def __iter__(self) -> Iterator[Scenario]:
        return iter(self.members)


def run() -> list[Row]:
    """Measure."""
    encounters = [
        (session, replace(encounter, name=str(k)))
        for k, (session, encounter) in enumerate(list(recorded_pairs())[::STRIDE])
    ]
    rng = np.random.default_rng(1)
    null = list(_shifted(encounters, rng))
    counts = {one.encounter.name: len(one.members) for one in null}
    rows = [higher("shifted: valid scenarios", sum(counts.values()))]
    for decisions in ("recorded", "drawn"):
        sampling = SamplingConfig(decisions=decisions)
        sets = list(_generated(encounters, sampling))
        rows += _measured(decisions, sets, rng)
        if decisions == "recorded":
            equal = [
                replace(one, members=one.members[: counts.get(one.encounter.name, 0)])
                for one in sets
            ]
            for radius_share in RADIUS_SHARES:
                found = [_members(each, radius_share) for each in (equal, null)]
                rows += _beside(found[0], found[1])
    return rows


def _shifted(
    encounters: Sequence[tuple[str, Encounter]], rng: np.random.Generator
) -> Iterator[Set]:
    """Yield the valid shifted records of each encounter on its own road."""
    for session, encounter in encounters:
        try:
            yield Set(session, encounter, tuple(shifted(encounter, _check(encounter), rng, COUNT)))
        except ScenarioGenError as error:
            print(f"{encounter.name}: {error}", file=sys.stderr)


def _check(encounter: Encounter) -> CheckScenarios:
    """Return the check of shifted records, of which no states are requested.

    Raises:
        ScenarioGenError: the encounter has no road.
    """
    config = PipelineConfig()
    road, template = road_and_template("corridor", encounter, config.road)
    situation = Situation.of(template)
    checker = Checker(
        road,
        None,
        situation.conflicts,
        (),
        config.limits.for_template(situation),
        reactions=situation.reactions.edges,
        lane_gaps=situation.lane_gaps,
    )
    return lambda scenarios, *is_enough: checker.check(
        [replace(scenario, frame_id=road.frame_id) for scenario in scenarios], *is_enough
    )


def _members(sets: Sequence[Set], radius_share: float = RADIUS_SHARES[0]) -> Members:
    """Return the members of sets, with a radius of the benchmark."""
    found = members_of([(one.session, one) for one in sets])
    return replace(found, radius_share=radius_share)


def _measured(setting: str, sets: Sequence[Set], rng: np.random.Generator) -> Iterator[Row]:
    """Yield the rows of a setting of `sampling.decisions`."""
    found = _members(sets)
    yield higher(f"{setting}: encounters", len(found.recorded))
    yield higher(f"{setting}: scenarios", len(found.made))
    lost = {member.template for member in found.made if member.kind is None}
    yield lower(f"{setting}: sets that lose the conflict area", len(lost), "", 0.0)
    for n in TEMPLATES:
        for one in kinds_with(found, n):
            name, shares = f"{one.recorded[0].kind}, {n} templates", shares_by_kind([one], n)
            text = f"{in_words(shares.coverage)}; templates alone {in_words(shares.alone)}"
            yield higher(f"{setting}: coverage, {name}", shares.coverage.value, "", None, text)
            text = in_words(shares.precision)
            yield higher(f"{setting}: precision, {name}", shares.precision.value, "", None, text)
    pairs = _members([replace(one, members=tuple(mixed(one.members, rng))) for one in sets])
    gains = joint_gain(found, pairs, TEMPLATES[-1])
    for kind in JOINT_KINDS:
        if kind in gains:
            name = f"{setting}: joint precision over mixed, {kind}"
            yield higher(name, gains[kind], "", JOINT_TARGETS[setting])
    spread = speed_spread(found)
    yield higher(f"{setting}: spread of speeds in a set over the recorded", spread, "", 0.3)


def _beside(found: Members, null: Members) -> Iterator[Row]:
    """Yield by kind what is generated minus valid shifted records, also at one precision."""
    for n in TEMPLATES:
        pairs = (
            (kind, null.of_kind(kind.recorded[0].kind or "")) for kind in kinds_with(found, n)
        )
        for kind, other in pairs:
            both = [shares_by_kind([each], n) for each in (kind, other)]
            best = max(each.precision.value for each in both)
            matched = [at_precision([each], n, best) for each in (kind, other)]
            name = f"{kind.recorded[0].kind}, {n} templates, radius {found.radius_share:g}"
            text = " against ".join(in_words(each.coverage) for each in both)
            gain = both[0].coverage.value - both[1].coverage.value
            yield higher(f"coverage over shifted, {name}", gain, "", GAIN_TARGET, text)
            text = " against ".join(in_words(each.precision) for each in both)
            gain = both[0].precision.value - both[1].precision.value
            yield higher(f"precision over shifted, {name}", gain, "", PRECISION_TARGET, text)
            kept = " and ".join(f"{each.kept:.0%}" for each in matched)
            text = f"at precision {best:.2f}, {kept} kept"
            gain = matched[0].coverage.value - matched[1].coverage.value
            yield higher(f"coverage over shifted at one precision, {name}", gain, "", None, text)


def _generated(
    encounters: Sequence[tuple[str, Encounter]], sampling: SamplingConfig
) -> Iterator[Set]:
    """Yield what is generated from each encounter; drawn outcomes belong to its set."""
    for session, encounter in encounters:
        generate = partial(_generated_set, sampling)
        try:
            results = outcome_sets(generate, encounter, sampling, Request(), COUNT, SEED)
        except ScenarioGenError as error:
            print(f"{encounter.name}: {error}", file=sys.stderr)
            continue
        others = [result for result in results if result.encounter.name != encounter.name]
        recorded = [one for result in results if result not in others for one in result]
        yield Set(session, encounter, tuple(recorded))
        yield from (Set(session, result.encounter, tuple(result)) for result in others)


def _generated_set(sampling: SamplingConfig, encounter: Encounter, count: int) -> GenerationResult:
    config = PipelineConfig(sampling=for_one_set(sampling, encounter))
    road, template = road_and_template("corridor", encounter, config.road)
    segmentation = segment(template, config.segmentation, SEED)
    situation = Situation.of(template)
    result = Chain(situation, segmentation, road, config, count=count, seed=SEED).run()
    if not len(result):
        raise RefusedError("no valid candidate")
    return result


def recorded_pairs() -> Iterator[tuple[str, Encounter]]:
    """Yield the encounters with the names of their sessions."""
    if not (DATA / "trajectories").is_dir():
        sys.path.append(str(Path(__file__).resolve().parents[1] / "test"))
        drawn = import_module("support.textbook_motions")
        yield from (
            (f"drawn {seed}", drawn.labelled(kind, seed).encounter)
            for kind in drawn.REACTIONS
            for seed in range(3)
        )
        return
    for row in json.loads(PAIRS.read_text()):
        config = LogConfig(vehicles=",".join(row["vehicles"]), start=row["start"], end=row["end"])
        files = [DATA / "trajectories" / file for file in row["files"]]
        yield row["name"], read_log(files, config).encounters[0]
