# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Variety: how far the scenarios of crossing encounters spread, and whether targets, orders and choices are met.

The cases were fixed before anything was tuned: the encounters of `_naturalness_cuts.py` (not those held out) and those cut by
people in whose template two vehicles cross or merge, on the corridor and on `four_way`. `--count` natural candidates stand for
brute search (1,000 unless given); `--cases` takes the first encounters only; `--details FILE` writes a line
of JSON per case. PET and TTC of what is published are measured again by `_variety_measures.py`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
import json
import math
from pathlib import Path
import sys
from time import process_time
from typing import Any

import numpy as np

from benchmarks import _variety_measures as independent
from benchmarks._naturalness_cuts import cuts, recorded
from benchmarks._sampling_cases import displacement
from benchmarks._size import sized
from benchmarks.naturalness import DATA
from benchmarks.row import Row
from scenario_gen.base.errors import RefusedError, ScenarioGenError
from scenario_gen.logs import read_log
from scenario_gen.method.evaluation.measures import measure, MEASURES
from scenario_gen.method.fitting import fit_template
from scenario_gen.method.routing import plan_routes
from scenario_gen.method.sampling import (
    Callbacks,
    draw_scenarios,
    Plan,
    relaxed_states,
    SamplingConfig,
)
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import Checker
from scenario_gen.roads import build_road
from scenario_gen.situation.interaction import waits_to_keep
from scenario_gen.types.request import Request
from scenario_gen.types.scenario import Scenario, ScenarioSet
from scenario_gen.types.target import read_targets

CASES = (
    "lanker-2_13-1", "cats-4", "cats-5", "cats-7", "lanker-2_15-3", "lanker-2_8-1", "c_opposite_v2_v4_utc35195",
    "3plus_two_left_turners_one_oppos", "a_cross_one_stops_Lanker-2_15_21", "b_left_turn_vs_opposite_Lanker-2",
)  # fmt: skip
ROADS = sized(("corridor", "four_way"), ("corridor",))
TARGETS = ("pet=0.5..1", "pet=1..2", "pet=2..4", "ttc=1..2")
COUNT, NATURAL, MOST = sized((50, 1000, None), (4, 64, 1))
SLACK = 0.05  # s, by which the independent measure may differ: its instants are 0.01 s apart, its sweeps 0.05 s
OFTEN, RARE = 0.05, 0.001  # shares of natural candidates from and below which the cost is judged


@dataclass(frozen=True, eq=False)
class Case:
    """A template on a road, ready to be sampled."""

    name: str
    given: tuple[Any, ...]
    waits: Any
    states: Any

    @classmethod
    def of(cls, name: str, road_name: str) -> "Case":
        """Read, segment, fit and plan.

        Raises:
            ScenarioGenError: the road cannot be used.
        """
        cut = next(cut for cut in [*cuts()[0], *recorded(DATA)] if cut.name == name)
        encounter = read_log(
            [DATA / "trajectories" / file for file in cut.files], cut.config()
        ).encounters[0]
        road, segmentation = build_road(road_name, encounter), segment(encounter)
        fit = fit_template(encounter, segmentation, road)
        routes = plan_routes(road, fit)
        given = (encounter, segmentation, road, routes)
        return cls(
            f"{name} on {road_name}", given, waits_to_keep(encounter, segmentation), fit.requested
        )

    def sample(
        self,
        request: Request = Request(),
        count: int = COUNT,
        config: SamplingConfig = SamplingConfig(),
        **more: Any,
    ) -> tuple[ScenarioSet, float]:
        """Sample; return the set and the CPU seconds that it took."""
        encounter, segmentation, road, routes = self.given
        asked = relaxed_states(self.states, encounter, config, request)
        begun = process_time()
        check = Checker.of_template(encounter, road, asked, self.waits, None, request.order).check
        plan = Plan(encounter, segmentation, road, routes, asked, self.waits)
        made = draw_scenarios(
            plan, check, config, count=count, request=request, measures=MEASURES, **more
        )
        return made, process_time() - begun


def run(
    cases: int | None = None, count: int | None = None, details: str | None = None
) -> list[Row]:
    """Measure."""
    found: list[dict[str, Any]] = []
    if not (DATA / "trajectories").is_dir():
        return [
            Row(
                "recorded encounters",
                0.0,
                "cases",
                "higher",
                1.0,
                "no recorded data (SCENARIO_GEN_DATA)",
            )
        ]
    refused: list[str] = []
    for name in CASES[: cases or MOST]:
        for road in ROADS:
            try:
                case = Case.of(name, road)
            except ScenarioGenError as error:
                refused.append(f"{name} on {road}: {error}")
                continue
            found.append(_measured(case, count or NATURAL))
            print(json.dumps(_finite(found[-1])), file=sys.stderr, flush=True)
    if details:
        Path(details).write_text("".join(json.dumps(_finite(one)) + "\n" for one in found))
    print("\n".join(refused), file=sys.stderr)
    return _rows([one for one in found if one["valid"]], len(found), len(refused))


