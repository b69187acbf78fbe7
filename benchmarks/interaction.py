# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Interaction: do generated vehicles react to one another?

Encounters cut from the full recordings (see `_naturalness_cuts.py`) and the bundled ones, on each
encounter's own road; all pairs that share a lane or a conflict are measured. `--cases 10` measures
the first ten, `--held-out` the held-out third, `--count` sets the scenarios per encounter, `--roads`
names other roads. Intervals: 95 %, bootstrap over encounters.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
import math
import sys
from typing import Any, Literal

import numpy as np

from benchmarks._interaction_measures import (
    following,
    ghosts,
    pair_windows,
    shared,
    tailgates,
    yielding,
)
from benchmarks._naturalness_classifier import windows
from benchmarks._naturalness_cuts import chosen_cuts
from benchmarks._naturalness_motion import arrays, displacement, Signals
from benchmarks._sampling_cases import DATA
from benchmarks._size import sized
from benchmarks.row import higher, Row
from scenario_gen.base.errors import ScenarioGenError
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.chain import Chain
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.segmentation import segment
from scenario_gen.numerics.arrays import Floats
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.roads import build_road
from scenario_gen.situation import Situation
from scenario_gen.types import FOLLOW, Motion, Reaction
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.scenario import Scenario

COUNT = sized(30, quick=4)
LOGS = sized(None, quick=1)
SEED = 7
MIXED_SHIFT_COUNT = 7
"""The two vehicles of a mixed pair come from scenarios whose numbers differ by this."""
RESAMPLES = sized(1000, quick=20)
FOLDS = 5
WINDOWS_RATIO, MAX_WINDOWS_COUNT = 4, 400
"""Generated windows per recorded one, and the most of an encounter, which bounds the cost."""
MIN_GROUPS_COUNT = 3
"""The least number of encounters for an interval."""

Better = Literal["higher", "lower"]
FIGURES: tuple[tuple[str, str, str, Better, float | None], ...] = (
    ("follower's mean speed on its leader's, median slope", "slope", "", "higher", 0.8),
    ("time gap over the template's, 10th percentile", "least gap", "×", "higher", 0.7),
    ("time gap over the template's, 90th percentile", "largest gap", "×", "lower", 1.3),
    ("own part of followers' deviations, median", "own", "share", "higher", 0.05),
    ("drives below 0.3 s behind another, new", "tailgates", "share", "lower", 0.0),
    ("yielder leaves early, mean", "early", "share", "lower", 0.01),
    ("spread of a yielder's lag, median", "spread", "s", "lower", 0.9),
    ("drives with new ghost braking", "ghost drives", "share", "lower", 0.04),
    ("scenarios with new ghost braking", "ghost scenarios", "share", "lower", 0.04),
    ("acceptance, median", "acceptance", "share", "higher", None),
    ("displacement without the clock, median", "displacement", "m", "higher", 1.0),
)
MEANS = ("tailgates", "early", "ghost drives", "ghost scenarios")
"""Figures that are averaged; of the others the median counts."""
CLASSIFIERS: tuple[tuple[str, str, str, Better, float], ...] = (
    ("AUC, pairs against mixed pairs", "together", "mixed", "higher", 0.62),
    ("AUC, pairs against recorded ones", "pairs", "recorded pairs", "lower", 0.6),
    ("AUC, vehicles against recorded ones", "singles", "recorded singles", "lower", 0.62),
)


@dataclass(frozen=True)
class Case:
    """One encounter on one road: values by figure, one per pair or set, and windows by kind."""

    name: str
    figures: dict[str, list[float]] = field(default_factory=dict)
    windows: dict[str, list[Floats]] = field(default_factory=dict)

    def add(self, **values: float) -> None:
        """Add a value to some figures."""
        for name, value in values.items():
            self.figures.setdefault(name.replace("_", " "), []).append(value)


def run(
    cases: int | None = None,
    count: int | None = None,
    drivers: float = 1.0,
    roads: str = "corridor",
    *,
    held_out: bool = False,
) -> list[Row]:
    """Measure; see the module for the arguments."""
    found = []
    encounters = list(_encounters(held_out=held_out))[:LOGS][:cases]
    for name, encounter in encounters:
        for road in roads.split(","):
            try:
                found.append(_case(name, encounter, road, count or COUNT, drivers))
            except ScenarioGenError as error:
                print(f"{name} on {road}: {error}", file=sys.stderr, flush=True)
    share = len(found) / max(len(encounters) * len(roads.split(",")), 1)
    rows = [higher("encounters that generate", share, "share", None, f"{len(encounters)}")]
    for label, key, unit, better, target in FIGURES:
        groups = _groups(found, key)
        if groups:
            statistic = np.nanmean if key in MEANS else np.nanmedian
            value = float(statistic(np.concatenate(groups)))
            rows.append(Row(label, value, unit, better, target, _interval(groups, statistic)))
    for label, key, other, better, target in CLASSIFIERS:
        area = _classifier_area([(case.windows[key], case.windows[other]) for case in found])
        if area is not None:
            rows.append(Row(label, area[0], "", better, target, f"{area[1]:.3f} to {area[2]:.3f}"))
    return rows


