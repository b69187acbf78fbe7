# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios on roads with traffic lights: nobody runs red, and states survive a bag."""

from dataclasses import replace
import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from support.signalised import signalised

from scenario_gen import generate, load, read_log, RefusedError
from scenario_gen.method.sampling.lights import PlacedLights
from scenario_gen.method.validity import Checker
from scenario_gen.output.exchange import export_bag
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.situation import Situation
from scenario_gen.types import Facts, SignalSchedule


@pytest.fixture(scope="module")
def result():
    (encounter,) = read_log(signalised(queue=2)).encounters
    return generate(encounter, "four_way", count=12)


def departure(scenario):
    """When vehicle 2 begins to move."""
    moves = scenario.speed[1] > 0.1
    stands = np.flatnonzero(~moves)
    return float(scenario.time[stands[-1]])


def test_states_move_with_the_encounter(result):
    assert len(result) == 12 and result.generated.candidates < 100
    greens = set()
    for scenario in result:
        light = next(light for light in scenario.facts.lights if light.id == "B")
        green = light.schedule.starts[1]
        greens.add(round(green, 3))
        crosses = [light.crossing(scenario, n) for n in range(3)]
        assert math.isnan(crosses[0]) and green < crosses[1] < crosses[2]
        assert crosses[1] - green < 6.0  # about 3.4 s in the recording
        assert departure(scenario) - green == pytest.approx(1.4, abs=0.15)
    assert len(greens) > 6


def test_light_is_known_until_a_crossing(result):
    scenario = result[0]
    (light,) = [light for light in scenario.facts.lights if light.id == "A"]
    crosses = light.crossing(scenario, 0)
    for ends_s, expected in ((0.0, "green"), (1.5, "green"), (2.5, "unknown")):
        schedule = SignalSchedule.of_samples((-60.0,), ("green",), crosses - ends_s)
        placed = PlacedLights((replace(light, schedule=schedule),))
        (shown,) = placed.with_departures(
            scenario.with_facts(Facts(lights=placed.lights))
        ).facts.lights
        assert shown.schedule.at(crosses) == expected


def test_lights_wait_for_mean_departure(result):
    """Two vehicles are 1 s and 0.5 s late, another one so late that it does not count."""
    scenario, cycle = result[0], SignalSchedule.cycle((7.0, 5.0), ("green", "red"))
    late = tuple(SimpleNamespace(lateness=lambda *_, s=s: s) for s in (1.0, 0.5, 9.0))
    (light, *_) = scenario.facts.lights
    placed = PlacedLights((replace(light, schedule=cycle),), 0.0, late)
    (shown,) = placed.with_departures(
        scenario.with_facts(Facts(lights=placed.lights))
    ).facts.lights
    for time in np.arange(0.025, 24.0, 0.05):
        assert shown.schedule.at(time + 0.75) == cycle.at(time)


def test_vehicle_running_red_is_refused(result):
    scenario = result[0]
    early = tuple(
        replace(light, schedule=SignalSchedule.cycle((1.0, 999.0), ("green", "red")))
        for light in scenario.facts.lights
    )
    verdict = Checker(result.road, None, None, None).check(
        [scenario, scenario.with_facts(Facts(lights=early))]
    )
    assert verdict[0].valid
    messages = [violation.message for violation in verdict[1].violations]
    assert messages == [
        "vehicle 1: crosses the stop line of light A at red",
        "vehicle 2: crosses the stop line of light B at red",
        "vehicle 3: crosses the stop line of light B at red",
    ]


