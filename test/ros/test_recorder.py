# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The recorder and the player as processes: types of no concern to the suite, a kill, and bags of genuine rosbag2."""

import re
import signal
import subprocess
import time

from mcap.reader import make_reader
import pytest
from support.bag_examples import bag_topics, hand_made_run
from support.suite_processes import Client, RESOURCES

from scenario_gen.bags.recordings.write import result_messages
from scenario_gen.bags.storage.bag import read_messages

pytestmark = pytest.mark.dds

QUEUE = 1000
TOPICS = ("scenarios", "scenarios/info")


def publisher(client: Client, kind: type, topic: str):
    """A publisher that somebody hears already."""
    made = client.node.create_publisher(kind, topic, QUEUE)
    client.until(lambda: made.get_subscription_count() > 0, f"a subscriber of {topic}")
    return made


def ended(process: "subprocess.Popen[str]") -> None:
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=180.0)
    assert process.returncode == 0 and "Traceback" not in output, output


def test_any_type_is_recorded_as_sent(start, client, tmp_path):
    from geometry_msgs.msg import Point32, PolygonStamped
    from rclpy.serialization import serialize_message
    from sensor_msgs.msg import Imu

    bag = tmp_path / "bag"
    recorder = start("recorder", bag=bag, topics="/(imu|area)", compress=False)
    imu, area = publisher(client, Imu, "/imu"), publisher(client, PolygonStamped, "/area")
    sent = {"/imu": [], "/area": []}
    for k in range(50):
        reading = Imu(orientation_covariance=[float(k)] * 9)
        reading.angular_velocity.z = 0.1 * k
        outline = PolygonStamped()
        outline.header.frame_id = "map"
        outline.polygon.points = [Point32(x=float(n)) for n in range(k)]
        for topic, out, message in (("/imu", imu, reading), ("/area", area, outline)):
            sent[topic].append(serialize_message(message))
            out.publish(
                sent[topic][-1]
            )  # these bytes: what fills CDR's gaps may differ from one serialisation to the next
    whole = sum(len(data) for messages in sent.values() for data in messages)
    client.until(
        lambda: client.counted("/area") == 50 and client.counted("/imu") == 50,
        f"{whole} bytes in the bag",
    )
    ended(recorder)
    assert {topic.name: topic.type for topic in bag_topics(bag)} == {
        "/imu": "sensor_msgs/msg/Imu",
        "/area": "geometry_msgs/msg/PolygonStamped",
    }
    for topic, messages in sent.items():
        assert [
            m.data for m in read_messages(bag, lambda name, topic=topic: name == topic)
        ] == messages
    with (bag / "bag_0.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    texts = {schema.name: schema.data.decode() for schema in summary.schemas.values()}
    assert (
        "orientation_covariance" in texts["sensor_msgs/msg/Imu"]
        and "MSG: geometry_msgs/Vector3" in texts["sensor_msgs/msg/Imu"]
    )
    assert all(
        c.metadata["topic_type_hash"].startswith("RIHS01_") for c in summary.channels.values()
    )


def test_full_disk_ends_the_recording(start, client, tmp_path):
    """The node lives on, as others in its process do; what is whole in the bag is saved elsewhere."""
    from sensor_msgs.msg import CompressedImage

    from msg_conventions.diagnostics import decode_diagnostics, Level

    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(disk)]
    made = subprocess.run(mount, capture_output=True, text=True, check=False)
    if made.returncode:
        pytest.skip(f"no file system can be mounted here: {made.stderr.strip()}")
    try:
        recorder = start("recorder", bag=disk / "bag", topics="/picture", compress=False)
        picture = publisher(client, CompressedImage, "/picture")
        client.heard["/diagnostics"] = []
        client.hear("/diagnostics")

        def errors():
            statuses = [
                status
                for data in client.heard["/diagnostics"]
                for status in decode_diagnostics(data)[1]
            ]
            return [
                status.message
                for status in statuses
                if status.name == "/recorder: recording" and status.level is Level.ERROR
            ]

        for k in range(120):  # 6 MB
            picture.publish(CompressedImage(format=str(k), data=bytes(50_000)))
            client.until(
                lambda due=k - 40: errors() or client.counted("/picture") >= due,
                "the recorder to keep up",
            )
        client.until(errors, "an error of the recorder")
        assert "No space left on device" in errors()[0] and "bag_0.mcap" in errors()[0]
        assert recorder.poll() is None
        ended(recorder)
        assert 40 <= len(list(read_messages(disk / "bag"))) <= 80
    finally:
        recorder.kill()
        recorder.wait()
        subprocess.run(["umount", str(disk)], check=True)


