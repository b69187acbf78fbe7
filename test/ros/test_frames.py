# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the player tells on /tf and /tf_static, heard by a client and a recorder, and read by other libraries than ours."""

import signal

from bag_examples import hand_made_run
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores

from msg_conventions.frames import decode_frames, encode_frames, TYPE
from msg_conventions.scenarios import encode_scenario
from msg_conventions.tracks import encode_tracks
from msg_conventions.trajectory import decode
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.bags.storage.bag import bag_topics, read_messages

STORE = get_typestore(Stores.ROS2_JAZZY)
OFFERED = "geometry_msgs/msg/TransformStamped"  # of the stand-in


@pytest.fixture(scope="module")
def run():
    return hand_made_run()


@pytest.fixture(scope="module")
def bag(run, tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("frames") / "bag", run)


def test_bytes_are_those_of_rosbags_and_are_read_back():
    poses = np.array([[1.5, -2.25, 0.5], [3.0, 4.0, -3.0]])
    data = encode_frames(poses, ["vehicle_1", "vehicle_long_2"], "map", 17)
    assert bytes(STORE.serialize_cdr(STORE.deserialize_cdr(data, TYPE), TYPE)) == data
    found = decode_frames(data)
    assert [one[:3] for one in found] == [(17, "map", "vehicle_1"), (17, "map", "vehicle_long_2")]
    assert np.allclose([one[3] for one in found], poses, rtol=0.0, atol=1e-12)


@pytest.mark.dds
def test_without_tf2_msgs_the_rest_is_played_and_that_is_said(start, client, bag):
    from std_srvs.srv import Trigger

    client.hear("scenarios")
    nodes = {"player": {"bag": bag, "rate": 100.0, "paused": "true"}, "preview": {}, "traffic": {}}
    started = {node: start(node, without_tf2=True, **parameters) for node, parameters in nodes.items()}
    client.until(lambda: client.node.count_publishers("scenarios") == 1, "a publisher of scenarios")
    assert client.call(Trigger, "/player/resume", Trigger.Request()).success
    client.wait("scenarios", 5)
    for node, process in started.items():
        client.until(lambda node=node: (node, "/") in client.node.get_node_names_and_namespaces() or node == "player", node)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=180.0)
        assert process.returncode == 0 and output.count("no frames are published on /tf:") == 1, output
        assert "tf2_msgs" in output and "Traceback" not in output


@pytest.mark.dds
@pytest.mark.parametrize("topic", [pytest.param("tracks", marks=pytest.mark.long), "scenarios"])
def test_a_motion_is_told_sample_by_sample(start, client, run, bag, tmp_path, topic):
    """Poses are the trajectory's, stamps the clock's, and every footprint's frame hangs on the map."""
    from std_srvs.srv import Trigger

    kept = tmp_path / "kept"
    footprints = ("/vehicle_1/footprint", "/vehicle_bus_2/footprint")
    recorder = start("recorder", bag=kept, topics="/tf(_static)?|/vehicle_.*/footprint")
    player = start("player", bag=bag, frames=topic, scenario=0 if topic == "tracks" else 3, paused=True, rate=20.0, clock=True)
    client.hear("/tf", "/tf_static", *footprints)
    for name in ("/tf", "/tf_static"):
        client.until(lambda name=name: client.node.count_publishers(name) == 1, f"a publisher of {name}")
        client.until(lambda name=name: client.node.count_subscribers(name) >= 2 + (name == "/tf"), f"who hears {name}")
    assert client.call(Trigger, "/player/resume", Trigger.Request()).success
    output, _ = player.communicate(timeout=180.0)
    assert player.returncode == 0 and "Traceback" not in output, output
    client.wait("/tf", 61)
    client.until(lambda: client.counted("/tf") == 61, "61 messages in the bag")
    recorder.terminate()
    assert recorder.wait(180.0) == 0

    sent = encode_tracks(run.encounter) if topic == "tracks" else encode_scenario(run.generated.scenarios[3], 0)
    told = decode(sent, topic)
    begin = run.encounter.start_ns if topic == "tracks" else _logged(bag, 3)
    messages = [STORE.deserialize_cdr(data, TYPE) for data in client.heard["/tf"]]
    for i, child in enumerate(("vehicle_1", "vehicle_bus_2")):
        mine = [message.transforms[i] for message in messages]
        assert {(one.header.frame_id, one.child_frame_id) for one in mine} == {(told.frame_id, child)}
        stamps = [one.header.stamp.sec * 10**9 + one.header.stamp.nanosec for one in mine]
        assert stamps == (begin + told.time_ns).tolist()
        places = [(one.transform.translation.x, one.transform.translation.y) for one in mine]
        assert places == [tuple(place) for place in told.position[i]]
        turned = np.array([2.0 * np.arctan2(one.transform.rotation.z, one.transform.rotation.w) for one in mine])
        assert np.allclose(np.cos(turned - told.heading[i]), 1.0, rtol=0.0, atol=1e-12)

    assert {one.name: one.type for one in bag_topics(kept)} == {
        **dict.fromkeys(("/tf", "/tf_static"), OFFERED),
        **dict.fromkeys(footprints, "geometry_msgs/msg/PolygonStamped"),
    }
    tree, drawn = {}, {}
    for message in read_messages(kept):
        if message.type == OFFERED:
            for _, parent, child, _ in decode_frames(message.data):
                assert tree.setdefault(child, parent) == parent
        else:
            drawn.setdefault(message.topic, []).append(STORE.deserialize_cdr(message.data, message.type))
    assert tree == {"local_enu": "map", "vehicle_1": told.frame_id, "vehicle_bus_2": told.frame_id}
    assert set(drawn) == set(footprints) and {one.header.frame_id for ones in drawn.values() for one in ones} <= set(tree)


@pytest.mark.dds
def test_of_two_players_the_later_tells_no_frames(start, client, bag):
    """Frames are one for a whole ROS domain, whatever the namespaces: who has told less of them gives in and says so."""
    client.hear("/tf")
    first = start("player", bag=bag, loop=True, rate=5.0)
    client.wait("/tf", 30)
    second = start("player", "-r", "__ns:=/other", bag=bag, loop=True)
    client.until(lambda: "another publisher of /tf publishes vehicle_1, vehicle_bus_2" in second.output(), "the later one's word")
    count = len(client.heard["/tf"])
    client.wait("/tf", count + 50)  # the first goes on
    first.terminate()
    output, _ = first.communicate(timeout=180.0)
    assert first.returncode == 0 and "another publisher" not in output, output


def _logged(bag, number):
    return [message.stamp_ns for message in read_messages(bag, lambda name: name.endswith("scenarios"))][number]
