# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Interaction: do generated vehicles drive with one another? Figures of docs/benchmarks.md, on each encounter's own road.

Encounters cut at random from the full recordings and by people (see `_naturalness_cuts.py`), where they are present, and the
bundled ones; measured are all pairs that share a lane or a conflict, with a reaction or without. `--cases 10` takes the first
ten, `--held-out` the third that is kept apart, `--count` so many scenarios of
each (30), `--details FILE` writes a line of JSON per case, `--variety` takes another preset, `--roads` other
roads, with commas.
Intervals: 95 %, bootstrap over encounters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import json
import math
from pathlib import Path
import sys
from time import process_time
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
from benchmarks._naturalness_cuts import cuts, recorded
from benchmarks._naturalness_motion import displacement, Signals
from benchmarks._size import sized
from benchmarks.naturalness import DATA
from benchmarks.row import higher, Row
from scenario_gen.base.errors import ScenarioGenError
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.chain import Chain
from scenario_gen.method.evaluation.measures import measure
from scenario_gen.method.segmentation import segment
from scenario_gen.numerics.arrays import Floats
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.roads import build_road
from scenario_gen.situation import Situation
from scenario_gen.situation.conflicts import Motion
from scenario_gen.types import FOLLOW, Reaction
from scenario_gen.types.encounter import Encounter

COUNT = sized(30, quick=4)
LOGS = sized(None, quick=1)
SEED, APART = 7, 7  # of a set; how far apart two scenarios are that a mixed pair is of
RESAMPLES = sized(1000, quick=20)
FOLDS = 5
RATIO, MOST = (
    4,
    400,
)  # generated windows for each recorded one; of an encounter in a set, which bounds the cost
_TOLD_APART: tuple[tuple[str, str, str, Literal["higher", "lower"], float | None], ...] = (
    (
        "AUC, pairs that share a lane or a conflict against mixed ones",
        "together",
        "mixed",
        "higher",
        0.62,
    ),
    ("AUC, pairs against recorded ones", "pairs", "recorded_pairs", "lower", 0.6),
    ("AUC, vehicles against recorded ones", "singles", "recorded_singles", "lower", 0.62),
)
_FIGURES = 3  # of an edge, at least, for an interval


@dataclass
class Case:
    """What one encounter comes to.

    Attributes:
        figures: a flat document.
        together, mixed: windows of pairs that share a lane or a conflict, of one scenario and of two (at most `MOST`).
        pairs, recorded_pairs: windows of all pairs, generated (at most `RATIO` for each recorded one) and recorded.
        singles, recorded_singles: the same of single vehicles.
    """

    figures: dict[str, Any]
    together: list[Floats]
    mixed: list[Floats]
    pairs: list[Floats]
    recorded_pairs: list[Floats]
    singles: list[Floats]
    recorded_singles: list[Floats]


def run(
    cases: int | None = None,
    count: int | None = None,
    details: str | None = None,
    variety: str = "wide",
    roads: str = "corridor",
    *,
    held_out: bool = False,
) -> list[Row]:
    """Measure; arguments as said above."""
    found = []
    for name, encounter in list(_encounters(held_out=held_out))[:LOGS][:cases]:
        for road in roads.split(","):
            case = _measured(name, encounter, road, count or COUNT, variety)
            found.append(case)
            print(json.dumps(_finite(case.figures)), file=sys.stderr, flush=True)
    if details:
        Path(details).write_text(
            "".join(json.dumps(_finite(case.figures)) + "\n" for case in found)
        )
    return _rows(found)


def _encounters(*, held_out: bool) -> Any:
    """Yield names and encounters: those of recordings that are there, and the bundled ones."""
    chosen = cuts()[1] if held_out else [*cuts()[0], *recorded(DATA)]
    for cut in chosen:
        paths = [DATA / "trajectories" / file for file in cut.files]
        if all(path.is_file() for path in paths):
            yield (
                cut.name,
                max(read_log(paths, cut.config()).encounters, key=lambda one: one.duration),
            )
    if not held_out:
        for letter in "abc":
            yield f"bundled {letter}", read_log([bundled(letter)]).encounters[0]


