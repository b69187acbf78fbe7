# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""An ego slot, start and end states and one scenario again, on the command line."""

import json

import pytest

from msg_conventions.scenarios import decode_scenario
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.logs.synthetic import bundled

LOG = bundled("b")
QUICK = ("--road", "t_intersection", "--seed", "7", "--set", "evaluation.resamples=10")


def test_planner_replaces_a_vehicle(run, tmp_path):
    asked = ("--ego", "1", "--start", "2: 53 4.57 0 9.5")
    code, said = run("generate", LOG, *QUICK, "--count", 2, "--out", "one", *asked)
    assert code == 0, said
    messages = list(read_messages(tmp_path / "one" / "bag"))
    assert {"/ego/start", "/ego/goal", "/ego/witness"} <= {message.topic for message in messages}
    scenarios = [
        decode_scenario(message.data)[1] for message in messages if message.topic == "/scenarios"
    ]
    assert len(scenarios) == 2
    for scenario in scenarios:
        assert [vehicle.id for vehicle in scenario.vehicles] == ["2"]
        assert scenario.position[0, 0] == pytest.approx([53.0, 4.57], abs=0.01)
        assert scenario.speed[0, 0] == pytest.approx(9.5, abs=1e-6)
    page = (tmp_path / "one" / "report.html").read_text()
    assert "Vehicle 1 is left out for a planner under test" in page
    assert run("evaluate", "one")[0] == 0
    assert run("evaluate", "one/bag", "--out", "page")[0] == 0
    assert "Vehicle 1 is left out" in (tmp_path / "page" / "report.html").read_text()
    drive = ("drive", "one/bag", "--planner", "IdmFollower")
    code, said = run(*drive, "--workers", 1, "--out", "driven")
    driven = json.loads((tmp_path / "driven" / "drives.json").read_text())
    assert len(driven["drives"]) == 2, said
    assert run(*drive, "--ego", 2)[0] == 2
    assert run("export", "one/bag", "--to", "commonroad", "--out", "exported")[0] == 0
