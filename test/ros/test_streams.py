# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The log player's per-vehicle streams: every sample, where and when it was, faster than it was."""

import numpy as np
import pyproj
import pytest
from support.suite_processes import Processes, RESOURCES

from scenario_gen.logs import read_log

pytestmark = pytest.mark.dds
LOG = RESOURCES / "synthetic_c"
RATE = 20.0


def test_every_sample_is_streamed(tmp_path, domain, client):
    from geometry_msgs.msg import TwistStamped
    from rclpy.serialization import deserialize_message
    from rosgraph_msgs.msg import Clock
    from sensor_msgs.msg import NavSatFix

    (encounter,) = read_log([LOG]).encounters
    samples = encounter.speed.shape[1]
    clock = []
    client.node.create_subscription(
        Clock, "/clock", lambda m: clock.append(m.clock.sec * 10**9 + m.clock.nanosec), 1000
    )
    client.hear("/vehicle_1/fix", "/vehicle_2/fix", "/vehicle_1/speed", "/vehicle_2/speed")
    nodes = {
        "log_player": [
            "-p",
            f"log_path:={LOG}",
            "-p",
            "stream:=true",
            "-p",
            f"rate:={RATE}",
            "-p",
            "autostart:=false",
        ]
    }
    made = Processes(tmp_path, domain, nodes)
    try:
        from lifecycle_msgs.msg import Transition
        from lifecycle_msgs.srv import ChangeState

        for number in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            request = ChangeState.Request(transition=Transition(id=number))
            assert client.call(ChangeState, "/log_player/change_state", request).success
        last = deserialize_message(client.wait("/vehicle_2/speed", samples - 2)[-1], TwistStamped)
        client.wait("/vehicle_1/fix", samples - 2)
    finally:
        assert made.end() == {"log_player": 0}
    assert (
        last.header.stamp.sec * 10**9 + last.header.stamp.nanosec
        <= encounter.start_ns + (samples - 1) * encounter.dt_ns
    )
    frame = pyproj.Proj(
        proj="aeqd", lat_0=encounter.origin[0], lon_0=encounter.origin[1], ellps="WGS84"
    )
    for i, token in enumerate(("1", "2")):
        fixes = [
            deserialize_message(data, NavSatFix) for data in client.heard[f"/vehicle_{token}/fix"]
        ]
        stamps = np.array(
            [fix.header.stamp.sec * 10**9 + fix.header.stamp.nanosec for fix in fixes]
        )
        index, rest = np.divmod(stamps - encounter.start_ns, encounter.dt_ns)
        assert not rest.any() and (np.diff(index) == 1).all()
        x, y = frame([fix.longitude for fix in fixes], [fix.latitude for fix in fixes])
        assert np.abs(np.column_stack([x, y]) - encounter.position[i, index]).max() < 1e-3
    ticks, rest = np.divmod(
        np.array(clock) - encounter.start_ns, encounter.dt_ns
    )  # of a clock the newest counts, and only few are kept
    assert not rest.any() and (np.diff(ticks) > 0).all() and len(ticks) > samples // 2
