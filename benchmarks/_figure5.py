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

"""Figure 5 of the paper as numbers: every recorded encounter and the three bundled cases, on two or three roads each."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from pathlib import Path
import re
from time import process_time

from scenario_gen.encounter import Encounter
from scenario_gen.errors import InputError, RefusedError
from scenario_gen.evaluation import Case, evaluate, Evaluation, ORACLE, render, replay, ReportInput, UNIFORM, WITH, WITHOUT
from scenario_gen.evaluation.references import linear_changepoints, uniform_changepoints
from scenario_gen.logs import read_log
from scenario_gen.pipeline import Arm, PipelineConfig, run_arm, without_changepoints
from scenario_gen.roads import build_road, Road
from scenario_gen.segmentation import segment, Segmentation

COUNT, SEED = 50, 7
OTHER_ROADS = ("t_intersection", "four_way", "straight")
LINEAR = "best linear pieces"


@dataclass(frozen=True)
class Measured:
    """One encounter on one road: the evaluation of every arm that was not refused, and the CPU seconds of the report."""

    evaluation: Evaluation
    own_road: bool
    seconds: float

    def value(self, arm: str, metric: str) -> float:
        """Return a figure; NaN if the arm was refused."""
        return self.evaluation.value(arm, metric)


def encounters(data: Path) -> Iterator[tuple[Encounter, list[str]]]:
    """Yield encounters with the roads that are their own: the corridor, and the map they were recorded on."""
    bundled = sorted(
        Path(str(path)) for path in (files("scenario_gen") / "resources").iterdir() if path.name.startswith("synthetic")
    )
    for path in [*bundled, *sorted(data.glob("trajectories/*/encounter_*.csv"))]:
        place = re.search(r"(Lanker|Peach)-\d+_\d+", path.name)
        maps = sorted(data.glob(f"maps/occupancy_grids/USA_{place[0]}_*.yaml")) if place else []
        yield read_log(path).encounters[0], ["corridor", *map(str, maps)]


def measure(data: Path, say: Callable[[str], None]) -> Iterator[Measured]:
    """Run every case: own roads all, and of the others the first that fits."""
    config = PipelineConfig()
    for encounter, own in encounters(data):
        segmentation = segment(encounter, config.segmentation, SEED)
        for name in own:
            found = _measure(encounter, segmentation, name, config, say, own_road=True)
            if found:
                yield found
        others = (_measure(encounter, segmentation, name, config, say, own_road=False) for name in OTHER_ROADS)
        first = next((found for found in others if found), None)
        if first:
            yield first


def _measure(
    encounter: Encounter,
    segmentation: Segmentation,
    name: str,
    config: PipelineConfig,
    say: Callable[[str], None],
    *,
    own_road: bool,
) -> Measured | None:
    road, arms = None, {}
    try:
        road = build_road(name, encounter, config.road)
        arms[WITH] = _arm(encounter, segmentation, road, config)
    except (InputError, RefusedError) as error:
        say(f"{encounter.name} on {Path(name).stem}: {error}")
        return None
    makers: dict[str, Callable[[], Segmentation]] = {
        WITHOUT: partial(without_changepoints, segmentation),
        UNIFORM: partial(uniform_changepoints, segmentation),
        LINEAR: partial(linear_changepoints, encounter, segmentation),
    }
    for arm, make in makers.items():
        try:
            arms[arm] = _arm(encounter, make(), road, config)
        except RefusedError as error:
            say(f"{encounter.name} on {road.name}, {arm}: {error}")
    started = process_time()
    oracle = replay(encounter, arms[WITH].fit, road.frame_id)
    rows = {arm: made.scenarios.scenarios for arm, made in arms.items()} | {ORACLE: (oracle,)}
    evaluation = evaluate(encounter, segmentation, rows, road=road.name)
    with_, without = arms[WITH], arms.get(WITHOUT)
    made = without.scenarios if without else None
    case = Case(encounter, segmentation, road, with_.fit, with_.routes, with_.scenarios, made, evaluation, oracle)
    render(ReportInput([case]))
    found = Measured(evaluation, own_road, process_time() - started)
    figures = (f"{arm} {found.value(arm, 'e_position'):.4f} / {found.value(arm, 'e_speed'):.4f}" for arm in (*arms, ORACLE))
    say(f"{encounter.name} on {road.name}, K = {evaluation.changepoints}: " + "; ".join(figures))
    return found


def _arm(encounter: Encounter, segmentation: Segmentation, road: Road, config: PipelineConfig) -> Arm:
    return run_arm(encounter, segmentation, road, config, count=COUNT, seed=SEED)
