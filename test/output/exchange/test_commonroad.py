# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""CommonRoad files: the schema's rules, the motion to the nanometre, the ego's problem; and back again as a log."""

from dataclasses import replace
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from support.small_scenarios import case_of, crossing, observed, one_vehicle

from scenario_gen.base.errors import RefusedError
from scenario_gen.output.exchange.commonroad import write_commonroad
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.roads import read_network
from scenario_gen.types import Lane, LaneNetwork, RuleKind, TrafficRule


def written(tmp_path, scenario, ego=None, export=ExportConfig()):
    data, notes = write_commonroad(*case_of(scenario, ego), export)
    path = tmp_path / "one.xml"
    path.write_bytes(data)
    assert data == write_commonroad(*case_of(scenario, ego), export)[0]
    return path, ET.fromstring(data), notes


def number(element, way):
    return float(element.find(way).text)


def place(element, way="position/point"):
    return [number(element, f"{way}/{axis}") for axis in "xy"]


def test_the_structure_is_that_of_2020a(tmp_path):
    _, root, notes = written(tmp_path, crossing())
    assert notes == ()
    assert (
        root.attrib["commonRoadVersion"] == "2020a"
        and root.attrib["benchmarkID"] == "ZAM_SomeRoad-1_4_T-1"
    )
    assert root.attrib["date"] == "2026-01-01" and float(root.attrib["timeStepSize"]) == 0.1
    tags = list(dict.fromkeys(child.tag for child in root))
    assert tags == [
        "location",
        "scenarioTags",
        "lanelet",
        "dynamicObstacle",
        "planningProblem",
    ]  # the schema's sequence
    ids = [element.attrib["id"] for element in root if "id" in element.attrib]
    assert len(ids) == len(set(ids)) and {
        element.attrib["ref"] for element in root.iter() if "ref" in element.attrib
    } <= set(ids)
    for lanelet in root.iter("lanelet"):
        assert (
            len(lanelet.findall("leftBound/point"))
            == len(lanelet.findall("rightBound/point"))
            >= 2
        )
    assert all(
        "e" not in element.text.lower()
        for element in root.iter()
        if element.tag in ("x", "y", "exact")
    )  # xs:decimal


def test_obstacles_are_at_their_centres(tmp_path):
    scenario = crossing(present=[[0, 60], [0, 41]])
    _, root, _ = written(tmp_path, scenario)
    for n, obstacle in enumerate(root.iter("dynamicObstacle")):
        states = [obstacle.find("initialState"), *obstacle.findall("trajectory/state")]
        assert len(states) == scenario.present[n, 1] + 1  # who leaves early is gone then
        assert number(obstacle, "shape/rectangle/length") == pytest.approx(
            scenario.vehicles[n].length, abs=1e-9
        )
        for k, state in enumerate(states):
            assert int(state.find("time/exact").text) == k
            assert np.allclose(place(state), scenario.position[n, k], atol=1e-9)
            assert number(state, "velocity/exact") == pytest.approx(scenario.speed[n, k], abs=1e-9)
            assert number(state, "orientation/exact") == pytest.approx(
                scenario.heading[n, k], abs=1e-9
            )


def test_ego_problem_has_wide_window(tmp_path):
    ego = one_vehicle()
    _, root, _ = written(tmp_path, crossing(), ego)
    (problem,) = root.iter("planningProblem")
    start = problem.find("initialState")
    assert [child.tag for child in start if child.tag in ("yawRate", "slipAngle")] == [
        "yawRate",
        "slipAngle",
    ]  # demanded
    assert np.allclose(place(start), ego.position[0, 0], atol=1e-9)
    goal = problem.find("goalState")
    assert (
        number(goal, "time/intervalStart") <= 1
        and number(goal, "time/intervalEnd") * 0.1 >= 2.0 * ego.time[-1]
    )
    rectangle = goal.find("position/rectangle")
    assert np.allclose(place(rectangle, "center"), ego.position[0, -1], atol=1e-9)
    yaws = [number(goal, f"orientation/interval{end}") for end in ("Start", "End")]
    assert yaws[0] < number(rectangle, "orientation") < yaws[1]
    assert "placeholder" not in (tmp_path / "one.xml").read_text()


