# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic lights in exports stand at the stop line that scenarios are held to, metres before their lane's end."""

from dataclasses import replace
import xml.etree.ElementTree as ET

import numpy as np
from support.small_scenarios import case_of, crossing

from scenario_gen.output.exchange.commonroad import write_commonroad
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.output.exchange.opendrive import write_opendrive
from scenario_gen.output.exchange.scenarionet import description
from scenario_gen.roads import lights_of, read_network
from scenario_gen.types import (
    Lane,
    LaneNetwork,
    RuleKind,
    SignalSchedule,
    SignalState,
    TrafficRule,
)

LINE = np.array([(53.0, 2.0), (53.0, -2.0)])


def case():
    """A lane that ends 7 m behind its stop line, and a light that is red from 3 s on."""
    x = np.linspace(-60.0, 60.0, 30)
    left, right = (np.column_stack((x, np.full(30, y))) for y in (2.0, -2.0))
    schedule = SignalSchedule((0.0, 3.0), (SignalState.GREEN, SignalState.RED), 20.0)
    rule = TrafficRule("A", RuleKind.TRAFFIC_LIGHT, (0,), (), LINE, schedule)
    network = LaneNetwork("town", (Lane("in", left, right),), rules=(rule,))
    scenario = crossing()
    lit = replace(scenario, facts=replace(scenario.facts, lights=lights_of(network)))
    return case_of(lit, lane_map=LaneMap(network, "town"))


def test_commonroad():
    data, _ = write_commonroad(*case())
    root = ET.fromstring(data)
    (light,), (stop,) = root.findall("trafficLight"), root.iter("stopLine")
    assert stop.find("trafficLightRef").attrib["ref"] == light.attrib["id"]
    assert [float(point.find("x").text) for point in stop.findall("point")] == [53.0, 53.0]
    place = light.find("position/point")
    assert (float(place.find("x").text), float(place.find("y").text)) == (53.0, 0.0)


def test_opendrive(tmp_path):
    one, _ = case()
    data = write_opendrive(one.lane_map, "town", 0)
    (line,) = ET.fromstring(data).iter("object")
    (signal,) = ET.fromstring(data).iter("signal")
    assert float(line.attrib["s"]) == float(signal.attrib["s"]) == 113.0
    assert float(line.attrib["width"]) == 4.0
    path = tmp_path / "town.xodr"
    path.write_bytes(data)
    (again,) = lights_of(read_network(path))
    np.testing.assert_allclose(again.line, LINE, atol=1e-6)


def test_scenarionet():
    (light,) = description(*case(), ExportConfig())["dynamic_map_states"].values()
    np.testing.assert_allclose(light["stop_point"], (53.0, 0.0, 0.0), atol=1e-5)
