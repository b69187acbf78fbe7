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

"""The command `drive`: a bag and a planner in, verdicts and an exit code out."""

import json

from bag_examples import hand_made_run
import pytest
from typer.testing import CliRunner

from scenario_gen.cli import app
from scenario_gen.closed_loop.trials import read_trials
from scenario_gen.errors import InputError
from scenario_gen.recordings.write import write_recording

PLANNER = "scenario_gen.closed_loop.planners:IdmFollower"


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("driven") / "bag", hand_made_run())


def test_a_bag_is_driven_and_the_bars_decide_the_exit_code(bag, tmp_path):
    for bar in (0.0, 1.0):
        words = ["drive", str(bag), "--planner", PLANNER, "--workers", "1", "--count", "2", "--out", str(tmp_path / "out")]
        loose = [f"bars.{name}=1.0" for name in ("collisions", "at_fault", "off_road")]
        sets = [word for value in ("overtime=1.0", f"bars.goals={bar}", *loose) for word in ("--set", value)]
        told = CliRunner().invoke(app, [*words, *sets])
        said = json.loads((tmp_path / "out" / "drives.json").read_text())
        reached = said["summary"]["goals"]["share"] >= bar
        assert told.exit_code == (0 if reached else 1) and ("bars not kept: goals" in told.output) != reached, told.output
        assert len(said["drives"]) == 2 and said["parameters"]["overtime"] == 1.0
        assert (tmp_path / "out" / "junit.xml").is_file() and (tmp_path / "out" / "drives.html").is_file()


def test_an_ego_that_is_not_there_is_named(bag):
    with pytest.raises(InputError, match=r"no vehicle 'nobody' to be the ego; it has "):
        read_trials(bag, "nobody")
