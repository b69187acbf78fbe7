# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A scenario as a bag for Autoware's planning simulator (conventions: msg_conventions/autoware.py)."""

from collections.abc import Iterator

from msg_conventions import odometry
from msg_conventions.autoware import AutowareEncoder, EGO, OBJECTS, QUALITY, TRACKS
from scenario_gen.bags.storage.definitions import PREDICTED, TRACKED
from scenario_gen.bags.storage.metadata import qos_yaml
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.types import Scenario

TYPES = {OBJECTS: PREDICTED, TRACKS: TRACKED, EGO: odometry.TYPE}


def autoware_messages(
    others: Scenario, ego: Scenario | None, start_ns: int
) -> Iterator[tuple[str, bytes, int]]:
    """Yield topic, CDR bytes and log stamp [ns] of every message, in order of the stamps.

    Args:
        others: the vehicles around.
        ego: the ego's track, a scenario of one vehicle on a clock of its own that begins at the same instant; None: none.
        start_ns: stamp of the first instant.
    """
    objects, at = AutowareEncoder(others), None if ego is None else AutowareEncoder(ego)
    moments = [(int(t), 0, k) for k, t in enumerate(objects.time_ns)]
    moments += [] if at is None else [(int(t), 1, k) for k, t in enumerate(at.time_ns)]
    for time_ns, of_ego, k in sorted(moments):
        stamp = start_ns + time_ns
        if of_ego and at is not None:
            yield EGO, at.odometry(k, stamp), stamp
        else:
            yield OBJECTS, objects.predicted_objects(k, stamp), stamp
            yield TRACKS, objects.tracked_objects(k, stamp), stamp


def add_autoware(bag: BagWriter, others: Scenario, ego: Scenario | None, start_ns: int) -> None:
    """Write a scenario to a bag that is open; arguments as of `autoware_messages`.

    Raises:
        InputError: a stamp is out of ROS's range.
        OSError: the disk is full, or fails.
    """
    for topic, data, stamp_ns in autoware_messages(others, ego, start_ns):
        bag.add_topic(topic, TYPES[topic], qos_yaml(QUALITY))
        bag.write(topic, data, stamp_ns)
