# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A window of a large log is what cutting the whole log gives."""

import numpy as np
import pandas as pd
import pytest
from support.log_builders import crossing, save

from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, read_log, table_window

WINDOW = {"start": 2.0, "end": 10.0}


@pytest.fixture
def small_blocks(monkeypatch):
    monkeypatch.setattr(table_window, "LARGE_BYTES", 0)
    monkeypatch.setattr(table_window, "_BLOCK_ROWS", 50)


@pytest.mark.parametrize("order", ["time", "vehicle"])
def test_the_window_of_a_large_table_is_that_of_the_whole_one(tmp_path, monkeypatch, order):
    rows = crossing().sort_values(
        ["t_s", "vehicle_id"] if order == "time" else ["vehicle_id", "t_s"]
    )
    rows["t_s"] = pd.to_datetime(rows["t_s"], unit="s", utc=True).astype(str)
    path = save(rows, tmp_path)
    whole = read_log(path, LogConfig(**WINDOW))
    monkeypatch.setattr(table_window, "LARGE_BYTES", 0)
    monkeypatch.setattr(table_window, "_BLOCK_ROWS", 50)
    part = read_log(path, LogConfig(**WINDOW, row_limit=len(rows) - 1))
    for (a,), (b,) in ((whole.encounters, part.encounters),):
        assert a.start_ns == b.start_ns
        np.testing.assert_array_equal(a.position, b.position)
        np.testing.assert_array_equal(a.speed, b.speed)
    assert part.quality.rows < whole.quality.rows


@pytest.mark.usefixtures("small_blocks")
def test_a_faulty_row_in_the_window_is_named_by_its_line(tmp_path):
    rows = crossing().astype({"x_m": object})
    rows.loc[100, "x_m"] = "broken"
    quality = read_log(save(rows, tmp_path), LogConfig(**WINDOW)).quality
    assert any("line 102" in str(drop) for drop in quality.dropped), quality.dropped


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: (10 * t).round().astype(int), "whole numbers without a unit"),
        (lambda t: pd.to_datetime(t, unit="s").dt.strftime("%H:%M:%S.%f"), "no date"),
    ],
    ids=["frames", "times of the day"],
)
def test_stamps_that_do_not_tell_the_window_are_refused(tmp_path, change, said):
    rows = crossing()
    rows["t_s"] = change(rows["t_s"])
    with pytest.raises(InputError, match=said):
        read_log(save(rows.rename(columns={"t_s": "t"}), tmp_path), LogConfig(**WINDOW))


@pytest.mark.usefixtures("small_blocks")
def test_the_limit_of_rows_is_that_of_the_window(tmp_path):
    with pytest.raises(InputError, match=r"in the window has at least .* rows"):
        read_log(save(crossing(), tmp_path), LogConfig(**WINDOW, row_limit=20))
