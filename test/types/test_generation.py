# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a result gives: its figures of likeness, its scenarios, sums, tables and files."""

from dataclasses import replace

import numpy as np
import pytest
from support.bag_examples import hand_made_run

from scenario_gen import InputError, load
from scenario_gen.situation import EncounterKind
from scenario_gen.types import REPLAY, Vehicle, WITH
from scenario_gen.types.evaluation import Evaluation, Interval, Metric, Row
from scenario_gen.types.generation import GenerationResult
from scenario_gen.types.scenario import dataframe


def evaluated(**figures):
    """A result whose rows have these (E position, E speed)."""
    rows = [
        Row(name, 1, {"e_position": Interval(position), "e_speed": Interval(speed)})
        for name, (position, speed) in figures.items()
    ]
    evaluation = replace(Evaluation.empty(), rows=tuple(rows))
    return GenerationResult(None, None, None, None, (), figures=evaluation)


def test_delivered_set_precedes_the_replay():
    similar = evaluated(**{REPLAY: (0.001, np.nan), WITH: (0.1, 0.2)}).similarity()
    assert list(similar) == [WITH, REPLAY]
    assert similar[WITH] == {"e_position": 0.1, "e_speed": 0.2, "e_heading": None}
    assert similar[REPLAY]["e_speed"] is None
    assert list(evaluated(**{WITH: (0.1, 0.2)}).similarity()) == [WITH]


def test_results_are_counted_and_tabulated():
    """A row for each scenario, vehicle and instant at which it is there; short representations."""
    result = hand_made_run()
    assert (
        len(result) == len(list(result)) == len(result.generated.scenarios)
        and result[1] is result.generated.scenarios[1]
    )
    table = result.to_dataframe()
    assert len(table) == sum(int(scenario.is_present.sum()) for scenario in result)
    assert list(table.columns) == [
        "scenario",
        "vehicle",
        "time",
        "x",
        "y",
        "heading",
        "speed",
        "acceleration",
    ]
    first = result[0]
    own = table[(table.scenario == first.index) & (table.vehicle == first.vehicles[0].id)]
    assert (own[["x", "y"]].to_numpy() == first.position[0][first.is_present[0]]).all()
    assert list(dataframe([]).columns) == list(table.columns)
    for thing in (result, result.generated, first, result.encounter, result.road):
        assert len(repr(thing)) < 120 and repr(thing).startswith(type(thing).__name__)


def test_sum_of_results_is_saved(tmp_path):
    made = hand_made_run()
    both = made + replace(made, seed=5)
    assert len(both) == 2 * len(made)
    assert len({scenario.index for scenario in both}) == len(both)
    assert len(load(both.save(tmp_path / "bag"))) == len(both)
    with pytest.raises(InputError, match="cannot be added"):
        made + replace(made, road=replace(made.road, name="other"))
    with pytest.raises(TypeError):
        made + 1


@pytest.mark.parametrize("k", [10, "a", None])
def test_unknown_scenario_number_is_refused(k):
    with pytest.raises(IndexError, match="a number from 0 to 4 is needed") as refused:
        hand_made_run()[k]
    assert isinstance(refused.value, InputError)


def test_values_are_tables_in_a_notebook():
    made = hand_made_run()
    encounter = replace(made.encounter, vehicles=(Vehicle("<b>"), made.encounter.vehicles[1]))
    assert "<td>&lt;b&gt;</td>" in encounter._repr_html_()
    evaluation = evaluated(**{WITH: (0.1, 0.2)}).evaluation
    shown = replace(evaluation, metrics=(Metric("e_speed", "E speed", "m", "lower", "", ""),))
    assert "<td>E speed [m]</td><td>lower</td><td>0.2</td>" in shown._repr_html_()


def test_drivers_and_ids_are_attributes():
    result = hand_made_run()
    encounter = result.encounter
    assert encounter.reactions and encounter.kind in list(EncounterKind)
    assert result.kind == encounter.kind and result.vehicles == encounter.vehicles
    assert result.reactions == tuple(result.reacting["sentences"])
    first = encounter.vehicles[0]
    assert encounter.vehicles[first.id] is first
    for motion in (encounter, result[0]):
        tables = [motion[vehicle.id] for vehicle in motion.vehicles]
        assert [set(table.vehicle) for table in tables] == [{id_} for id_ in motion.ids]
        assert sum(map(len, tables)) == len(motion.to_dataframe()) and len([*motion]) == len(
            tables
        )
    assert result[1].measures().equals(result.measures().iloc[1])
    assert encounter.measures().braking == -(np.diff(encounter.speed) / encounter.dt).min()
    with pytest.raises(InputError, match=f"no vehicle x; there are {first.id}"):
        encounter.vehicles["x"]
    table = evaluated(**{WITH: (0.1, 0.2)})
    metrics = tuple(Metric(name, name, "", "", "", "") for name in ("e_position", "e_speed"))
    figures = replace(table.evaluation, metrics=metrics).to_dataframe()
    assert figures.loc["e_speed", WITH] == 0.2
