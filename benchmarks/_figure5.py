# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Figure 5 of the paper as numbers: every recorded encounter and the three bundled cases, on two or three roads each."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
import re
from time import process_time

from benchmarks._linear_pieces import linear_changepoints
from benchmarks._size import sized
from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.logs import read_log
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import evaluate_scenarios, replay
from scenario_gen.method.evaluation.references import uniform_changepoints, without_changepoints
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.segmentation import segment
from scenario_gen.output.report.page import render, ReportInput
from scenario_gen.roads import build_road
from scenario_gen.situation import Situation
from scenario_gen.types import REPLAY, UNIFORM, WITH, WITHOUT
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.evaluation import Evaluation
from scenario_gen.types.generation import GenerationResult
from scenario_gen.types.road import Road
from scenario_gen.types.segmentation import Segmentation

COUNT, SEEDS = sized((50, (7, 8, 9)), quick=(4, (7,)))
LOGS = sized(None, quick=1)
OTHER_ROADS = ("t_intersection", "four_way", "straight")
LINEAR = "best linear pieces"


@dataclass(frozen=True, eq=False)
class Measured:
    """One encounter on one road with one seed: the evaluation of every arm that was not refused.

    `seconds` are the CPU seconds of evaluation and report, 0 where no report was made.
    """

    evaluation: Evaluation
    own_road: bool
    seed: int
    seconds: float

    def value(self, arm: str, metric: str) -> float:
        """Return a figure; NaN if the arm was refused."""
        return self.evaluation.value(arm, metric)


def encounters(data: Path) -> Iterator[tuple[Encounter, list[str]]]:
    """Yield encounters with the roads that are their own: the corridor, and the map they were recorded on."""
    bundled = sorted(
        Path(str(path))
        for path in (files("scenario_gen") / "resources").iterdir()
        if path.name.startswith("synthetic")
    )
    for path in [*bundled, *sorted(data.glob("trajectories/*/encounter_*.csv"))][:LOGS]:
        place = re.search(r"(Lanker|Peach)-\d+_\d+", path.name)
        maps = sorted(data.glob(f"maps/occupancy_grids/USA_{place[0]}_*.yaml")) if place else []
        yield read_log(path).encounters[0], ["corridor", *map(str, maps)]


def measure(data: Path, say: Callable[[str], None]) -> Iterator[Measured]:
    """Run every case with every seed: own roads all, and of the others the first that fits."""
    config = PipelineConfig(sampling=SamplingConfig(variety="narrow"))
    for encounter, own in encounters(data):
        segmentation = segment(encounter, config.segmentation, SEEDS[0])
        for name in own:
            yield from _measure(encounter, segmentation, name, config, say, own_road=True)
        others = (
            _measure(encounter, segmentation, name, config, say, own_road=False)
            for name in OTHER_ROADS
        )
        yield from next((found for found in others if found), ())


def _measure(
    encounter: Encounter,
    segmentation: Segmentation,
    name: str,
    config: PipelineConfig,
    say: Callable[[str], None],
    *,
    own_road: bool,
) -> list[Measured]:
    """One case with every seed of planning and sampling; none where the segmenter's arm is refused."""
    try:
        road = build_road(name, encounter, config.road)
        made = {
            seed: Chain(
                Situation.of(encounter), segmentation, road, config, count=COUNT, seed=seed
            ).run()
            for seed in SEEDS
        }
    except (InputError, RefusedError) as error:
        say(f"{encounter.name} on {Path(name).stem}: {error}")
        return []
    references = {
        WITHOUT: without_changepoints(segmentation),
        UNIFORM: uniform_changepoints(segmentation),
        LINEAR: linear_changepoints(encounter, segmentation),
    }
    found = []
    for seed, arm in made.items():
        arms = {WITH: arm}
        for name_of, reference in references.items():
            try:
                arms[name_of] = Chain(
                    Situation.of(encounter),
                    reference,
                    road,
                    config,
                    count=COUNT,
                    seed=seed,
                    waits=(),
                ).run()
            except RefusedError as error:
                say(f"{encounter.name} on {road.name}, seed {seed}, {name_of}: {error}")
        found.append(_evaluated(encounter, arms, road, own_road=own_road, seed=seed))
        values = found[-1].value
        figures = (
            f"{arm} {values(arm, 'e_position'):.4f} / {values(arm, 'e_speed'):.4f}"
            for arm in (*arms, REPLAY)
        )
        say(
            f"{encounter.name} on {road.name}, K = {len(segmentation.changepoints)}, seed {seed}: "
            + "; ".join(figures)
        )
    return found


def _evaluated(
    encounter: Encounter,
    arms: dict[str, GenerationResult],
    road: Road,
    *,
    own_road: bool,
    seed: int,
) -> Measured:
    """Evaluate the arms, and with the first seed make the report too."""
    started = process_time()
    with_ = arms[WITH]
    oracle = replay(encounter, with_.road_and_fit()[1], road.frame_id)
    rows = {arm: made.generated.scenarios for arm, made in arms.items()} | {REPLAY: (oracle,)}
    evaluation = evaluate_scenarios(
        encounter, rows, changepoints=len(with_.segmentation.changepoints), road=road.name
    )
    if seed != SEEDS[0]:
        return Measured(evaluation, own_road, seed, 0.0)
    references = {WITHOUT: arms[WITHOUT].generated} if WITHOUT in arms else {}
    case = replace(with_, references=references, evaluation=evaluation, replay=oracle)
    render(ReportInput([case]))
    return Measured(evaluation, own_road, seed, process_time() - started)
