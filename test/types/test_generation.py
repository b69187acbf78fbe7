# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which set stands first, with what it is compared, and what is said where a reference does better."""

from dataclasses import replace

import numpy as np
import pytest
from support.bag_examples import hand_made_run

from scenario_gen import InputError, load
from scenario_gen.types import ONE_DRIVER, REPLAY, UNIFORM, Vehicle, WITH, WITHOUT
from scenario_gen.types.evaluation import Evaluation, Interval, Metric, Row
from scenario_gen.types.generation import GenerationResult
from scenario_gen.types.scenario import dataframe, ScenarioSet


def result(**figures):
    """A result whose rows have these (E position, E speed); of references there are those that are given."""
    names = {
        "own": WITH,
        "without": WITHOUT,
        "uniform": UNIFORM,
        "narrow": ONE_DRIVER,
        "replay": REPLAY,
    }
    rows = [
        Row(names[key], 1, {"e_position": Interval(position), "e_speed": Interval(speed)})
        for key, (position, speed) in figures.items()
    ]
    references = {
        names[key]: ScenarioSet(1, (), 1)
        for key in figures
        if key in ("without", "uniform", "narrow")
    }
    evaluation = replace(Evaluation.empty(), rows=tuple(rows))
    return GenerationResult(
        None, None, None, None, (), evaluation=evaluation, references=references
    )


FIVE = {
    "own": (0.1, 0.2),
    "without": (0.3, 0.4),
    "uniform": (0.08, 0.2),
    "narrow": (0.01, 0.02),
    "replay": (0.001, 0.002),
}


def test_the_delivered_set_stands_first_and_only_what_is_drawn_likewise_is_compared():
    similar = result(**FIVE).similarity()
    assert list(similar["compared"]) == [WITH, WITHOUT, UNIFORM]
    assert similar["compared"][WITH] == {"e_position": 0.1, "e_speed": 0.2, "e_heading": None}
    assert list(similar["beside"]) == [
        ONE_DRIVER,
        REPLAY,
    ]  # nearer, and no match for it: they have less freedom, or none


def test_a_reference_that_does_better_is_said_with_both_figures():
    made = result(**FIVE)
    assert made.best("e_position") == UNIFORM
    assert made.better_references() == (
        "evenly spaced changepoints keep it better here: E position 0.080 against 0.100",
    )
    assert made.best("e_speed") == WITH, "equal is not better"
    worse = result(own=(0.1, 0.2), without=(0.05, 0.1)).better_references()
    assert worse == (
        "no changepoints at all keep it better here: E position 0.050 against 0.100, E speed 0.100 against 0.200",
    )


def test_what_does_not_show_in_three_digits_is_not_said():
    assert result(own=(0.1001, 0.2), without=(0.1, 0.3)).better_references() == ()


@pytest.mark.parametrize(
    "missing",
    [{"own": (np.nan, np.nan)}, {"without": (np.nan, np.nan), "uniform": (np.nan, np.nan)}],
)
def test_where_there_is_no_figure_nothing_is_best(missing):
    made = result(**{**{key: FIVE[key] for key in ("own", "without")}, **missing})
    assert made.better_references() == () and made.best("e_heading") == ""
    assert made.similarity()["said"] == []


def test_what_was_asked_of_the_delivered_set_alone_takes_it_out_of_the_comparison():
    made = replace(
        result(**FIVE), not_compared="only the delivered set was drawn with target as requested"
    )
    similar = made.similarity()
    assert list(similar["compared"]) == [WITH] and list(similar["beside"]) == [
        WITHOUT,
        UNIFORM,
        ONE_DRIVER,
        REPLAY,
    ]
    assert similar["best"] == {}
    assert similar["said"] == [
        "nothing is compared: only the delivered set was drawn with target as requested"
    ]


def test_results_are_counted_indexed_and_made_a_table():
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


def test_the_sum_of_two_results_is_saved_and_read_as_one(tmp_path):
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
def test_a_number_that_no_scenario_has_is_refused_in_a_line(k):
    with pytest.raises(IndexError, match="a number from 0 to 4 is needed") as refused:
        hand_made_run()[k]
    assert isinstance(refused.value, InputError)


def test_values_are_tables_in_a_notebook():
    made = hand_made_run()
    encounter = replace(made.encounter, vehicles=(Vehicle("<b>"), made.encounter.vehicles[1]))
    assert "<td>&lt;b&gt;</td>" in encounter._repr_html_()
    evaluation = result(**FIVE).evaluation
    shown = replace(evaluation, metrics=(Metric("e_speed", "E speed", "m", "lower", "", ""),))
    assert "<td>E speed [m]</td><td>lower</td><td>0.2</td>" in shown._repr_html_()


def test_a_result_is_exported_for_other_software(tmp_path):
    folder = hand_made_run().export(tmp_path / "files", "openscenario")
    assert len(list(folder.glob("*.xosc"))) == 5
    with pytest.raises(InputError, match="choose one of commonroad"):
        hand_made_run().export(tmp_path / "other", "oops")