def test_placeholder_problem_is_harmless(tmp_path):
    scenario = crossing()
    path, root, _ = written(tmp_path, scenario)
    assert "a placeholder: the scenario has no ego" in path.read_text()
    (problem,) = root.iter("planningProblem")
    assert number(problem, "initialState/velocity/exact") == 0.0
    assert (
        np.hypot(*(scenario.position - place(problem.find("initialState"))).reshape(-1, 2).T).min()
        > 8.0
    )


def test_uneven_steps_are_resampled(tmp_path):
    fine = crossing()
    uneven = fine.at_times(
        np.concatenate([np.linspace(0.0, 3.0, 31), np.linspace(3.08, 5.96, 37)])
    )
    path, _, notes = written(tmp_path, uneven)
    assert "resampled at 0.1 s" in notes[0] and "0.060 s are left out" in notes[0]
    tracks = observed(path).vehicles
    for n, track in enumerate(tracks):
        assert np.abs(track.fix - fine.position[n, : len(track.fix)]).max() < 1e-3


def test_late_arrival_is_written_on_request(tmp_path):
    scenario = crossing(present=[[0, 60], [8, 51]])
    path, _, notes = written(tmp_path, scenario, export=ExportConfig(late="written"))
    assert "vehicle 2 arrives late" in notes[0]
    track = observed(path).vehicles[1]
    assert np.allclose(track.fix_ns * 1e-9, scenario.time[8:52], atol=1e-9)
    assert np.abs(track.fix - scenario.position[1, 8:52]).max() < 1e-6


@pytest.mark.parametrize("late", ["refused", "written"])
def test_late_ego_is_refused(tmp_path, late):
    ego = replace(one_vehicle(), present=np.array([[5, 61]]))
    with pytest.raises(RefusedError, match=r"the ego, vehicle ego, arrives 0.5 s late"):
        written(tmp_path, crossing(), ego, export=ExportConfig(late=late))


def test_signs_and_lights_are_reread(tmp_path):
    """The light is off: no state of it is known. The schema wants signs before lights."""
    x = np.linspace(-60.0, 60.0, 30)
    border = [np.column_stack((x, np.full(30, y))) for y in (-2.0, 2.0)]
    lanes = (
        Lane("in", border[1], border[0], (1,), (), 12.5),
        Lane("on", border[1] + (120.0, 0.0), border[0] + (120.0, 0.0)),
    )
    line = np.array([(50.0, 2.0), (50.0, 0.0), (50.0, -2.0)])
    kinds = (RuleKind.TRAFFIC_LIGHT, RuleKind.STOP, RuleKind.GIVE_WAY, RuleKind.PRIORITY)
    rules = tuple(
        TrafficRule(kind, kind, (k % 2,), (), line if k == 1 else np.zeros((0, 2)))
        for k, kind in enumerate(kinds)
    )
    network = LaneNetwork("town", lanes, (), rules)
    data, _ = write_commonroad(*case_of(crossing(), lane_map=LaneMap(network, "town")))
    root = ET.fromstring(data)
    tags = list(dict.fromkeys(child.tag for child in root))
    assert tags[:5] == ["location", "scenarioTags", "lanelet", "trafficSign", "trafficLight"]
    assert [number.text for number in root.iter("trafficSignID")] == ["206", "205", "301", "274"]
    assert {color.text for color in root.iter("color")} == {"inactive"}
    assert [
        float(value.text) for value in root.find(".//stopLine").iter() if value.tag in "xy"
    ] == [50.0, 2.0, 50.0, -2.0]
    path = tmp_path / "again.xml"
    path.write_bytes(data)
    again = read_network(path)
    assert sorted((rule.kind, rule.lanes) for rule in again.rules) == sorted(
        (rule.kind, rule.lanes) for rule in rules
    )
    assert again.lanes[0].speed_limit == 12.5
