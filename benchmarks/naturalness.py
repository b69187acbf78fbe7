# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Naturalness: does what is generated drive like what was recorded? Roughness, a classifier's verdict, turns, E, acceptance.

Encounters cut at random from the full recordings (`_naturalness_cuts.py`) and those cut by people, on their own roads (corridor,
and the map of the recording) and on the built-in ones. `--cases 10` takes the first ten on the corridor alone, 20 scenarios each,
for a look within minutes; `--held-out` takes the third of the random cuts that is kept apart, and only that. `--details FILE`
writes a line of JSON per case.

"""

from collections.abc import Sequence
import json
import os
from pathlib import Path
import sys
from typing import Any

import numpy as np

from benchmarks._naturalness_classifier import GROUPS, of_sets, Progress, told_apart, Windows
from benchmarks._naturalness_cuts import Cut, cuts, recorded
from benchmarks._naturalness_generate import Job, Made, run_job
from benchmarks._naturalness_motion import displacement, keeps_turn, roughness, Signals
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row

DATA = Path(
    os.environ.get("SCENARIO_GEN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
)
ROADS = ("four_way", "t_intersection", "straight")
COUNT, FEW = sized((50, 20), quick=(4, 4))
LOGS = sized(None, quick=1)
FLOOR = {
    "jerk": 0.5,
    "lateral jerk": 0.5,
    "lateral": 0.1,
    "yaw acceleration": 0.05,
    "yaw rate": 0.01,
    "acceleration": 0.1,
}
"""What a template's greatest value counts as at least, so that a ratio to it says something."""
SIGNIFICANT = 0.03  # below it, E without changepoints leaves nothing to gain
OWN, OTHERS = "own roads", "other roads"


class Case:
    """What one set comes to: a flat document of figures, and the windows for the classifier."""

    def __init__(self, made: Made, rng: np.random.Generator) -> None:
        self.made = made
        self.kind = OWN if made.own else OTHERS
        self.figures: dict[str, Any] = {
            "name": made.name,
            "road": made.road,
            "own": made.own,
            "refused": made.refused,
        }
        self.windows: Windows | None = None
        self.oracle: Windows | None = None
        if made.refused or made.template is None:
            return
        template, samples = (
            Signals.of(made.template),
            [Signals.of(sample) for sample in made.samples],
        )
        self.figures |= {
            "vehicles": len(template.speed),
            "duration": float(template.time[-1]),
            "changepoints": made.changepoints,
            "manoeuvres": list(made.manoeuvres),
            "acceptance": len(samples) / made.candidates,
            "short": len(samples) < made.asked,
            "seconds": made.seconds,
            "displacement": displacement(samples[:20]),
            "errors": made.errors,
            "said": list(made.said),
        }
        self._motion(template, samples)
        self.windows = of_sets(made.name, template, samples, rng)
        if made.oracle is not None:
            self.oracle = of_sets(made.name, template, [Signals.of(made.oracle)], rng)

    def _motion(self, template: Signals, samples: Sequence[Signals]) -> None:
        """Roughness and turns, samples against template."""
        before = roughness(template)
        each = [roughness(sample) for sample in samples]
        after = {key: np.array([one[key] for one in each]) for key in before}  # (S, N)
        for key, floor in FLOOR.items():
            self.figures[f"{key}: template"] = float(before[key].max())
            self.figures[f"{key}: samples"] = float(np.median(after[key].max(axis=1)))
            self.figures[f"{key}: ratio"] = self.figures[f"{key}: samples"] / max(
                self.figures[f"{key}: template"], floor
            )
            self.figures[f"{key}: vehicles"] = (
                np.median(after[key], axis=0) / np.maximum(before[key], floor)
            ).tolist()
        for key in ("acceleration changes", "lateral changes", "yaw changes"):
            self.figures[f"{key}: template"] = float(before[key].mean())
            self.figures[f"{key}: samples"] = float(after[key].mean())
        extra = after["extrema"] - before["extrema"]
        self.figures["extrema: more"] = float(extra.mean())
        self.figures["extrema: only more"] = float(np.maximum(extra, 0.0).mean())
        kept = np.array([keeps_turn(template, sample) for sample in samples])
        self.figures["turns kept"] = kept.mean(axis=0).tolist()

    def error_ratio(self, key: str, row: str, base: str = "without changepoints") -> float:
        """E of a row over E of another; NaN where one of them is missing or nothing is to be gained."""
        errors = self.figures.get("errors") or {}
        one, other = (errors.get(name, {}).get(key, float("nan")) for name in (row, base))
        return (
            one / other
            if other >= (SIGNIFICANT if base == "without changepoints" else 1e-6)
            else float("nan")
        )

    def line(self) -> str:
        """Return the case in one line."""
        told = self.figures
        head = f"{told['name']:<34} {told['road']:<20}"
        if told["refused"]:
            return f"{head} refused: {told['refused'][:160]}"
        ratios = " ".join(
            f"{told[f'{key}: ratio']:6.2f}"
            for key in ("jerk", "lateral", "lateral jerk", "yaw rate")
        )
        changes = f"{told['acceleration changes: template']:5.1f} {told['acceleration changes: samples']:5.1f}"
        errors = " ".join(
            f"{self.error_ratio(key, 'with changepoints'):5.2f}"
            for key in ("e_position", "e_speed")
        )
        turns = f"{100 * float(np.mean(told['turns kept'])):4.0f}"
        return (
            f"{head} {ratios}  {changes} {told['extrema: more']:+6.2f} {turns}  {told['displacement']:5.2f} {errors} "
            f"{told['changepoints']:3d} {told['acceptance']:5.2f} {told['seconds']:6.1f}"
        )


