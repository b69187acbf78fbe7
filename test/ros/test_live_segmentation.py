# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Vehicles that stream, a segmenter that collects the streams, and /clock: tracks, changepoints and scenarios when they end."""

import numpy as np
import pytest
from support.suite_processes import Processes, RESOURCES

from msg_conventions.changepoints import decode_changepoints
from msg_conventions.diagnostics import Level
from msg_conventions.tracks import decode_tracks
from scenario_gen.logs import read_log
from scenario_gen.logs.geodesy import local_frame

pytestmark = pytest.mark.dds
LOG = RESOURCES / "synthetic_c"
SIM_TIME = ["-p", "use_sim_time:=true"]
STREAM = ["-p", "stream:=true", "-p", "rate:=12.0", "-p", "wait_matching_subscriptions:=2"]
NODES = {
    "log_player": [*SIM_TIME, *STREAM, "-p", f"log_path:={LOG}"],
    # a busy machine delivers some topics later than others, and now and then nothing for a while
    "segmenter": [*SIM_TIME, "-p", "live.silence:=6.0"],
    "road_server": [*SIM_TIME, "-p", "road_name:=straight", "-p", "wait_for_tracks:=true"],
    "planner": SIM_TIME,
    "gp_sampler": [*SIM_TIME, "-p", "count:=2", "-p", "seed:=7"],
}


@pytest.fixture(scope="module")
def suite(tmp_path_factory, domain):
    made = Processes(tmp_path_factory.mktemp("live"), domain, NODES)
    yield made
    assert made.end() == dict.fromkeys(NODES, 0)


def assert_streamed(encounter, vehicle, messages):
    """Every sample of a vehicle was sent, where and when it was."""
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import NavSatFix

    fixes = [deserialize_message(data, NavSatFix) for data in messages]
    stamps = np.array([fix.header.stamp.sec * 10**9 + fix.header.stamp.nanosec for fix in fixes])
    index, rest = np.divmod(stamps - encounter.start_ns, encounter.dt_ns)
    assert not rest.any() and (np.diff(index) == 1).all()
    degrees = np.array([(fix.latitude, fix.longitude) for fix in fixes])
    places = local_frame(*degrees.T, encounter.origin)
    assert np.abs(places - encounter.position[vehicle, index]).max() < 1e-3


def test_streams_become_scenarios(suite, client):
    """At twelve times the real speed, with the time of /clock."""
    from std_srvs.srv import Trigger

    (encounter,) = read_log(LOG).encounters
    # the log player waits for two listeners of every stream
    client.hear(
        "/vehicle_1/fix",
        "/vehicle_1/speed",
        "/vehicle_2/fix",
        "/vehicle_2/speed",
        "/tracks",
        "/changepoints",
        "/scenarios",
    )
    template = decode_tracks(client.wait("/tracks")[0])
    assert [vehicle.id for vehicle in template.vehicles] == ["1", "2"]
    assert (template.start_ns, template.duration) == (
        encounter.start_ns,
        pytest.approx(encounter.duration, abs=0.2),
    )
    for index, heard in enumerate(("/vehicle_1/fix", "/vehicle_2/fix")):
        assert_streamed(encounter, index, client.wait(heard, len(encounter.time) - 2))
    moved = template.position - encounter.position[:, : len(template.time)]
    assert np.ptp(moved, axis=(0, 1)).max() < 0.2  # smoothed once more, about another origin
    points = decode_changepoints(client.wait("/changepoints")[0], template).changepoints * 0.1
    assert np.abs(points[:, None] - np.array([4.0, 8.0, 12.0])).min(axis=1).max() < 0.6
    client.wait("/scenarios", 2)
    assert (
        client.call(Trigger, "/segmenter/segment", Trigger.Request()).message == "started"
    )  # the streams have ended: tracks
    assert len(set(client.wait("/changepoints", 2))) == 1


def test_what_is_no_stream_is_said(suite, client):
    """Damaged bytes, and a topic of another type: the node lives on."""
    from std_msgs.msg import String

    client.hear("/tracks", "/diagnostics")
    client.wait("/tracks")
    misfit = client.node.create_publisher(String, "/vehicle_8/fix", 10)
    client.announce("/vehicle_4/fix")
    client.until(
        lambda: client.node.count_subscribers("/vehicle_4/fix"), "the segmenter's subscription"
    )
    misfit.publish(String(data="no fix"))
    client.say("/vehicle_4/fix", b"\x00\x01\x00\x00" + bytes(8))
    for words in ("/vehicle_4/fix: the message ends at byte 8", "/vehicle_8/fix is a std_msgs"):
        client.until(
            lambda words=words: any(
                s.level is Level.ERROR and words in s.message for s in client.statuses()
            ),
            words,
        )
