# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The suite's topics with their types and qualities of service.

Docs/interfaces.md describes them.
"""

from functools import lru_cache
import re

from msg_conventions import (
    autoware,
    changepoints,
    diagnostics,
    documents,
    driving,
    ego,
    paths,
    pictures,
    poses,
    roads,
    trajectory,
)
from scenario_gen.types import Quality

FIX_TYPE = "sensor_msgs/msg/NavSatFix"
TWIST_TYPE = "geometry_msgs/msg/TwistStamped"

LATCHED = Quality()
MANY = Quality(depth=1000)
LOSSLESS = Quality(depth=1000, keep_all=True)
"""For subscribers that must not lose a message of `MANY`: paced publishers wait for them."""
STREAM = Quality(depth=1000, transient_local=False)
LIVE = Quality(depth=100, transient_local=False)
NEWEST = Quality(depth=1, transient_local=False)

_TABLE: tuple[tuple[str, Quality, str], ...] = (
    (trajectory.TYPE, LATCHED, "tracks tracks/part tracks/recorded changepoints fit"),
    (trajectory.TYPE, MANY, f"scenarios {ego.WITNESS}"),
    (trajectory.TYPE, LIVE, "ego/trajectory"),
    (paths.TYPE, LATCHED, "vehicle_*/route vehicle_*/path ego/route"),
    (paths.TYPE, LIVE, "ego/path"),
    (roads.MAP_TYPE, LATCHED, "map"),
    (roads.MAP_TYPE, NEWEST, "traffic/local_map"),
    (roads.POSES_TYPE, LATCHED, "road/entries road/exits"),
    (documents.TYPE, LATCHED, " ".join(documents.DOCUMENTS)),
    (documents.TYPE, MANY, "scenarios/info"),
    (pictures.MARKER_TYPE, LATCHED, "markers road/markings"),
    (pictures.MARKER_TYPE, LIVE, "traffic/markers preview"),
    (changepoints.POSTERIOR_TYPE, LATCHED, "posterior"),
    (pictures.FOOTPRINT_TYPE, LATCHED, "vehicle_*/footprint"),
    (FIX_TYPE, STREAM, "vehicle_*/fix"),
    (TWIST_TYPE, STREAM, "vehicle_*/speed"),
    (TWIST_TYPE, LIVE, "ego/cmd_vel_stamped"),
    (driving.TWIST_TYPE, LIVE, "ego/cmd_vel"),
    (driving.CLOCK_TYPE, Quality(depth=10, transient_local=False), "clock"),
    (poses.ODOMETRY_TYPE, LATCHED, "ego/start ego/goal"),
    (poses.ODOMETRY_TYPE, LIVE, "vehicle_*/odom ego/odom"),
    (poses.ODOMETRY_TYPE, autoware.QUALITY, autoware.EGO),
    ("autoware_perception_msgs/msg/PredictedObjects", autoware.QUALITY, autoware.OBJECTS),
    (poses.FRAMES_TYPE, LIVE, "tf"),
    (diagnostics.TYPE, LATCHED, "report"),
    (diagnostics.TYPE, MANY, "verdicts"),
    (diagnostics.TYPE, Quality(depth=100), "diagnostics"),  # one message in a bag without nodes
    (diagnostics.TYPE, LIVE, "/diagnostics"),  # repeated every second
)
TOPICS = {topic: (kind, quality) for kind, quality, topics in _TABLE for topic in topics.split()}


def vehicle_topic(token: str, name: str) -> str:
    """Return a vehicle's topic, e.g. `vehicle_7/route`."""
    return f"vehicle_{token}/{name}"


@lru_cache(maxsize=1024)
def topic_entry(topic: str) -> tuple[str, Quality]:
    """Return type and quality of one of the suite's topics, with or without a namespace.

    Of several matches the longest counts.

    Raises:
        KeyError: it is no topic of the suite.
    """
    for pattern in sorted(TOPICS, key=len, reverse=True):
        name = re.escape(pattern).replace(re.escape("*"), "[0-9A-Za-z_]+")
        if re.search(rf"(^|/){name}$", topic):
            return TOPICS[pattern]
    raise KeyError(topic)
