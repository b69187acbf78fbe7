# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A scenario as a bag for Autoware's planning simulator; see msg_conventions/autoware.py."""

from collections.abc import Iterator

from msg_conventions import poses
from msg_conventions.autoware import AutowareEncoder, EGO, OBJECTS, QUALITY, TRACKS
from scenario_gen.bags.storage.definitions import PREDICTED, TRACKED
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.types import Scenario

TYPES = {OBJECTS: PREDICTED, TRACKS: TRACKED, EGO: poses.ODOMETRY_TYPE}


def autoware_messages(
    others: Scenario, ego: Scenario | None, start_ns: int
) -> Iterator[tuple[str, bytes, int]]:
    """Yield topic, CDR bytes and log stamp [ns] of every message, in order of the stamps.

    Args:
        others: the other vehicles.
        ego: the ego's track on its own clock, from the same instant; or None.
        start_ns: stamp of the first instant.
    """
    encoders = [AutowareEncoder(others)]
    if ego is not None:
        encoders.append(AutowareEncoder(ego))
    instants = [
        (int(time_ns), n, k)
        for n, encoder in enumerate(encoders)
        for k, time_ns in enumerate(encoder.time_ns)
    ]
    for time_ns, n, k in sorted(instants):
        stamp_ns = start_ns + time_ns
        if n:
            yield EGO, encoders[n].odometry(k, stamp_ns), stamp_ns
        else:
            yield OBJECTS, encoders[n].predicted_objects(k, stamp_ns), stamp_ns
            yield TRACKS, encoders[n].tracked_objects(k, stamp_ns), stamp_ns


def add_autoware(bag: BagWriter, others: Scenario, ego: Scenario | None, start_ns: int) -> None:
    """Write a scenario to an open bag; arguments as in `autoware_messages`.

    Raises:
        InputError: a stamp is out of ROS's range.
        OSError: the disk is full, or fails.
    """
    for topic, data, stamp_ns in autoware_messages(others, ego, start_ns):
        bag.add_topic(topic, TYPES[topic], QUALITY)
        bag.write(topic, data, stamp_ns)
