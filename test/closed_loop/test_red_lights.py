# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights in the closed loop: who runs red is convicted, and the others wait."""

import math

from support.signalised import crossing_map, signalised

from scenario_gen import generate, read_log
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.planners import ConstantSpeed, IdmFollower
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.situation import runs_red

SIGNALS = {"road.priority": "signals"}


def test_ignoring_the_light_is_convicted():
    (encounter,) = read_log(signalised()).encounters
    result = generate(encounter, "four_way", SIGNALS, count=3)
    for scenario in result:
        loop = ClosedLoop(scenario, "2", result.road)
        blind = judge(loop, loop.drive(ConstantSpeed()))
        assert 0.0 < blind.ran_red < 6.0 and not blind.passed
        assert f"ran a red light at {blind.ran_red:.2f} s" in blind.sentence()
        assert blind.document()["ran_red"] == blind.ran_red
        obeys = judge(loop, loop.drive(IdmFollower()))
        assert math.isnan(obeys.ran_red) and obeys.passed


class Dawdler(IdmFollower):
    """Drives on so slowly that those behind it meet the next red."""

    def act(self, observation):
        command = super().act(observation)
        slowest = 0.25 if observation.ego.speed < 2.5 else -0.5
        return Command(min(command.acceleration, slowest), command.curvature)


def test_delayed_others_wait_at_red(tmp_path):
    file = tmp_path / "map.xml"
    cycles = ["green:80 yellow:30 red:290", "red:130 green:60 yellow:10 red:200"]
    file.write_text(crossing_map(cycles, queue=2))
    (encounter,) = read_log(file).encounters
    result = generate(encounter, "four_way", SIGNALS, count=2)
    for scenario in result:
        loop = ClosedLoop(scenario, encounter.ids[1], result.road)
        assert {light.state for light in loop.observe(loop.start()).lights} >= {"red", "green"}
        drive = loop.drive(Dawdler(), ended=lambda state: state.step >= 480)
        light = next(light for light in loop.lights if light.id == "12")
        assert math.isnan(runs_red(drive.motion, 2, light, 0.0))
        assert light.crossing(drive.motion, 2) > light.crossing(scenario, 2) + 15.0
        assert drive.forced <= 1
