# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Naturalness: do generated vehicles drive like recorded ones?

Encounters cut at random from the full recordings (`_naturalness_cuts.json`) and by people, on
their own roads (the corridor and the map of the recording) and on the built-in ones. `--cases 10`
measures the first ten on the corridor alone, with 20 scenarios each; `--held-out` measures only
the held-out third of the random cuts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
import sys
from time import process_time

import numpy as np

from benchmarks._naturalness_classifier import GROUPS, of_sets, told_apart, Windows
from benchmarks._naturalness_cuts import chosen_cuts, Cut
from benchmarks._naturalness_motion import arrays, displacement, keeps_turn, roughness, Signals
from benchmarks._reference_sets import evaluate_with_references
from benchmarks._sampling_cases import DATA
from benchmarks._similarity import error_rows
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.base.errors import ScenarioGenError
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.evaluation import Evaluation

ROADS = ("four_way", "t_intersection", "straight")
COUNT, COUNT_OF_FIRST_CASES = sized((50, 20), quick=(4, 4))
LOGS = sized(None, quick=1)
SEED = 7
FLOORS = {"jerk": 0.5, "lateral jerk": 0.5, "lateral": 0.1, "yaw rate": 0.01}
"""The least value of a template that a ratio is formed with."""


@dataclass(frozen=True, eq=False)
class Case:
    """One encounter on one road.

    Attributes:
        name: of the encounter.
        road: name of the road.
        own_road: whether the road is the corridor or the map of the recording.
        refused: the reason if there are no scenarios.
        figures: by name.
        windows: input of the classifier.
        evaluation: with the sets to compare with.
    """

    name: str
    road: str
    own_road: bool
    refused: str = ""
    figures: dict[str, float] = field(default_factory=dict)
    windows: Windows | None = None
    evaluation: Evaluation | None = None

    def __str__(self) -> str:
        figures = ", ".join(f"{name} {value:.3g}" for name, value in self.figures.items())
        return f"{self.name} on {self.road}: {self.refused or figures}"


def run(
    cases: int | None = None,
    roads: str | None = None,
    drivers: float = 1.0,
    *,
    held_out: bool = False,
) -> list[Row]:
    """Measure.

    Args:
        cases: only the first cuts, on the corridor alone unless `roads` is given.
        roads: names, separated by commas; `map` is the map of the recording.
        drivers: how much drivers differ.
        held_out: measure only the held-out cuts.
    """
    cuts = chosen_cuts(DATA, held_out=held_out)[:LOGS][:cases]
    names = roads.split(",") if roads else ["corridor"] if cases else ["corridor", "map", *ROADS]
    rng = np.random.default_rng(0)
    found = []
    for cut in cuts:
        for case in _cases(cut, names, COUNT_OF_FIRST_CASES if cases else COUNT, drivers, rng):
            found.append(case)
            print(case, file=sys.stderr, flush=True)
    rows = [higher("recorded encounters", len(cuts), "cases", 1.0)]
    for own_road, label in ((True, "own roads"), (False, "other roads")):
        group = [case for case in found if case.own_road == own_road]
        if group:
            rows += _rows(label, group, own_road=own_road)
    return rows


def _cases(
    cut: Cut, names: Sequence[str], count: int, drivers: float, rng: np.random.Generator
) -> list[Case]:
    """Put one cut on each of its roads."""
    own_map = str(DATA / "maps" / "occupancy_grids" / f"{cut.map}.yaml") if cut.map else ""
    roads = [road for name in names if (road := own_map if name == "map" else name)]
    try:
        encounter = cut.read(DATA)
    except ScenarioGenError as error:
        return [
            Case(cut.name, Path(road).stem, own_road=True, refused=str(error)) for road in roads
        ]
    own_roads = ("corridor", own_map)
    return [
        _case(cut.name, encounter, road, count, drivers, rng, own_road=road in own_roads)
        for road in roads
    ]


