# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Measures of each scenario as a table, and the scenarios for which a condition holds."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from support.bag_examples import hand_made_run

from scenario_gen import bundled, InputError, load, measures, read_log


def run_with_distances():
    """Scenario i has its first vehicle i metres nearer to the other one's path."""
    made = hand_made_run()
    scenarios = []
    for i, scenario in enumerate(made):
        position = scenario.position.copy()
        position[0, :, 1] += 0.3 * i
        scenarios.append(replace(scenario, position=position))
    return replace(made, generated=replace(made.generated, scenarios=tuple(scenarios)))


def test_each_scenario_has_its_figures():
    table = measures(run_with_distances())
    assert (
        list(table.scenario) == [0, 1, 2, 3, 4]
        and (table.seconds == 6.0).all()
        and (table.speed == 6.0).all()
    )
    lateral = 4.0 - (1.9 + 2.5) / 2.0
    assert list(table.distance.round(2)) == pytest.approx(
        [lateral - 0.3 * i for i in range(5)], abs=0.02
    )
    assert table.pet.isna().all()  # nobody crosses


def test_condition_filters_scenarios_and_is_noted():
    made = run_with_distances()
    near = made.filter("distance < 1.0")
    assert [scenario.index for scenario in near] == [3, 4]
    assert str(near.generated.adaptations[-1]) == "filtered by 'distance < 1.0': 2 of 5 scenarios"
    assert not near.evaluation.rows and near.coverage is None and len(made) == 5
    assert (
        len(made.filter("pet < 2")) == 0 and len(made.filter("distance < 1.0 or ttc.isna()")) == 5
    )


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_table_is_saved_by_its_suffix(tmp_path, suffix):
    made = hand_made_run()
    read = {"csv": pd.read_csv, "parquet": pd.read_parquet}[suffix]
    table = made.to_dataframe().astype({"vehicle": str})
    saved = read(made.save(tmp_path / "new" / f"m.{suffix}")).astype({"vehicle": str})
    pd.testing.assert_frame_equal(saved, table, check_dtype=False)
    exported = read(made.export(tmp_path / "out", suffix) / f"scenarios.{suffix}")
    assert set(exported["case"]) == {1} and list(exported["scenario"]) == list(table["scenario"])
    assert list(exported["x"]) == pytest.approx(list(table["x"]))
    with pytest.raises(InputError, match="exists; delete it"):
        made.save(tmp_path / "new" / f"m.{suffix}")


def test_bag_and_page_are_single_files(tmp_path):
    made = hand_made_run()
    file, bag = load(made.save(tmp_path / "m.mcap")), load(made.save(tmp_path / "bag"))
    assert len(file) == len(made) and all(map(np.array_equal, file, bag))
    page = made.report(tmp_path / "page.html")
    assert page.read_text().startswith("<!doctype html>")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag", "m.mcap", "page.html"]


def test_encounter_and_table_convert():
    (encounter,) = read_log(bundled("follower")).encounters
    table = encounter.to_dataframe()
    assert (
        list(table.columns) == ["vehicle", "time", "x", "y", "heading", "speed"]
        and len(table) == encounter.speed.size
    )
    (again,) = read_log(table).encounters
    assert again.position == pytest.approx(
        encounter.position, abs=0.1
    ) and again.speed == pytest.approx(encounter.speed, abs=0.2)
    with pytest.raises(InputError, match=r"^the DataFrame has no column for position"):
        read_log(table.drop(columns="x"))


@pytest.mark.parametrize(
    "condition",
    ["", "nearness < 1", "ttc <", "1 + 1", "scenario.sum()", "__import__('os')", "ttc = 2"],
)
def test_bad_conditions_are_refused(condition):
    with pytest.raises(
        InputError, match=r"condition .*; the columns are scenario, seconds, ttc, pet"
    ):
        run_with_distances().filter(condition)
