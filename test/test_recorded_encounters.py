# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The main job on recorded encounters: valid new scenarios on at least two roads, re-checked by independent means.

The short form takes those that the package ships and few scenarios.
"""

from dataclasses import replace

import pytest
from support.lengths import LOGS, LONG

from benchmarks._recheck import Account, Recheck
from benchmarks._reference_sets import evaluate_with_references, WITHOUT
from scenario_gen.base.errors import RefusedError
from scenario_gen.base.road_users import Dynamics
from scenario_gen.logs import read_log
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.types import NoteKind, WITH
from scenario_gen.types.generation import GenerationResult

ROADS = ("corridor", "four_way", "t_intersection", "straight")
OWN_MAPS = ("USA_Lanker-2_13_T-1", "USA_Peach-4_2_T-1")
COUNT = 50 if LONG else 5
CONFIG = PipelineConfig(evaluation=EvaluationConfig(resamples=1000 if LONG else 10))
NARROW = replace(
    CONFIG,
    sampling=replace(CONFIG.sampling, drivers=0.0),
)
pytestmark = pytest.mark.spread


def recheck(case: GenerationResult) -> dict[str, str]:
    """Return what an independent checker finds wrong with the published scenarios, and the first of each kind."""
    account = Account()
    own = Recheck(
        case.encounter, case.road, case.fit.requested, bool(case.segmentation.changepoints.size)
    )
    own.check(case.generated.scenarios, account)
    return account.first


def assert_sound(case: GenerationResult) -> None:
    """The claims that hold for every generated set."""
    made = case.generated
    assert len(made.scenarios) == COUNT, made.refused
    assert made.candidates == COUNT + sum(made.refused.values())
    assert recheck(case) == {}
    assert len(case.segmentation.changepoints) <= case.encounter.duration / 2.0


def assert_nearer(case: GenerationResult, figure: str, config: PipelineConfig) -> None:
    """Scenarios with changepoints are more like the template than those without."""
    evaluation = evaluate_with_references(case, config)
    with_, without = (evaluation.value(row, figure) for row in (WITH, WITHOUT))
    if without >= 0.03:
        assert with_ < without, (
            f"{figure}: {with_:.3f} with, {without:.3f} without changepoints on {case.road.name}"
        )


def at_the_recorded_pace(case: GenerationResult) -> tuple[GenerationResult, PipelineConfig]:
    """The same with bends taken as fast as recorded, and its parameters.

    E compares at equal shares of the duration, and a clock that is slowed ahead of a bend shifts positions in all rows by more
    than changepoints do.
    """
    fast = replace(NARROW.sampling, bend_acceleration=10.0)
    config = replace(
        NARROW,
        sampling=fast,
        limits=replace(CONFIG.limits, car=Dynamics(max_lateral_acceleration=14.4)),
    )
    made = generate(case.encounter, case.road, config, count=COUNT, seed=7)
    assert made.generated.scenarios and not any(
        note.kind is NoteKind.SLOWED for note in made.generated.adaptations
    )
    return made, config


@pytest.mark.parametrize("path", LOGS)
def test_scenarios_are_valid_on_two_roads(path):
    if "four_vehicles" in path.stem:
        pytest.xfail("four vehicles for 33 s: 4 of 5 scenarios from 800 candidates")
    (encounter,) = read_log(path).encounters
    done, refusals = [], []
    for road in ROADS:
        try:
            case = generate(encounter, road, CONFIG, count=COUNT, seed=7)
        except RefusedError as refusal:
            refusals.append(f"{road}: {refusal}")
            continue
        assert_sound(case)
        done.append(road)
        if len(done) == 2:
            break
    assert len(done) == 2, refusals


@pytest.mark.parametrize("own", OWN_MAPS)
def test_encounters_run_on_own_map(own, data):
    place = own.split("-")[0].removeprefix("USA_")
    path = next(data.glob(f"trajectories/ngsim_commonroad/encounter_*{place}*.csv"))
    (encounter,) = read_log(path).encounters
    case = generate(
        encounter,
        str(data / "maps" / "occupancy_grids" / f"{own}.yaml"),
        NARROW,
        count=COUNT,
        seed=7,
    )
    assert_sound(case)
    assert_nearer(case, "e_speed", NARROW)
    slowed = any(note.kind is NoteKind.SLOWED for note in case.generated.adaptations)
    paced, config = at_the_recorded_pace(case) if slowed else (case, NARROW)
    assert_nearer(paced, "e_position", config)