def test_a_bag_has_the_states(result, tmp_path):
    result.save(tmp_path / "bag")
    (validation,) = evaluate_bag(tmp_path / "bag")
    assert len(validation.verdicts) == 12 == validation.valid
    again = load(tmp_path / "bag")
    for scenario, other in zip(result, again, strict=True):
        for light, read in zip(scenario.facts.lights, other.facts.lights, strict=True):
            assert (light.id, light.schedule) == (read.id, read.schedule)
            assert np.array_equal(light.line, read.line)
    assert [light.id for light in again.encounter.lights] == ["A", "B"]

    for target, suffix in (("commonroad", "xml"), ("openscenario", "xosc")):
        export_bag(tmp_path / "bag", tmp_path / target, target, indices=[result[0].index])
        (file,) = (tmp_path / target).glob(f"*.{suffix}")
        if target == "commonroad":
            assert_same_states(read_log(file).encounters[0], result[0], 1e-6)
    text = file.read_text()
    assert text.count("<TrafficSignalController ") == 2
    (road,) = (tmp_path / "openscenario").glob("*.xodr")
    for name in re.findall('trafficSignalId="([^"]+)" state="red"', text):
        assert f'<signal id="{name}"' in road.read_text()


def assert_same_states(recorded, scenario, tolerance):
    """Check the states of all lights at all instants but the last one, and their stop lines."""
    assert len(recorded.lights) == 2
    for light in recorded.lights:
        same = min(scenario.facts.lights, key=lambda each: np.abs(each.line - light.line).max())
        assert np.abs(same.line - light.line).max() < tolerance
        np.testing.assert_allclose(same.line.mean(axis=0), light.line.mean(axis=0), atol=1e-6)
        for time in scenario.time[:-1]:
            shown = str(light.schedule.at(time - recorded.start_ns * 1e-9 + 1e-6))
            assert shown.replace("off", "unknown") == same.schedule.at(time)


def test_fixed_program_suits_the_encounter():
    (encounter,) = read_log(signalised(lights=False)).encounters
    config = {"road.priority": "signals", "road.signals": "fixed"}
    result = generate(encounter, "four_way", config, count=5)
    for scenario in result:
        shown = {
            str(light.schedule.at(light.crossing(scenario, n)))
            for light in scenario.facts.lights
            for n in range(2)
            if not math.isnan(light.crossing(scenario, n))
        }
        assert shown <= {"green", "yellow"} and shown
    (recorded,) = read_log(signalised()).encounters
    lit = generate(recorded, "four_way", config, count=3)
    for scenario in lit:
        (light,) = [light for light in scenario.facts.lights if light.id == "B"]
        green = max(
            start
            for start, state in zip(*phases_of(light.schedule), strict=True)
            if state == "green" and start < light.crossing(scenario, 1)
        )
        assert departure(scenario) - green == pytest.approx(1.4, abs=0.15)
    plain = generate(encounter, "four_way", {"road.priority": "signals"}, count=1)
    assert plain[0].facts.lights == ()  # nothing is invented


def phases_of(schedule):
    phases = schedule.between(-100.0, 100.0)
    return phases.starts, phases.states


def test_stop_at_red_needs_a_light():
    (encounter,) = read_log(signalised()).encounters
    lost = "vehicle 2 stops at red, and the road has no light there"
    for road in ("four_way", "corridor"):
        with pytest.raises(RefusedError, match=f"{lost}; fitting.allow=lost_light accepts this"):
            generate(encounter, road, {"road.priority": "none"}, count=1)


def test_a_corridor_has_the_recorded_lights():
    (encounter,) = read_log(signalised()).encounters
    result = generate(encounter, "corridor", count=2)
    assert not result.fit.losses
    for scenario in result:
        assert {light.id for light in scenario.facts.lights} == {"A", "B"}
        (light,) = [light for light in scenario.facts.lights if light.id == "B"]
        assert light.schedule.at(light.crossing(scenario, 1)) == "green"


def test_red_runner_stays_one():
    table = signalised()
    table.loc[(table.vehicle == "1") & (table.signal != ""), "signal"] = "red"
    (encounter,) = read_log(table).encounters
    said = "vehicle 1 crosses its stop line at red"
    assert said in Situation.of(encounter).reactions.sentences(encounter.vehicles)
    for scenario in generate(encounter, "four_way", count=2):
        (light,) = [light for light in scenario.facts.lights if light.id == "A"]
        assert light.schedule.at(light.crossing(scenario, 0)) == "red"
    with pytest.raises(RefusedError, match="at no offset of their cycle"):
        generate(encounter, "four_way", {"road.signals": "fixed"}, count=2)  # 2 waits at red, too
