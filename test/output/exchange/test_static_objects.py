# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A parked car and a barrier are in every format with static objects, where they stand on the road."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from support.small_scenarios import case_of, crossing

from scenario_gen.numerics import wrap_angle
from scenario_gen.numerics.curve import Curve
from scenario_gen.output.exchange.commonroad import write_commonroad
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.output.exchange.opendrive import write_opendrive
from scenario_gen.output.exchange.opendrive_network import RoadNetwork
from scenario_gen.output.exchange.openscenario import write_openscenario
from scenario_gen.output.exchange.scenarionet import description
from scenario_gen.roads import build_road, RoadConfig

PLACES = np.array([(20.0, 3.0, 0.3, 4.5, 1.8), (40.0, 2.0, -2.0, 1.0, 3.0)])


@pytest.fixture(scope="module")
def case():
    text = "; ".join(" ".join(map(str, place)) for place in PLACES)
    road = build_road("straight", config=RoadConfig(obstacles=text))
    scenario = crossing()
    return case_of(scenario, lane_map=LaneMap.of(road, 15.0))


def test_opendrive(case):
    lane_map = case[0].lane_map
    root = ET.fromstring(write_opendrive(lane_map, "r", 0))
    references = [Curve(strip.reference) for strip in RoadNetwork(lane_map).strips]
    found = {}
    for number, road in enumerate(root.findall("road")):
        for thing in road.findall("objects/object[@type='obstacle']"):
            values = {key: float(thing.get(key)) for key in ("s", "t", "hdg", "length", "width")}
            pose = references[number].at_offset(np.array([values["s"]]), values["t"])[0]
            pose[2] += values["hdg"]
            found[thing.get("name")] = [*pose, values["length"], values["width"]]
    assert set(found) == {"parked car", "obstacle"}
    read = np.array([found["parked car"], found["obstacle"]])
    read[:, 2] = PLACES[:, 2] + wrap_angle(read[:, 2] - PLACES[:, 2])
    np.testing.assert_allclose(read, PLACES, atol=1e-6)


def test_commonroad_is_read_as_a_road(case, tmp_path):
    path = tmp_path / "one.xml"
    path.write_bytes(write_commonroad(*case)[0])
    root = ET.parse(path).getroot()
    kinds = [thing.findtext("type") for thing in root.findall("staticObstacle")]
    assert kinds == ["parkedVehicle", "unknown"]
    tags = [child.tag for child in root]
    assert tags.index("staticObstacle") < tags.index("dynamicObstacle")  # the schema's sequence
    np.testing.assert_allclose(build_road(path).obstacles, PLACES, atol=1e-6)


def test_openscenario(case, tmp_path):
    path = tmp_path / "one.xosc"
    path.write_bytes(write_openscenario(*case, "r.xodr"))
    root = ET.parse(path).getroot()
    for n, (x, y, yaw, length, width) in enumerate(PLACES, 1):
        box = root.find(f".//ScenarioObject[@name='obstacle_{n}']/MiscObject/BoundingBox")
        assert float(box.find("Dimensions").get("length")) == length
        assert float(box.find("Dimensions").get("width")) == width
        place = root.find(f".//Private[@entityRef='obstacle_{n}']//WorldPosition")
        assert [float(place.get(key)) for key in "xyh"] == [x, y, yaw]


def test_scenarionet(case):
    whole = description(*case, ExportConfig())
    tracks = [whole["tracks"][f"obstacle_{n}"] for n in (1, 2)]
    assert [track["type"] for track in tracks] == ["VEHICLE", "TRAFFIC_BARRIER"]
    for track, place in zip(tracks, PLACES, strict=True):
        state = track["state"]
        assert state["valid"].all() and not state["velocity"].any()
        last = (
            *state["position"][-1, :2],
            state["heading"][-1],
            state["length"][-1],
            state["width"][-1],
        )
        np.testing.assert_allclose(last, place, rtol=1e-6)
    assert whole["metadata"]["number_summary"]["num_objects"] == 4