HEADER = (
    f"{'case':<34} {'road':<20} {'jerk ×':>6} {'lat ×':>6} {'ljrk ×':>6} {'yaw ×':>6}  {'sign t':>5} {'s':>5} {'extrem':>6} "
    f"{'turn%':>4}  {'disp':>5} {'E pos':>5} {'E spd':>5}   K {'acc':>5} {'CPU s':>6}"
)


def run(
    cases: int | None = None,
    roads: str | None = None,
    details: str | None = None,
    variety: str = "wide",
    *,
    held_out: bool = False,
) -> list[Row]:
    """Measure.

    Args:
        cases: take only so many cuts, on the corridor alone unless `roads` says otherwise, 20 scenarios each.
        roads: names, separated by commas; `map` is the map of the recording. Without it all.
        details: file to which a line of JSON per case is written.
        variety: the sampler's preset.
        held_out: take the random cuts that are kept apart.
    """
    chosen = cuts()[1] if held_out else [*cuts()[0], *recorded(DATA)]
    chosen = [
        cut
        for cut in chosen
        if all((DATA / "trajectories" / file).is_file() for file in cut.files)
    ]
    if not chosen:
        return [
            higher(
                "recorded encounters", 0.0, "cases", 1.0, "no recorded data (SCENARIO_GEN_DATA)"
            )
        ]
    names = roads.split(",") if roads else ["corridor"] if cases else ["corridor", "map", *ROADS]
    jobs = [_job(cut, names, FEW if cases else COUNT, variety) for cut in chosen[:LOGS][:cases]]
    rng = np.random.default_rng(0)
    found: list[Case] = []
    print(HEADER, file=sys.stderr, flush=True)
    for job in jobs:
        for made in run_job(job):
            found.append(Case(made, rng))
            print(found[-1].line(), file=sys.stderr, flush=True)
    if details:
        document = [case.figures for case in found]
        Path(details).write_text("".join(json.dumps(_finite(one)) + "\n" for one in document))
    return figures(found)


