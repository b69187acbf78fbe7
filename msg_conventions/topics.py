# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every topic of the suite: its type and its quality of service, in one table (in words: docs/interfaces.md)."""

import re

from msg_conventions import (
    autoware,
    changepoints,
    diagnostics,
    driving,
    ego,
    frames,
    lanes,
    markers,
    odometry,
    paths,
    pictures,
    roads,
    trajectory,
)
from scenario_gen.types import Quality

FIX_TYPE = "sensor_msgs/msg/NavSatFix"
TWIST_TYPE = "geometry_msgs/msg/TwistStamped"


LATCHED = Quality()
MANY = Quality(depth=1000)
MANY_HEARD = Quality(depth=1000, keep_all=True)  # for subscribers that must not lose any: paced publishers then wait for them
STREAM = Quality(depth=1000, transient_local=False)
LIVE = Quality(depth=100, transient_local=False)

TOPICS: dict[str, tuple[str, Quality]] = {
    "map": (roads.MAP_TYPE, LATCHED),
    "road/entries": (roads.POSES_TYPE, LATCHED),
    "road/exits": (roads.POSES_TYPE, LATCHED),
    lanes.TOPIC: (markers.TYPE, LATCHED),
    "road/info": (diagnostics.TYPE, LATCHED),
    "tracks": (trajectory.TYPE, LATCHED),
    "changepoints": (trajectory.TYPE, LATCHED),
    "changepoints/live": (trajectory.TYPE, MANY),
    "posterior": (changepoints.POSTERIOR_TYPE, LATCHED),
    "fit": (trajectory.TYPE, LATCHED),
    "fit/info": (diagnostics.TYPE, LATCHED),
    "vehicle_*/route": (paths.TYPE, LATCHED),
    "vehicle_*/path": (paths.TYPE, LATCHED),
    "vehicle_*/footprint": (pictures.FOOTPRINT_TYPE, LATCHED),
    "vehicle_*/fix": (FIX_TYPE, STREAM),
    "vehicle_*/speed": (TWIST_TYPE, STREAM),
    "ego/start": (odometry.TYPE, LATCHED),
    "ego/goal": (odometry.TYPE, LATCHED),
    ego.WITNESS: (trajectory.TYPE, MANY),
    "vehicle_*/odom": (odometry.TYPE, LIVE),
    "traffic/markers": (markers.ARRAY_TYPE, LIVE),
    "traffic/local_map": (roads.MAP_TYPE, Quality(depth=1, transient_local=False)),
    "ego/route": (paths.TYPE, LATCHED),
    "ego/cmd_vel": (driving.TWIST_TYPE, LIVE),
    "ego/cmd_vel_stamped": (TWIST_TYPE, LIVE),
    "ego/trajectory": (trajectory.TYPE, LIVE),
    "ego/path": (paths.TYPE, LIVE),
    "ego/odom": (odometry.TYPE, LIVE),
    "verdicts": (diagnostics.TYPE, MANY),
    autoware.OBJECTS: ("autoware_perception_msgs/msg/PredictedObjects", autoware.QUALITY),
    autoware.EGO: (odometry.TYPE, autoware.QUALITY),
    "clock": (driving.CLOCK_TYPE, Quality(depth=10, transient_local=False)),
    "scenarios": (trajectory.TYPE, MANY),
    "scenarios/info": (diagnostics.TYPE, MANY),
    "markers": (markers.ARRAY_TYPE, LATCHED),
    "preview": (markers.ARRAY_TYPE, LIVE),
    "report": (diagnostics.TYPE, LATCHED),
    "diagnostics": (diagnostics.TYPE, Quality(depth=100)),  # in a bag written without nodes: one message, which is latched
    "/diagnostics": (diagnostics.TYPE, Quality(depth=100, transient_local=False)),  # all is repeated every second
    "tf": (frames.TYPE, Quality(depth=100, transient_local=False)),
    "tf_static": (frames.TYPE, LATCHED),
}


def vehicle_topic(token: str, name: str) -> str:
    """Return the topic of one vehicle, e.g. `vehicle_7/route`."""
    return f"vehicle_{token}/{name}"


def topic_entry(topic: str) -> tuple[str, Quality]:
    """Return type and quality of a topic of the suite, with or without namespace before it; the longest name that fits counts.

    Raises:
        KeyError: it is no topic of the suite.
    """
    for pattern in sorted(TOPICS, key=len, reverse=True):
        if re.search(rf"(^|/){re.escape(pattern).replace(re.escape('*'), '[0-9A-Za-z_]+')}$", topic):
            return TOPICS[pattern]
    raise KeyError(topic)
