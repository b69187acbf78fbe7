# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Benchmarks in their quick form, the cheapest or all: each runs, and its last line is one JSON object of what was measured."""

import json
import math
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest
from support.lengths import LONG

from benchmarks.__main__ import names
from benchmarks.row import Row

ROOT = Path(__file__).resolve().parents[2]
WITH_ROS = "start"
CHEAP = ("evaluation",)
pytestmark = pytest.mark.spread


@pytest.mark.parametrize("name", names() if LONG else CHEAP)
def test_last_line_is_json(name):
    if name == WITH_ROS:
        pytest.importorskip("rclpy", reason="rclpy is not in this environment")
    command = [sys.executable, "-m", "benchmarks", name, "--json", "--quick"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    said = json.loads(
        run.stdout.splitlines()[-1], parse_constant=lambda word: pytest.fail(f"{word} is no JSON")
    )
    assert (
        said["benchmark"] == name
        and said["quick"] is True
        and said["machine"]["cores"] >= 1
        and said["rows"]
    )
    for row in said["rows"]:
        assert set(row) == {"id", "value", "unit", "better", "target", "peer", "met"}
        assert row["value"] is None or isinstance(row["value"], float)
        assert row["met"] in (None, True, False) and (row["met"] is None) == (
            row["target"] is None
        )
        assert row["better"] in ("higher", "lower")


@pytest.mark.parametrize(
    "value", [np.float32(2.0), np.int64(2), np.bool_(True), 2, math.nan, math.inf, -math.inf]
)
def test_row_takes_numpy_numbers(value):
    row = Row("a", value, "", "higher", np.float64(1.0)).document()
    assert json.loads(json.dumps(row, allow_nan=False)) == row and row["met"] is bool(value >= 1.0)
    assert type(row["value"]) is (float if math.isfinite(value) else type(None))