def _measured(name: str, encounter: Encounter, road_name: str, count: int, variety: str) -> Case:
    """Generate on a road, and measure."""
    graph = Situation.of(encounter).reactions
    config = PipelineConfig()
    config = replace(config, sampling=replace(config.sampling, variety=variety))
    case = Case(
        {
            "name": name,
            "road": road_name,
            "edges": [edge.document(encounter.vehicles) for edge in graph.edges],
        },
        *([] for _ in range(6)),
    )
    try:
        road, segmentation = (
            build_road(road_name, encounter, config.road),
            segment(encounter, config.segmentation, SEED),
        )
        begun = process_time()
        made = Chain(
            Situation.of(encounter), segmentation, road, config, count=count, seed=SEED
        ).run()
        seconds = process_time() - begun
    except ScenarioGenError as error:
        case.figures["refused"] = str(error)
        return case
    scenarios = list(made.generated.scenarios)
    case.figures |= {
        "scenarios": len(scenarios), "acceptance": made.generated.acceptance, "seconds": seconds,
        "refused by": {cause.value: n for cause, n in made.generated.refused.most_common()},
        "kept": len(made.generated.reactions),
    }  # fmt: skip
    if len(scenarios) < 2:
        case.figures["refused"] = "fewer than two scenarios"
        return case
    clean = [n for n in range(len(encounter.vehicles)) if ghosts(encounter, n) == 0]
    braking = np.array([[ghosts(one, n) > 0 for n in clean] for one in scenarios])
    case.figures |= {"clean drives": braking.size, "ghosts": int(braking.sum())}
    if len(clean) == len(encounter.vehicles):
        case.figures |= {
            "clean scenarios": len(scenarios),
            "haunted": int(braking.any(axis=1).sum()),
        }
    lanes, others = shared(encounter)
    follows = {(edge.who, edge.whom): edge for edge in graph.edges if edge.kind == FOLLOW}
    told: list[dict[str, Any]] = []
    for who, whom in lanes:
        edge = follows.get(
            (who, whom), Reaction(FOLLOW, who, whom, math.nan, 1.0, 1.0, 0.0, 0.0, 0.0)
        )
        measured = following(edge, encounter, scenarios)
        told.append(
            {
                "slope": measured.slope,
                "gaps": measured.gaps,
                "own": measured.own,
                "lag off": measured.lag - edge.lag,
            }
        )
        if not tailgates(encounter, who, whom):
            told[-1]["tailgates"] = sum(tailgates(one, who, whom) for one in scenarios) / len(
                scenarios
            )
    for edge in graph.edges:
        if edge.kind != FOLLOW and edge.gap < math.inf:
            seen = yielding(edge, scenarios)
            told.append(
                {
                    "early": seen.early,
                    "mean": seen.mean,
                    "spread": seen.spread,
                    "template": edge.lag,
                }
            )
    case.figures["figures"] = told
    for who, whom in (*lanes, *others):
        for k, one in enumerate(scenarios):
            case.together += _windows(one, whom, one, who)
            case.mixed += _windows(one, whom, scenarios[(k + APART) % len(scenarios)], who)
        case.recorded_pairs += _windows(encounter, whom, encounter, who)
    signals = [Signals.of(vars(one)) for one in scenarios]
    case.together, case.mixed = _some(case.together, MOST), _some(case.mixed, MOST)
    case.recorded_singles = list(windows(Signals.of(vars(encounter) | {"time": encounter.time})))
    case.pairs = _some(case.together, RATIO * len(case.recorded_pairs))
    case.singles = _some(
        [row for one in signals for row in windows(one)], RATIO * len(case.recorded_singles)
    )
    case.figures["displacement"] = displacement(signals[:20])
    if all(edge.kind == FOLLOW for edge in graph.edges):
        arrivals, pets = (
            np.array([measure(one, name) for one in scenarios]) for name in ("arrival_gap", "pet")
        )
        if np.isfinite(arrivals).any() and np.isfinite(pets).any():
            case.figures |= {
                "arrival": float(np.nanstd(arrivals)),
                "pet": float(np.nanmax(pets) - np.nanmin(pets)),
            }
    return case