def _job(cut: Cut, names: Sequence[str], count: int, variety: str) -> Job:
    """Where a cut is read from, and the roads that it is put on."""
    own_map = str(DATA / "maps" / "occupancy_grids" / f"{cut.map}.yaml") if cut.map else ""
    roads = [own_map if name == "map" else name for name in names]
    roads = [name for name in roads if name]
    own = tuple(name in ("corridor", own_map) for name in roads)
    paths = tuple(str(DATA / "trajectories" / file) for file in cut.files)
    return Job(
        cut.name, paths, cut.vehicles, cut.start, cut.end, tuple(roads), own, count, variety
    )


def figures(found: Sequence[Case]) -> list[Row]:
    """Sum the cases up."""
    rows = []
    for kind in (OWN, OTHERS):
        group = [case for case in found if case.kind == kind]
        if group:
            rows += [
                *_motion(group, kind),
                *_classifier(group, kind),
                *_similarity(group, kind),
                *_yield(group, kind),
            ]
    return rows


def _motion(group: Sequence[Case], kind: str) -> list[Row]:
    """Ratios of the greatest values, changes of sign, extrema, turns, displacement."""
    group = [case for case in group if not case.figures["refused"]]
    if not group:
        return []

    def of(key: str) -> list[float]:
        return [case.figures[key] for case in group]

    rows = []
    for key, median, worst in (("jerk", 1.3, 2.6), ("lateral", 1.5, None), ("lateral jerk", 1.5, None), ("yaw rate", 1.5, None),
                               ("yaw acceleration", 1.5, None), ("acceleration", None, None)):  # fmt: skip
        ratios = of(f"{key}: ratio")
        told = f"template {np.median(of(f'{key}: template')):.3g}, samples {np.median(of(f'{key}: samples')):.3g} (medians)"
        rows.append(
            lower(
                f"{kind}: largest {key}, samples / template, median",
                float(np.median(ratios)),
                "×",
                median,
                told,
            )
        )
        last = group[int(np.argmax(ratios))].figures
        told = f"{last['name']} on {last['road']}"
        rows.append(
            lower(
                f"{kind}: largest {key}, samples / template, worst", max(ratios), "×", worst, told
            )
        )
    for key in ("acceleration", "lateral", "yaw"):
        template, samples = (sum(of(f"{key} changes: {who}")) for who in ("template", "samples"))
        ratio = samples / template if template else float("nan")
        told = f"{ratio:.2f} ×; per 10 s: template {template / len(group):.2f}, samples {samples / len(group):.2f}"
        label = f"{kind}: changes of sign of {key}, ratio of means, from 1"
        rows.append(lower(label, abs(ratio - 1.0), "×", 0.15, told))
    rows += [
        lower(
            f"{kind}: extra speed extrema per vehicle",
            float(np.mean(of("extrema: more"))),
            "",
            0.2,
        ),
        lower(
            f"{kind}: the same, fewer not set against more",
            float(np.mean(of("extrema: only more"))),
            "",
        ),
    ]
    turns = [share for case in group for share in case.figures["turns kept"]]
    lost = [
        f"{case.figures['name']} on {case.figures['road']}"
        for case in group
        if min(case.figures["turns kept"]) < 0.5
    ]
    rows.append(
        higher(
            f"{kind}: vehicles with the template's turn",
            float(np.mean(turns)),
            "share",
            0.99,
            ", ".join(lost),
        )
    )
    moved = of("displacement")
    told = f"least {min(moved):.2f} m"
    rows.append(
        higher(
            f"{kind}: displacement without the clock, median",
            float(np.median(moved)),
            "m",
            0.49,
            told,
        )
    )
    return rows


