# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The example package adds a road, a log format, a planner, a metric, a criterion, a type of road users and an export format.

All serve the command and the library.
"""

import json
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

import pytest

from scenario_gen import read_log
from scenario_gen.logs import bundled

ROOT = Path(__file__).resolve().parents[2]
PLUGIN = ROOT / "examples" / "plugin"


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """Run Python with the example package installed, in a folder that holds a log of its format."""
    work = tmp_path_factory.mktemp("plugin")
    shutil.copytree(PLUGIN, work / "source")
    offline = ("--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check")
    target = ("--target", str(work / "installed"), str(work / "source"))
    subprocess.run([sys.executable, "-m", "pip", "install", "-q", *offline, *target], check=True)
    encounter = read_log(bundled("a")).encounters[0]
    with (work / "log.jsonl").open("w") as file:
        for n, vehicle in enumerate(encounter.vehicles):
            for t, (x, y), yaw in zip(
                encounter.time, encounter.position[n], encounter.heading[n], strict=True
            ):
                print(
                    json.dumps({"vehicle": vehicle.id, "t": t, "x": x, "y": y, "heading": yaw}),
                    file=file,
                )
    path = os.pathsep.join([str(work / "installed"), str(ROOT), os.environ.get("PYTHONPATH", "")])

    def run(*arguments):
        variables, command = os.environ | {"PYTHONPATH": path}, [sys.executable, *arguments]
        found = subprocess.run(
            command, cwd=work, env=variables, capture_output=True, text=True, check=False
        )
        assert found.returncode == 0, found.stdout + found.stderr
        return found.stdout

    run.folder = work
    return run


def test_the_command_takes_all_by_name(python):
    options = (
        "--road",
        "skew_crossing",
        "--count",
        "2",
        "--out",
        "out",
        "--set",
        "planning.planner=one_corner",
    )
    said = python(
        "-m", "scenario_gen", "generate", "log.jsonl", *options, "--set", "log.format=json_lines"
    )
    assert "log on skew_crossing" in said
    (evaluation,) = json.loads((python.folder / "out" / "evaluation.json").read_text())["cases"]
    assert (
        evaluation["metrics"][-1]["id"] == "mean_speed" and evaluation["road"] == "skew_crossing"
    )
    rows = {row["name"]: row["values"]["mean_speed"] for row in evaluation["rows"]}
    assert (
        rows["recording"]["value"] > 1.0
        and rows["with changepoints"]["value"] > 0.5 * rows["recording"]["value"]
    )

    idm = ("--planner", "scenario_gen.closed_loop.planners:IdmFollower", "--no-baseline")
    bars = (word for bar in ("goals", "progress") for word in ("--set", f"bars.{bar}=0"))
    python("-m", "scenario_gen", "drive", "out/bag", *idm, *bars, "--set", "criteria=clearance")
    driven = json.loads((python.folder / "out" / "drives" / "drives.json").read_text())
    assert driven["drives"][0]["criteria"] == [
        {"name": "clearance", "value": None, "threshold": 0.5, "met": True}
    ]

    python("-m", "scenario_gen", "export", "out/bag", "--to", "states", "--out", "tables")
    manifest = json.loads((python.folder / "tables" / "export.json").read_text())
    names = [name for entry in manifest["scenarios"] for name in entry["files"]]
    assert manifest["format"] == "states" and len(names) == 2
    assert all(re.fullmatch(r"case_1_\d+\.csv", name) for name in names)
    lines = (python.folder / "tables" / names[0]).read_text().splitlines()
    assert lines[0] == "time,vehicle,x,y,heading,speed" and len(lines) > 100


TYPES = """
import pandas as pd
from scenario_gen import read_log
from scenario_gen.logs import bundled

table = read_log(bundled("a")).encounters[0].to_dataframe()
table["type"] = table["vehicle"].map(dict(zip(table["vehicle"].unique(), ("Cargo-Bike", "car"))))
table["speed"], table["x"], table["y"] = 0.5 * table["speed"], 0.5 * table["x"], 0.5 * table["y"]
bike = read_log(table).encounters[0].vehicles[0]
print(bike.type, bike.length, bike.kind.dynamics.max_speed)
from scenario_gen.base.parameters import assigned, flatten
from scenario_gen.method.config import PipelineConfig

config = PipelineConfig()
for assignment in ("limits.cargo_bike.max_speed=6", "limits.cargo_bike.max_curvature=0.5"):
    config = assigned(config, assignment)
bike = config.limits.of("cargo_bike")
print(bike.max_speed, bike.max_curvature, PipelineConfig().limits.of("cargo_bike").max_speed)
print(flatten(config)["limits.cargo_bike.max_speed"][1])
"""


def test_plugin_type_has_settable_limits(python):
    read, *limits = python("-c", TYPES).splitlines()
    assert read == "cargo_bike 2.6 7.0"
    assert " ".join(limits).split() == ["6.0", "0.5", "7.0", "6.0"]