def _measured(case: Case, natural: int) -> dict[str, Any]:
    """All figures of one case."""
    case.sample(count=1)  # what is computed once is
    values: dict[str, list[float]] = {"pet": [], "ttc": [], "arrival_gap": []}

    def found(scenario: Scenario, *_: Any) -> None:
        for name, seen in values.items():
            seen.append(measure(scenario, name))

    config = SamplingConfig()
    plain, seconds = case.sample()
    brute, _ = case.sample(
        count=natural, config=replace(config, attempts=1), callbacks=Callbacks(found=found)
    )
    each = {name: np.array(seen) for name, seen in values.items()}
    few = list(plain.scenarios[:COUNT])
    figures: dict[str, Any] = {
        "name": case.name,
        "valid": len(few),
        "acceptance": plain.acceptance,
        "seconds": seconds / max(len(few), 1),
        "arrival sd": _spread([measure(one, "arrival_gap") for one in few], np.std),
        "pet range": _spread([measure(one, "pet") for one in few], np.ptp),
        "pet range, brute": _spread(each["pet"], np.ptp),
        "displacement": displacement(few[:20]) if len(few) > 1 else math.nan,
        "targets": {},
    }
    if not few:
        return figures
    for text in TARGETS:
        figures["targets"][text] = _target(case, text, each, brute.candidates, figures["seconds"])
    figures["swap"], figures["swap said"] = _swap(case)
    return figures


def _target(
    case: Case, text: str, each: dict[str, Any], candidates: int, seconds: float
) -> dict[str, Any]:
    """One target: how many came, how many of them are in the range by the other measure, what it cost, the estimated share."""
    (target,) = read_targets(text)
    hits = int(sum(target.holds(value) for value in each[target.name]))
    share = hits / candidates
    again: Callable[[Scenario], float] = getattr(independent, target.name)
    begun = process_time()
    try:
        made, spent = case.sample(Request(target=text))
    except RefusedError as error:
        return {
            "share": share,
            "hits": hits,
            "published": 0,
            "said": str(error),
            "seconds": process_time() - begun,
        }
    values = [again(one) for one in made.scenarios]
    inside = [bool(target.low - SLACK <= value <= target.high + SLACK) for value in values]
    half = 1.96 * math.sqrt(max(share * (1.0 - share), 1.0 / candidates) / candidates)
    reached = made.reached
    agrees = reached is not None and bool(
        reached.low <= share + half and share - half <= reached.high
    )
    return {
        "share": share, "hits": hits, "published": len(values), "outside": inside.count(False),
        "estimate": None if reached is None else [reached.low, reached.share, reached.high], "agrees": agrees,
        "cost": spent / len(values) / seconds,
    }  # fmt: skip


def _swap(case: Case) -> tuple[int, str]:
    try:
        return len(case.sample(Request(order="swap"))[0].scenarios), ""
    except RefusedError as error:
        return 0, str(error)


def _spread(values: Any, of: Callable[[Any], Any]) -> float:
    known = np.array([value for value in values if math.isfinite(value)])
    return float(of(known)) if len(known) > 1 else math.nan


def _rows(found: list[dict[str, Any]], cases: int, refused: int) -> list[Row]:
    """Sum the cases up."""

    def median(key: str) -> float:
        return float(np.nanmedian([one[key] for one in found]))

    told = f"{cases} cases, {cases - len(found)} without a valid scenario; {refused} not fitted"
    rows = [
        Row(
            "standard deviation of the arrival gap, median",
            median("arrival sd"),
            "s",
            "higher",
            0.8,
            told,
        ),
        Row(
            "range of PET in 50, median",
            median("pet range"),
            "s",
            "higher",
            3.0,
            f"brute: {median('pet range, brute'):.2f} s",
        ),
        Row("displacement without the clock, median", median("displacement"), "m", "higher", 1.0),
        Row("natural valid scenarios a second, median", 1.0 / median("seconds"), "1/s", "higher"),
    ]
    targets = [one["targets"][text] for one in found for text in TARGETS]
    published = [one for one in targets if one["published"]]
    total = sum(one["published"] for one in published)
    outside = sum(one["outside"] for one in published)
    there = [one for one in targets if one["hits"]]
    full = [one["published"] == COUNT for one in there]
    agrees = [one["agrees"] for one in published]
    often = [one["cost"] for one in published if one["share"] >= OFTEN]
    between = [one["cost"] for one in published if RARE <= one["share"] < OFTEN]
    rare = [
        1.0 / max(one["estimate"][1], 1e-9) / one["cost"]
        for one in published
        if one["estimate"][1] < RARE
    ]
    rows += [
        Row(
            "published in the range, by the other measure",
            1.0 - outside / max(total, 1),
            "share",
            "higher",
            1.0,
            f"{total} scenarios",
        ),
        Row(
            "full sets where natural candidates hold one",
            _mean(full),
            "share",
            "higher",
            0.95,
            f"{len(full)} targets",
        ),
        Row(
            "CPU per scenario / natural, share ≥ 5 %, median",
            _median(often),
            "×",
            "lower",
            5.0,
            f"{len(often)} targets",
        ),
        Row("the same, worst", max(often, default=math.nan), "×", "lower", 5.0),
        Row(
            "the same, share 0.1 to 5 %, median",
            _median(between),
            "×",
            "lower",
            None,
            f"{len(between)} targets",
        ),
        Row(
            "cheaper than rejection, share < 0.1 %, least",
            min(rare, default=math.nan),
            "×",
            "higher",
            10.0,
            f"{len(rare)} targets",
        ),
        Row(
            "estimates that agree with natural sampling",
            _mean(agrees),
            "share",
            "higher",
            0.9,
            f"{len(agrees)} targets",
        ),
        Row(
            "crossings whose order is swapped",
            _mean([one["swap"] > 0 for one in found]),
            "share",
            "higher",
            0.7,
        ),
        Row(
            "crossings with a full swapped set",
            _mean([one["swap"] == COUNT for one in found]),
            "share",
            "higher",
        ),
    ]
    return rows


def _mean(values: list[Any]) -> float:
    return float(np.mean(values)) if values else math.nan


def _median(values: list[float]) -> float:
    return float(np.median(values)) if values else math.nan


def _finite(value: Any) -> Any:
    """Replace what JSON cannot say."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, list):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