def _encounters(*, held_out: bool) -> Iterator[tuple[str, Encounter]]:
    """Yield names and encounters: the recordings with files, and the bundled ones."""
    for cut in chosen_cuts(DATA, held_out=held_out):
        yield cut.name, cut.read(DATA)
    if not held_out:
        for letter in "abc":
            yield f"bundled {letter}", read_log([bundled(letter)]).encounters[0]


def _case(name: str, encounter: Encounter, road_name: str, count: int, drivers: float) -> Case:
    """Generate on a road, and measure.

    Raises:
        ScenarioGenError: the encounter gives no set on this road.
    """
    config, situation = (
        PipelineConfig(sampling=SamplingConfig(drivers=drivers)),
        Situation.of(encounter),
    )
    road = build_road(road_name, encounter, config.road)
    segmentation = segment(encounter, config.segmentation, SEED)
    chain = Chain(situation, segmentation, road, config, count=count, seed=SEED)
    generated = chain.run().generated
    scenarios = list(generated.scenarios)
    if len(scenarios) < 2:
        raise ScenarioGenError(f"{len(scenarios)} scenarios")
    case = Case(name)
    case.add(acceptance=generated.acceptance)
    _add_ghosts(case, encounter, scenarios)
    lanes, others = shared(encounter)
    edges = situation.reactions.edges
    _add_followers(case, encounter, scenarios, edges, lanes)
    for edge in edges:
        if edge.kind != FOLLOW and edge.gap < math.inf:
            measured = yielding(edge, scenarios)
            case.add(early=measured.early, spread=measured.spread)
    signals = [Signals.of(arrays(scenario)) for scenario in scenarios]
    case.add(displacement=displacement(signals[:20]))
    _add_windows(case, encounter, scenarios, [*lanes, *others], signals)
    print(case.name, case.figures, file=sys.stderr, flush=True)
    return case


def _add_ghosts(case: Case, encounter: Encounter, scenarios: Sequence[Scenario]) -> None:
    """Add the shares of drives and of scenarios with ghost braking that the record lacks."""
    vehicles = range(len(encounter.vehicles))
    clean = [n for n in vehicles if ghosts(encounter, n) == 0]
    braking = np.array([[ghosts(scenario, n) > 0 for n in clean] for scenario in scenarios])
    if clean:
        case.add(ghost_drives=float(braking.mean()))
    if len(clean) == len(vehicles):
        case.add(ghost_scenarios=float(braking.any(axis=1).mean()))


def _add_followers(
    case: Case,
    encounter: Encounter,
    scenarios: Sequence[Scenario],
    edges: Sequence[Reaction],
    lanes: Sequence[tuple[int, int]],
) -> None:
    """Add the figures of each pair that shares a lane, with a reaction or without."""
    known = {(edge.who, edge.whom): edge for edge in edges if edge.kind == FOLLOW}
    for who, whom in lanes:
        none = Reaction(FOLLOW, who, whom, math.nan, 1.0, 1.0, 0.0, 0.0, 0.0)
        measured = following(known.get((who, whom), none), encounter, scenarios)
        least, largest = measured.gaps
        case.add(slope=measured.slope, least_gap=least, largest_gap=largest, own=measured.own)
        if not tailgates(encounter, who, whom):
            near = [tailgates(scenario, who, whom) for scenario in scenarios]
            case.add(tailgates=float(np.mean(near)))