def _some(rows: list[Floats], most: int) -> list[Floats]:
    """Return so many rows at most, drawn without putting them back."""
    chosen = np.random.default_rng(0).permutation(len(rows))[:most]
    return [rows[k] for k in np.sort(chosen).tolist()]


def _windows(one: Motion, a: int, other: Motion, b: int) -> list[Floats]:
    """Windows of a vehicle of one scenario beside a vehicle of another one, both from the scenario's start."""
    first = max(int(one.present[a, 0]), int(other.present[b, 0]))
    last = min(int(one.present[a, 1]), int(other.present[b, 1])) + 1
    if last - first < 2:
        return []
    position = np.stack([one.position[a, first:last], other.position[b, first:last]])
    speed = np.stack([one.speed[a, first:last], other.speed[b, first:last]])
    return list(pair_windows(one.time[first:last], position, speed))


def _rows(found: Sequence[Case]) -> list[Row]:
    """Sum the cases up."""
    good = [case for case in found if "figures" in case.figures]
    follows = [
        (case, told) for case in good for told in case.figures["figures"] if "slope" in told
    ]
    yields = [(case, told) for case in good for told in case.figures["figures"] if "early" in told]
    rows = [
        higher(
            "encounters that generate",
            len(good) / max(len(found), 1),
            "share",
            None,
            f"{len(found)} encounters",
        )
    ]

    def row(
        label: str,
        pairs: Any,
        of: Callable[[Any], float],
        unit: str,
        better: Any,
        target: float | None,
    ) -> None:
        if pairs:
            rows.append(
                Row(
                    label,
                    of([told for _, told in pairs]),
                    unit,
                    better,
                    target,
                    _interval(pairs, of),
                )
            )

    row(
        "follower's mean speed on its leader's, median slope",
        follows,
        _median("slope"),
        "",
        "higher",
        0.8,
    )
    row(
        "time gap over the template's, 10th percentile",
        follows,
        _median("gaps", 0),
        "×",
        "higher",
        0.7,
    )
    row(
        "time gap over the template's, 90th percentile",
        follows,
        _median("gaps", 1),
        "×",
        "lower",
        1.3,
    )
    row(
        "lag of followers' deviations off the template's, median",
        follows,
        _median("lag off", None, absolute=True),
        "s",
        "lower",
        0.5,
    )
    row(
        "own part of followers' deviations, median",
        follows,
        _median("own"),
        "share",
        "higher",
        0.05,
    )
    near = [(case, told) for case, told in follows if "tailgates" in told]
    row(
        "drives below 0.3 s behind another where the record is not",
        near,
        _mean("tailgates"),
        "share",
        "lower",
        0.0,
    )
    row(
        "yielder leaves early where the template does not, mean",
        yields,
        _mean("early"),
        "share",
        "lower",
        0.01,
    )
    row("spread of a yielder's lag, median", yields, _median("spread"), "s", "lower", 0.9)
    for what, few, many in (
        ("drives", "ghosts", "clean drives"),
        ("scenarios", "haunted", "clean scenarios"),
    ):
        seen = [(case, case.figures) for case in good if case.figures.get(many)]
        row(
            f"{what} with ghost braking, where the record has none",
            seen,
            _ratio(few, many),
            "share",
            "lower",
            0.04,
        )
    row(
        "acceptance, median",
        [(case, case.figures) for case in good],
        _median("acceptance"),
        "share",
        "higher",
        None,
    )
    free = [(case, case.figures) for case in good if "arrival" in case.figures]
    row(
        "standard deviation of the arrival gap, nobody waits, median",
        free,
        _median("arrival"),
        "s",
        "higher",
        0.8,
    )
    row("range of PET, nobody waits, median", free, _median("pet"), "s", "higher", 3.0)
    row(
        "displacement without the clock, median",
        [(case, case.figures) for case in good],
        _median("displacement"),
        "m",
        "higher",
        1.0,
    )
    for label, kept, other, better, target in _TOLD_APART:
        area = _told_apart([(getattr(case, kept), getattr(case, other)) for case in good])
        if area is not None:
            rows.append(Row(label, area[0], "", better, target, f"{area[1]:.3f} to {area[2]:.3f}"))
    return rows