def _case(
    name: str,
    encounter: Encounter,
    road: str,
    count: int,
    drivers: float,
    rng: np.random.Generator,
    *,
    own_road: bool,
) -> Case:
    """Generate scenarios and compare their motion with the template's."""
    config = PipelineConfig(
        sampling=SamplingConfig(drivers=drivers),
        evaluation=EvaluationConfig(resamples=10),
    )
    started = process_time()
    try:
        result = generate(encounter, road, config, count=count, seed=SEED)
    except ScenarioGenError as error:
        return Case(name, Path(road).stem, own_road, str(error))
    seconds, scenarios = process_time() - started, result.generated.scenarios
    if len(scenarios) < 2:
        return Case(name, Path(road).stem, own_road, f"{len(scenarios)} scenarios")
    template = Signals.of(arrays(encounter))
    samples = [Signals.of(arrays(scenario)) for scenario in scenarios]
    before, after = roughness(template), [roughness(sample) for sample in samples]
    figures = {
        key: float(np.median([row[key].max() for row in after]) / max(before[key].max(), floor))
        for key, floor in FLOORS.items()
    }
    figures |= {
        "extra extrema": float(np.mean([row["extrema"] - before["extrema"] for row in after])),
        "turns kept": float(np.mean([keeps_turn(template, sample) for sample in samples])),
        "displacement": displacement(samples[:20]),
        "acceptance": result.generated.acceptance,
        "short": float(len(scenarios) < count),
        "seconds": seconds,
    }
    windows = of_sets(name, template, samples, rng)
    evaluation = evaluate_with_references(result, config)
    return Case(name, Path(road).stem, own_road, "", figures, windows, evaluation)


def _rows(label: str, group: Sequence[Case], *, own_road: bool) -> list[Row]:
    """Sum up the cases on own roads or on other roads."""
    good = [case for case in group if not case.refused]
    pairs = f"{len(good)} of {len(group)}"
    rows = [higher(f"{label}: pairs that generate", len(good) / len(group), "share", None, pairs)]
    if not good:
        return rows

    def values(key: str) -> list[float]:
        return [case.figures[key] for case in good]

    def median(key: str) -> float:
        return float(np.median(values(key)))

    for key, target in (("jerk", 1.3), ("lateral", 1.5), ("lateral jerk", 1.5), ("yaw rate", 1.5)):
        name = f"{label}: largest {key}, samples / template"
        worst = f"worst {max(values(key)):.2f}"
        rows.append(lower(f"{name}, median", median(key), "×", target, worst))
    worst = f"worst {min(values('acceptance')):.2f}"
    extrema, turns = np.mean(values("extra extrema")), np.mean(values("turns kept"))
    rows += [
        lower(f"{label}: largest jerk, samples / template, worst", max(values("jerk")), "×", 2.6),
        lower(f"{label}: extra speed extrema per vehicle", float(extrema), "", 0.2),
        higher(f"{label}: vehicles with the template's turn", float(turns), "share", 0.99),
        higher(f"{label}: displacement without the clock", median("displacement"), "m", 0.49),
        higher(f"{label}: acceptance, median", median("acceptance"), "share", None, worst),
        lower(f"{label}: sets with too few scenarios", sum(values("short")), "sets", 0.0),
        lower(f"{label}: CPU of one generation, median", median("seconds"), "s"),
    ]
    sets = [case.windows for case in good if case.windows is not None]
    for name, series in GROUPS.items():
        told = told_apart(sets, series, importances=True)
        if told is not None:
            area = f"± {told.error:.3f}; most telling: {told.giveaways()}"
            target = 0.7 if own_road else 0.8
            rows.append(lower(f"{label}: classifier, {name}, AUC", told.area, "", target, area))
    targets = {"position": 0.1, "speed": 0.2} if own_road else {"position": 0.4, "speed": 0.25}
    evaluations = [case.evaluation for case in good if case.evaluation is not None]
    return rows + error_rows(label, evaluations, targets, 0.97, {"position": 0.7, "speed": 0.9})
