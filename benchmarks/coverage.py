# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How much unseen traffic a few recordings stand for: coverage and precision of what is generated, beside nulls.

Recorded encounters of two vehicles (SCENARIO_GEN_DATA), each on its own road, with default settings and with
`sampling.variety=population` (of the template and the shipped law alone: encounters that are to be reached say nothing), and with
what is generated from their recombinations, too; without data the drawn motions of test/worlds. `_coverage_pairs.json` lists 105:
pairs within 4 s at the shared area or 15 m, of four kinds, whose road keeps the kind. Definitions:
`scenario_gen.method.evaluation.population`. The nulls have as many members and no generator: *shifted* moves each vehicle's
record in time (1 s) and paces it (6 %); *mixed* takes each vehicle from another one of the set; jitters are noise on the features
of the templates. `_coverage_nulls` compares them at equal precision.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
import json
import math
from pathlib import Path
import sys
from typing import Any

import numpy as np

from benchmarks._coverage_nulls import at_precision, jitters, joint_gain, speed_spread
from benchmarks._sampling_cases import DATA
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.base.errors import ScenarioGenError
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation.population import KINDS, Members, members_of
from scenario_gen.method.evaluation.population_result import in_words
from scenario_gen.method.recombination import recombinations
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import road_and_template
from scenario_gen.situation import EncounterKind, Situation
from scenario_gen.types import Encounter, Scenario

PAIRS = Path(__file__).with_name("_coverage_pairs.json")
SEED = 3
COUNT, MOST = sized((50, None), (3, 12))
TEMPLATES, MIDDLE = sized((5, 10, 20), (1,)), sized(10, 1)
SHIFT_S, PACE_RATIO = 1.0, 0.06
TARGETS = {5: 0.48, 10: 0.65, 20: 0.78}
PRECISION_RATIO = 0.95
"""The least precision of the generated over that of the recorded encounters."""


@dataclass(frozen=True)
class Set:
    """An encounter and members that stand for it, as a result has them."""

    encounter: Encounter
    members: tuple[Scenario, ...]

    def __iter__(self) -> Iterator[Scenario]:
        return iter(self.members)