def _told_apart(
    sets: Sequence[tuple[list[Floats], list[Floats]]],
) -> tuple[float, float, float] | None:
    """Area under the curve with its interval, boosted trees, whole encounters held out; None with too few of them."""
    try:
        from sklearn.ensemble import HistGradientBoostingClassifier
        from sklearn.metrics import roc_auc_score
        from threadpoolctl import threadpool_limits
    except ImportError:
        return None
    sets = [(np.array(one), np.array(other)) for one, other in sets if one and other]  # type: ignore[misc]
    if len(sets) < FOLDS:
        return None
    data = np.concatenate([part for pair in sets for part in pair])
    label = np.concatenate([np.repeat((1, 0), (len(one), len(other))) for one, other in sets])
    group = np.concatenate(
        [np.full(len(one) + len(other), k) for k, (one, other) in enumerate(sets)]
    )
    weight = np.concatenate(
        [np.full(len(part), 1.0 / len(part)) for pair in sets for part in pair]
    )
    weight *= len(weight) / weight.sum()
    rng = np.random.default_rng(0)
    told, rounds = np.zeros(len(data)), sized(3, 1)
    with threadpool_limits(1):
        for _ in range(rounds):
            fold = rng.permutation(len(sets)) % FOLDS
            for k in range(FOLDS):
                test = fold[group] == k
                model = HistGradientBoostingClassifier(
                    max_leaf_nodes=8, max_iter=150, min_samples_leaf=40, random_state=0
                )
                model.fit(data[~test], label[~test], sample_weight=weight[~test])
                told[test] += model.predict_proba(data[test])[:, 1] / rounds
    each = np.array(
        [float(roc_auc_score(label[group == k], told[group == k])) for k in range(len(sets))]
    )
    draws = [float(each[rng.integers(0, len(each), len(each))].mean()) for _ in range(RESAMPLES)]
    return float(each.mean()), float(np.percentile(draws, 2.5)), float(np.percentile(draws, 97.5))


def _median(
    key: str, part: int | None = None, *, absolute: bool = False
) -> Callable[[Any], float]:
    def of(told: Any) -> float:
        values = np.array(
            [one[key] if part is None else one[key][part] for one in told], dtype=float
        )
        return (
            float(np.nanmedian(np.abs(values) if absolute else values))
            if np.isfinite(values).any()
            else math.nan
        )

    return of


def _mean(key: str) -> Callable[[Any], float]:
    return lambda told: float(np.mean([one[key] for one in told]))


def _ratio(key: str, base: str) -> Callable[[Any], float]:
    return lambda told: sum(one[key] for one in told) / sum(one[base] for one in told)


def _interval(pairs: Sequence[tuple[Case, Any]], of: Callable[[Any], float]) -> str:
    """The 95 % interval of a figure: whole encounters are drawn again."""
    rng = np.random.default_rng(0)
    names = sorted({case.figures["name"] for case, _ in pairs})
    groups = [[told for case, told in pairs if case.figures["name"] == name] for name in names]
    if len(groups) < _FIGURES:
        return f"{len(pairs)} in {len(groups)} encounters"
    draws = [
        of([told for k in rng.integers(0, len(groups), len(groups)) for told in groups[k]])
        for _ in range(RESAMPLES)
    ]
    low, high = np.nanpercentile(draws, (2.5, 97.5)).tolist()
    return f"{low:.3g} to {high:.3g}; {len(pairs)} in {len(groups)} encounters"


def _finite(value: Any) -> Any:
    """Replace what JSON cannot say."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
