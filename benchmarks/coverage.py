# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How much unseen traffic a few recordings stand for: coverage of what is generated, at one precision, beside nulls.

Recorded encounters of two vehicles (SCENARIO_GEN_DATA), each on its own road: with default
settings (the law is that of the template and the shipped one alone: encounters that are to be
reached say nothing), and with `sampling.decisions=drawn`. Without data the drawn motions of
test/support.

`_coverage_pairs.json` lists 107 pairs within 4 s at the shared area or 15 m, whose road keeps the
kind, in five sessions. A session counts as one recording: unseen encounters are of other sessions.
Definitions: `_coverage_members`, with the radius in which four of five
recorded encounters have another session's one: so 0.8 is the precision of recordings. Coverage is
that of the members nearest to their templates, as many as have a precision of 0.75
(`_coverage_nulls`). *Shifted* moves each vehicle's record in time (1 s) and paces it (6 %), *mixed*
takes each vehicle from another one of the set.
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
    coverage_alone,
    joint_gain,
    kinds_with,
    mixed,
    PRECISION,
    RADIUS_SHARE,
    shares_by_kind,
    shifted,
    speed_spread,
    stands_for,
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
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import road_and_template
from scenario_gen.situation import EncounterKind, Situation
from scenario_gen.types import Encounter, GenerationResult, Request, Scenario

PAIRS = Path(__file__).with_name("_coverage_pairs.json")
SEED = 3
COUNT, STRIDE = sized((30, 1), (8, 4))
TEMPLATES = sized((5, 10), (5,))
TARGETS = {
    "recorded": {5: 0.45, 10: 0.60},
    "drawn": {5: 0.45, 10: 0.60},
}
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
        for k, (session, encounter) in enumerate(list(_encounters())[::STRIDE])
    ]
    rng = np.random.default_rng(1)
    baseline = [
        Set(session, encounter, tuple(shifted(encounter, rng, COUNT)))
        for session, encounter in encounters
    ]
    rows = list(_shares("shifted", _members(baseline), {}))
    for decisions in ("recorded", "drawn"):
        sampling = SamplingConfig(decisions=decisions)
        rows += _measured(decisions, list(_generated(encounters, sampling)), rng)
    return rows


def _members(sets: Sequence[Set]) -> Members:
    """Return the members of sets, with the radius of the benchmark."""
    found = members_of([(one.session, one) for one in sets])
    return replace(found, radius_share=RADIUS_SHARE)


def _measured(setting: str, sets: Sequence[Set], rng: np.random.Generator) -> Iterator[Row]:
    """Yield all rows of a setting of `sampling.decisions`."""
    found = _members(sets)
    yield higher(f"{setting}: encounters", len(found.recorded))
    yield higher(f"{setting}: scenarios", len(found.made))
    lost = {member.template for member in found.made if member.kind is None}
    yield lower(f"{setting}: sets that lose the shared area", len(lost), "", 0.0)
    yield from _shares(setting, found, TARGETS[setting])
    pairs = _members([replace(one, members=tuple(mixed(one.members, rng))) for one in sets])
    gains = joint_gain(found, pairs, TEMPLATES[-1])
    for kind in JOINT_KINDS:
        if kind in gains:
            name = f"{setting}: joint precision over mixed, {kind}"
            yield higher(name, gains[kind], "", JOINT_TARGETS[setting])
    spread = speed_spread(found)
    yield higher(f"{setting}: spread of speeds in a set over the recorded", spread, "", 0.3)


def _shares(setting: str, found: Members, targets: dict[int, float]) -> Iterator[Row]:
    """Yield coverage at PRECISION, and precision, with templates of one kind each."""
    for n in TEMPLATES:
        kinds = kinds_with(found, n)
        if not kinds:
            continue
        alone = coverage_alone(kinds)
        every, kept = shares_by_kind(kinds, n), at_precision(kinds, n)
        text = (
            f"{in_words(kept.coverage)} at precision {kept.precision.value:.2f}, "
            f"{kept.kept:.0%} kept; templates alone {in_words(kept.alone)}"
        )
        name = f"{setting}: coverage with {n} of a kind"
        yield higher(name, kept.coverage.value, "", targets.get(n), text)
        text = f"all scenarios; their coverage {in_words(every.coverage)}"
        name = f"{setting}: precision with {n} of a kind"
        yield higher(name, every.precision.value, "", PRECISION if targets else None, text)
        needed = [stands_for(alone, share) for share in (kept.coverage.low, kept.coverage.high)]
        text = f"[{needed[0]:g}, {needed[1]:g}] over draws; inf: more than there are"
        name = f"{setting}: recordings that cover as much as {n} of a kind"
        yield higher(name, stands_for(alone, kept.coverage.value), "", None, text)


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


def _encounters() -> Iterator[tuple[str, Encounter]]:
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