def run() -> list[Row]:
    """Measure."""
    encounters = [
        (name, replace(encounter, name=str(k)))
        for k, (name, encounter) in enumerate(list(_encounters())[:MOST])
    ]
    pairs = recombinations([encounter for _, encounter in encounters], len(encounters) ** 2)[0]
    recombined = [("recombined", encounter) for encounter in pairs]
    rows: list[Row] = []
    for variety in ("wide", "population"):
        made = list(_generated(encounters, variety, COUNT))
        more = list(_generated(recombined, variety, max(COUNT // 5, 1)))
        for setting, beside in ((variety, []), (f"{variety}, recombined", more)):
            rows += _measured(setting, made, beside, np.random.default_rng(1))
    return rows


Made = tuple[str, Encounter, tuple[Scenario, ...]]
"""Recording, encounter and scenarios."""


def _measured(
    setting: str, made: Sequence[Made], recombined: Sequence[Made], rng: np.random.Generator
) -> Iterator[Row]:
    """Yield all rows of a setting; its nulls, from recorded encounters alone, are as large."""
    plain, more = (sum(len(members) for _, _, members in sets) for sets in (made, recombined))
    times = round(1.0 + more / plain)
    shifted = [
        (name, own, tuple(_shifted(own, rng) for _ in range(times * len(members))))
        for name, own, members in made
    ]
    mixed = [
        (name, own, tuple(one for _ in range(times) for one in _mixed(members, rng)))
        for name, own, members in made
    ]
    found, *nulls = (
        members_of([(name, Set(own, members)) for name, own, members in sets])  # type: ignore[misc]
        for sets in ([*made, *recombined], shifted, mixed)
    )
    yield higher(f"{setting}: encounters", len(found.recorded))
    yield higher(f"{setting}: scenarios", len(found.made))
    lost = {(member.template, member.other) for member in found.made if member.kind is None}
    yield lower(f"{setting}: sets that lose the shared area", len(lost), "", 0.0)
    yield from _curve(setting, found)
    yield from _by_kind(setting, found)
    yield from _beside(setting, found, dict(zip(("shifted", "mixed"), nulls, strict=True)), rng)


def _by_kind(setting: str, found: Members) -> Iterator[Row]:
    """Yield coverage and precision with templates of one kind, the weighted mean over kinds."""
    kinds = [own for own in map(found.of_kind, KINDS) if own.recordings > 1]
    for n in TEMPLATES:
        enough = [own for own in kinds if len(own.recorded) >= 2 * n]
        if not enough:
            continue
        shares = np.array([[share.value for share in own.shares(n)] for own in enough])
        weights = [len(own.recorded) for own in enough]
        alone, generated, precision, recorded = np.average(shares, axis=0, weights=weights)
        name, text = f"{setting}: coverage with {n} of a kind", f"templates alone {alone:.2f}"
        yield higher(name, generated, "", TARGETS.get(n), text)
        name, text = f"{setting}: precision with {n} of a kind", f"of the recorded {recorded:.2f}"
        yield higher(name, precision, "", PRECISION_RATIO * recorded, text)


def _curve(setting: str, found: Members) -> Iterator[Row]:
    """Yield the rows of the numbers of templates."""
    for point in found.curve(TEMPLATES):
        n, multiplier = point.templates, point.multiplier
        text = f"{in_words(point.generated)}; templates alone {in_words(point.alone)}"
        name = f"{setting}: coverage with {n}"
        yield higher(name, point.generated.value, "", TARGETS.get(n), text)
        text, recorded = f"of the recorded {in_words(point.recorded)}", point.recorded.value
        least = PRECISION_RATIO * recorded if math.isfinite(recorded) else None
        yield higher(f"{setting}: precision with {n}", point.precision.value, "", least, text)
        text = f"[{multiplier.low:.1f}, {multiplier.high:.1f}] over draws"
        yield higher(f"{setting}: multiplier with {n}", multiplier.value, "", 10.0, text)


def _beside(
    setting: str, found: Members, nulls: Mapping[str, Members], rng: np.random.Generator
) -> Iterator[Row]:
    """Yield the coverage over that of the nulls at equal precision, and the joint features."""
    _, coverage, precision, _ = found.shares(MIDDLE)
    best: tuple[float, str] = (0.0, "")
    label = f"{setting}: coverage with {MIDDLE} at equal precision over"
    for name, null in (*nulls.items(), *jitters(found, rng)):
        equal, reached = at_precision(null, precision.value, MIDDLE)
        text = f"{name} {equal.value:.2f} at {reached.value:.2f}"
        if name in nulls:
            yield higher(f"{label} {name}", coverage.value - equal.value, "", 0.12, text)
        else:
            best = max(best, (equal.value, text))
    yield higher(f"{label} the best jitter", coverage.value - best[0], "", 0.25, best[1])
    for kind, joint in joint_gain(found, nulls["mixed"], MIDDLE).items():
        target = 0.1 if kind is EncounterKind.FOLLOWING else 0.05
        yield higher(f"{setting}: joint precision over mixed, {kind}", joint, "", target)
    spread = speed_spread(found)
    yield higher(f"{setting}: spread of speeds in a set over the recorded", spread, "", 0.4)


def _generated(
    encounters: Sequence[tuple[str, Encounter]], variety: str, count: int
) -> Iterator[Made]:
    """Yield what is generated from each encounter."""
    config = PipelineConfig(sampling=SamplingConfig(variety=variety))
    for name, encounter in encounters:
        try:
            road, template = road_and_template("corridor", encounter, config.road)
            situation = Situation.of(template)
            segmentation = segment(template, config.segmentation, SEED)
            chain = Chain(situation, segmentation, road, config, count=count, seed=SEED)
            yield name, encounter, tuple(chain.run())
        except ScenarioGenError as error:
            print(f"{encounter.name}: {error}", file=sys.stderr)


def _encounters() -> Iterator[tuple[str, Encounter]]:
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


def _shifted(encounter: Encounter, rng: np.random.Generator) -> Scenario:
    """Each vehicle's record, moved in time and paced."""
    time, rows = encounter.time, []
    for n in range(len(encounter.vehicles)):
        pace = 1.0 + PACE_RATIO * rng.standard_normal()
        at = np.clip(time * pace + SHIFT_S * rng.standard_normal(), 0.0, time[-1])
        track = np.column_stack(
            [encounter.position[n], encounter.heading[n], encounter.speed[n] * pace]
        )
        rows.append(np.array([np.interp(at, time, column) for column in track.T]))
    x, y, heading, speed = np.stack(rows, axis=1)
    position = np.stack((x, y), axis=-1)
    return Scenario(
        encounter.vehicles, time, position, heading, speed, np.gradient(speed, time, axis=1)
    )


def _mixed(members: Sequence[Scenario], rng: np.random.Generator) -> Iterator[Scenario]:
    """Yield scenarios whose vehicles come from different members, as long as the shorter one."""
    for _ in members:
        chosen = rng.permutation(len(members))
        own = [members[chosen[n % len(members)]] for n in range(len(members[0].vehicles))]
        count = min(len(one.time) for one in own)
        rows: dict[str, Any] = {
            name: np.stack([getattr(one, name)[n, :count] for n, one in enumerate(own)])
            for name in ("position", "heading", "speed", "acceleration", "present")
        }
        rows["present"] = np.minimum(rows["present"], count - 1)
        yield replace(members[0], time=own[0].time[:count], reference_drive=None, **rows)