def _add_windows(
    case: Case,
    encounter: Encounter,
    scenarios: Sequence[Scenario],
    pairs: Sequence[tuple[int, int]],
    signals: Sequence[Signals],
) -> None:
    """Add the windows of pairs and of single vehicles for the classifiers."""
    together, mixed, recorded = list[Floats](), list[Floats](), list[Floats]()
    for who, whom in pairs:
        for k, scenario in enumerate(scenarios):
            other = scenarios[(k + MIXED_SHIFT_COUNT) % len(scenarios)]
            together += _pair_windows(scenario, whom, scenario, who)
            mixed += _pair_windows(scenario, whom, other, who)
        recorded += _pair_windows(encounter, whom, encounter, who)
    together = _some(together, MAX_WINDOWS_COUNT)
    singles = list(windows(Signals.of(arrays(encounter))))
    generated = [row for signal in signals for row in windows(signal)]
    case.windows.update(
        {
            "together": together,
            "mixed": _some(mixed, MAX_WINDOWS_COUNT),
            "pairs": _some(together, WINDOWS_RATIO * len(recorded)),
            "recorded pairs": recorded,
            "singles": _some(generated, WINDOWS_RATIO * len(singles)),
            "recorded singles": singles,
        }
    )


def _some(rows: list[Floats], most: int) -> list[Floats]:
    """Return at most this number of rows, drawn without replacement."""
    chosen = np.random.default_rng(0).permutation(len(rows))[:most]
    return [rows[k] for k in np.sort(chosen).tolist()]


def _pair_windows(motion: Motion, a: int, other: Motion, b: int) -> list[Floats]:
    """Return windows of a vehicle of one motion beside a vehicle of another one."""
    first = max(int(motion.present[a, 0]), int(other.present[b, 0]))
    last = min(int(motion.present[a, 1]), int(other.present[b, 1])) + 1
    if last - first < 2:
        return []
    position = np.stack([motion.position[a, first:last], other.position[b, first:last]])
    speed = np.stack([motion.speed[a, first:last], other.speed[b, first:last]])
    return list(pair_windows(motion.time[first:last], position, speed))


def _groups(cases: Sequence[Case], key: str) -> list[Floats]:
    """Return the values of a figure, encounter by encounter."""
    groups: dict[str, list[float]] = {}
    for case in cases:
        if key in case.figures:
            groups.setdefault(case.name, []).extend(case.figures[key])
    return [np.array(values) for values in groups.values()]


def _interval(groups: Sequence[Floats], statistic: Callable[..., Any]) -> str:
    """Return the 95 % interval of a figure from resampled encounters."""
    size = f"{sum(map(len, groups))} in {len(groups)} encounters"
    if len(groups) < MIN_GROUPS_COUNT:
        return size
    draws = np.random.default_rng(0).integers(0, len(groups), (RESAMPLES, len(groups)))
    values = [statistic(np.concatenate([groups[k] for k in draw])) for draw in draws.tolist()]
    low, high = np.nanpercentile(values, (2.5, 97.5)).tolist()
    return f"{low:.3g} to {high:.3g}; {size}"


def _classifier_area(
    sets: Sequence[tuple[list[Floats], list[Floats]]],
) -> tuple[float, float, float] | None:
    """Return the area under the curve with its interval; None with too few encounters.

    Boosted trees, cross-validated with whole encounters held out.
    """
    try:
        from sklearn.ensemble import HistGradientBoostingClassifier
        from sklearn.metrics import roc_auc_score
        from threadpoolctl import threadpool_limits
    except ImportError:
        return None
    pairs = [(np.array(one), np.array(other)) for one, other in sets if one and other]
    if len(pairs) < FOLDS:
        return None
    parts = [part for pair in pairs for part in pair]
    sizes = [len(part) for part in parts]
    data = np.concatenate(parts)
    label = np.repeat(np.tile((1, 0), len(pairs)), sizes)
    group = np.repeat(np.repeat(np.arange(len(pairs)), 2), sizes)
    weight = np.repeat(1.0 / np.array(sizes), sizes)
    weight *= len(weight) / weight.sum()
    rng = np.random.default_rng(0)
    score, rounds = np.zeros(len(data)), sized(3, 1)
    with threadpool_limits(1):
        for _ in range(rounds):
            fold = rng.permutation(len(pairs)) % FOLDS
            for k in range(FOLDS):
                test = fold[group] == k
                model = HistGradientBoostingClassifier(
                    max_leaf_nodes=8, max_iter=150, min_samples_leaf=40, random_state=0
                )
                model.fit(data[~test], label[~test], sample_weight=weight[~test])
                score[test] += model.predict_proba(data[test])[:, 1] / rounds
    rows = [np.flatnonzero(group == k) for k in range(len(pairs))]
    areas = np.array([float(roc_auc_score(label[own], score[own])) for own in rows])
    draws = areas[rng.integers(0, len(areas), (RESAMPLES, len(areas)))].mean(axis=1)
    low, high = np.percentile(draws, (2.5, 97.5)).tolist()
    return float(areas.mean()), low, high