def test_a_recorder_keeps_to_its_namespace(start, client, tmp_path):
    """By default it records the suite's topics there, ego/* too, and what is of the whole domain; at the root those of all."""
    from geometry_msgs.msg import (
        TransformStamped,
    )  # in place of tf2_msgs, which is not among the wheels; the name decides
    from nav_msgs.msg import Odometry
    from rosgraph_msgs.msg import Clock
    from std_msgs.msg import String

    kinds = {
        "/a/ego/start": Odometry,
        "/a/deep/ego/goal": Odometry,
        "/b/ego/start": Odometry,
        "/ab/ego/start": Odometry,
    }
    kinds |= {
        "/clock": Clock,
        "/tf": TransformStamped,
        "/tf_static": TransformStamped,
        "/a/other": String,
        "/other": String,
    }
    recorders = {
        "/": start("recorder", bag=tmp_path / "root", compress=False),
        "/a": start("recorder", "-r", "__ns:=/a", bag=tmp_path / "own", compress=False),
    }
    heard = {
        topic: len(recorders)
        for topic in ("/a/ego/start", "/a/deep/ego/goal", "/clock", "/tf", "/tf_static")
    }
    heard |= {"/b/ego/start": 1, "/ab/ego/start": 1}
    made = {
        topic: client.node.create_publisher(kind, topic, QUEUE) for topic, kind in kinds.items()
    }
    for topic, count in heard.items():
        client.until(
            lambda out=made[topic], n=count: out.get_subscription_count() == n,
            f"{count} subscribers of {topic}",
        )
    for topic, out in made.items():
        out.publish(kinds[topic]())
    wanted = {"/": set(heard), "/a": set(heard) - {"/b/ego/start", "/ab/ego/start"}}
    for space, topics in wanted.items():
        node = f"{space.rstrip('/')}/recorder"
        client.until(
            lambda n=node, t=topics: all(client.counted(one, n) == 1 for one in t),
            f"{len(topics)} messages of {node}",
        )
    for process in recorders.values():
        ended(process)
    bags = {"/": tmp_path / "root", "/a": tmp_path / "own"}
    assert {
        space: {m.topic for m in read_messages(bag)} - {"/diagnostics"}
        for space, bag in bags.items()
    } == wanted


def test_player_ends_when_all_is_heard(start, client):
    from std_srvs.srv import Trigger

    from msg_conventions.topics import topic_entry

    bag = RESOURCES / "synthetic_c"
    played = [
        m for m in read_messages(bag) if topic_entry(m.topic)[0] == "sensor_msgs/msg/NavSatFix"
    ]
    topics = sorted({f"/{m.topic.lstrip('/')}" for m in played})
    client.hear("/clock", *topics)
    process = start("player", bag=bag, paused=True, rate=1000.0, clock=True)
    client.wait("/clock", 20)  # while it is paused
    for topic in topics:
        client.until(
            lambda name=topic: client.node.count_publishers(name) == 1, f"a publisher of {topic}"
        )
    client.until(lambda: client.node.count_publishers("/clock") == 1, "one publisher of /clock")
    assert len(set(client.heard["/clock"])) == 1
    assert not any(client.heard[topic] for topic in topics)
    assert client.call(Trigger, "/player/resume_playing", Trigger.Request()).success
    output, _ = process.communicate(timeout=180.0)
    assert process.returncode == 0 and "played" in output and "Traceback" not in output, output
    for topic in topics:
        sent = [m.data for m in played if f"/{m.topic.lstrip('/')}" == topic]
        heard = zip(client.heard[topic], sent, strict=True)  # DDS fills messages up
        assert all(message[: len(own)] == own for message, own in heard), topic
    assert "without any subscriber: " in output and "speed" in output
    assert re.search(r"a subscriber of depth 10 could miss \d\d+ of them", output)


def test_recording_waits_for_simulated_time(start, client, tmp_path):
    from rosgraph_msgs.msg import Clock
    from std_msgs.msg import String

    bag = tmp_path / "bag"
    recorder = start("recorder", bag=bag, topics="/chat", use_sim_time=True)
    chat = client.node.create_publisher(String, "/chat", QUEUE)
    clock = publisher(client, Clock, "/clock")
    for _ in range(5):  # the recorder knows the topic by then
        chat.publish(String(data="early"))
        time.sleep(0.1)
    assert chat.get_subscription_count() == 0
    now = Clock()
    now.clock.sec = 1000
    clock.publish(now)
    client.until(lambda: chat.get_subscription_count() > 0, "the recorder")
    chat.publish(String(data="in time"))
    client.until(lambda: client.counted("/chat") == 1, "the message in the bag")
    ended(recorder)
    assert [message.stamp_ns for message in read_messages(bag)] == [1_000_000_000_000]


@pytest.fixture
def others(domain):
    """Two nodes that also publish the topics of scenarios."""
    made = [Client(domain, name) for name in ("one", "two")]
    for other in made:
        for topic in TOPICS:
            other.announce(topic)
    yield made
    for other in made:
        other.close()


@pytest.mark.usefixtures("others")
def test_recorder_blames_two_publishers(start, client, tmp_path):
    """Messages of one request, of which a second node of the same topics makes others."""
    start("recorder", bag=tmp_path / "bag")
    client.hear("/diagnostics")
    client.until(lambda: client.node.count_publishers("/scenarios/info") == 2, "both others")
    client.until(lambda: client.node.count_subscribers("/scenarios/info") >= 1, "the recorder")
    run = hand_made_run()
    for topic in TOPICS:
        client.announce(topic)
    messages = [(topic, data) for topic, data, _ in result_messages(run) if topic in TOPICS]
    for topic, data in messages[1:]:  # the first is missing
        client.say(topic, data)

    def blamed():
        return [
            status.message
            for status in client.statuses()
            if status.name == "/recorder: losses"
            and "/one and /test_client and /two publish" in status.message
        ]

    client.until(blamed, "the recorder to blame the publishers")
    assert "disk" not in blamed()[-1]
