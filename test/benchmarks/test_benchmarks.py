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
def test_the_last_line_is_one_json_object(name):
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
def test_a_row_takes_the_numbers_of_numpy_and_what_is_not_finite_is_null(value):
    row = Row("a", value, "", "higher", np.float64(1.0)).document()
    assert json.loads(json.dumps(row, allow_nan=False)) == row and row["met"] is bool(value >= 1.0)
    assert type(row["value"]) is (float if math.isfinite(value) else type(None))


STOPPED = """
import os, signal, sys, types
from benchmarks import __main__ as main
from benchmarks.row import Row

def run():
    Row("first", 1.0, "s", "lower")
    {how}
    return [Row("never", 2.0, "s", "lower")]

sys.modules["benchmarks.validity"] = types.SimpleNamespace(run=run)
sys.argv = ["benchmarks", "validity", "--json"]
sys.exit(main.main())
"""


@pytest.mark.parametrize(
    ("how", "why"),
    [
        ("os.kill(os.getpid(), signal.SIGTERM)", "KeyboardInterrupt"),
        ("raise ValueError('peer')", "ValueError: peer"),
    ],
    ids=["signal", "error"],
)
def test_a_benchmark_that_is_stopped_keeps_what_it_has_measured(how, why):
    command = [sys.executable, "-c", STOPPED.replace("{how}", how)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    report = json.loads(run.stdout.splitlines()[-1])
    assert run.returncode != 0 and report["stopped"] == why
    assert [row["id"] for row in report["rows"]] == ["first"]
