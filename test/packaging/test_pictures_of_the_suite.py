# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The RViz configuration and the Foxglove layout name topics, types and qualities of service that the suite has."""

import json
from pathlib import Path

import yaml

from msg_conventions.changepoints import POINT
from msg_conventions.topics import topic_entry

CONFIG = Path(__file__).resolve().parents[2] / "config"
TYPES = {
    "Map": "nav_msgs/msg/OccupancyGrid",
    "PoseArray": "geometry_msgs/msg/PoseArray",
    "PointCloud2": "sensor_msgs/msg/PointCloud2",
    "Polygon": "geometry_msgs/msg/PolygonStamped",
    "Path": "nav_msgs/msg/Path",
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
}


def test_rviz_shows_topics_of_suite():
    manager = yaml.safe_load((CONFIG / "suite.rviz").read_text())["Visualization Manager"]
    shown = {d["Topic"]["Value"]: d for d in manager["Displays"] if "Topic" in d}
    assert {"map", "posterior", "vehicle_1/route", "vehicle_1/footprint", "markers"} <= set(shown)
    for name, display in shown.items():
        assert not name.startswith("/"), "absolute names do not work in a namespace"
        kind, quality = topic_entry(name)
        assert kind == TYPES[display["Class"].rpartition("/")[2]], name
        assert quality.reliable == (display["Topic"]["Reliability Policy"] == "Reliable"), name
        assert quality.transient_local == (
            display["Topic"]["Durability Policy"] == "Transient Local"
        ), name
    assert shown["posterior"]["Channel Name"] in POINT.names
    assert manager["Global Options"]["Fixed Frame"] == "map"


def test_foxglove_layout_fits_the_suite():
    layout = json.loads((CONFIG / "suite_foxglove.json").read_text())
    for name, panel in layout["configById"].items():
        for topic, settings in panel.get("topics", {}).items():
            topic_entry(topic)
            assert settings.get("colorField", "primitive") in POINT.names, name
        if "topicToRender" in panel:
            assert topic_entry(panel["topicToRender"])[0] == "diagnostic_msgs/msg/DiagnosticArray"

    def placed(node):
        return {node} if isinstance(node, str) else placed(node["first"]) | placed(node["second"])

    assert placed(layout["layout"]) == set(layout["configById"])