def _classifier(group: Sequence[Case], kind: str) -> list[Row]:
    """The two-sample test, samples and oracle against the cleaned record."""
    rows = []
    sets = [case.windows for case in group if case.windows is not None]
    oracles = [case.oracle for case in group if case.oracle is not None]
    for name, series in GROUPS.items():
        told = told_apart(sets, series, importances=True)
        if told is None:
            continue
        target = 0.7 if kind == OWN else 0.8
        rows.append(
            lower(f"{kind}: classifier, {name}, AUC", told.area, "", target, _explained(told))
        )
        told = told_apart(oracles, series)
        if told is not None:
            rows.append(
                lower(
                    f"{kind}: classifier, {name}, AUC of the oracle",
                    told.area,
                    "",
                    None,
                    f"± {told.error:.3f}",
                )
            )
    return rows


def _explained(told: Progress) -> str:
    return f"± {told.error:.3f}; given away by {told.giveaways() or 'nothing alone'}"


def _similarity(group: Sequence[Case], kind: str) -> list[Row]:
    """Ratios of E, as in the evaluation's benchmark, and K."""
    rows = []
    group = [case for case in group if not case.figures["refused"]]
    targets = {"e_position": (0.1, 0.7), "e_speed": (0.2, 0.9), "e_heading": (None, None)}
    if kind == OTHERS:
        targets |= {"e_position": (0.4, 0.7), "e_speed": (0.25, 0.9)}
    for key, (target, below) in targets.items():
        label = key.replace("e_", "E ")
        with_ = _known([case.error_ratio(key, "with changepoints") for case in group])
        uniform = _known(
            [case.error_ratio(key, "with changepoints", "uniform changepoints") for case in group]
        )
        if not with_:
            continue
        value = float(np.median(with_))
        rows.append(
            lower(
                f"{kind}: {label}, with / without, median",
                value,
                "",
                target,
                f"{len(with_)} cases",
            )
        )
        rows.append(
            higher(
                f"{kind}: {label}, with below without",
                _share(with_),
                "share",
                0.97 if target else None,
            )
        )
        rows.append(
            higher(
                f"{kind}: {label}, below uniform",
                _share(uniform),
                "share",
                below,
                f"{len(uniform)} cases",
            )
        )
    if group:
        numbers = [case.figures["changepoints"] for case in group]
        told = f"{min(numbers)} to {max(numbers)}"
        rows.append(
            lower(
                f"{kind}: K, mean number of changepoints", float(np.mean(numbers)), "", None, told
            )
        )
    return rows


def _known(values: Sequence[float]) -> list[float]:
    return [value for value in values if np.isfinite(value)]


def _share(ratios: Sequence[float]) -> float:
    return float(np.mean([ratio < 1.0 for ratio in ratios])) if ratios else float("nan")


def _yield(group: Sequence[Case], kind: str) -> list[Row]:
    """How many pairs of encounter and road generate, at what acceptance and cost."""
    good = [case for case in group if not case.figures["refused"]]
    refused = [
        f"{case.figures['name']} on {case.figures['road']}"
        for case in group
        if case.figures["refused"]
    ]
    told = (
        f"{len(good)} of {len(group)}; not {', '.join(refused)}"
        if refused
        else f"all {len(group)}"
    )
    rows = [
        higher(
            f"{kind}: encounters and roads that generate",
            len(good) / len(group),
            "share",
            None,
            told,
        )
    ]
    if not good:
        return rows
    acceptance = [case.figures["acceptance"] for case in good]
    short = sum(case.figures["short"] for case in good)
    seconds = [case.figures["seconds"] for case in good]
    return [
        *rows,
        higher(
            f"{kind}: acceptance, median",
            float(np.median(acceptance)),
            "share",
            None,
            f"worst {min(acceptance):.2f}",
        ),
        lower(f"{kind}: sets that stayed short", float(short), "sets", 0.0),
        lower(
            f"{kind}: CPU of one generation, median",
            float(np.median(seconds)),
            "s",
            None,
            f"worst {max(seconds):.1f} s",
        ),
    ]


def _finite(value: Any) -> Any:
    """Return the value as JSON can say it: null for what is not finite."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
