# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags, MCAP and SQLite: streams per vehicle, odometry, tracks, and everything that can be wrong with them."""

from dataclasses import astuple, dataclass, replace

from mcap.writer import Writer as McapWriter
import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
from support.bag_examples import bag_topics
from support.cut_bags import rosbags_bag
from support.log_builders import crossing, geographic, save
from support.recording_files import tracked

from msg_conventions.ego import encode_state
from msg_conventions.tracks import encode_tracks
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.bags.storage.definitions import definition, type_store
from scenario_gen.bags.vehicles import decode_samples, FIX, ODOMETRY, POSE, TRANSFORMS, TWIST
from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, read_log
import scenario_gen.logs.bag
from scenario_gen.logs.quality import DoubtError

STORES = type_store()
TRACKS = "trajectory_msgs/msg/MultiDOFJointTrajectory"
STRING = "std_msgs/msg/String"


@dataclass
class Line:
    topic: str
    type: str
    stamp: int
    data: bytes


def header(stamp, frame="map"):
    time = STORES.types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9))
    return STORES.types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def fix_of(head, latitude, longitude):
    """A NavSatFix at a height of 500 m."""
    types = STORES.types
    status = types["sensor_msgs/msg/NavSatStatus"](status=0, service=1)
    fix = types[FIX](head, status, latitude, longitude, 500.0, np.zeros(9), 0)
    return bytes(STORES.serialize_cdr(fix, FIX))


def twist_of(speed):
    """A Twist along the vehicle's x axis."""
    vector = STORES.types["geometry_msgs/msg/Vector3"]
    return STORES.types["geometry_msgs/msg/Twist"](vector(speed, 0.0, 0.0), vector(0.0, 0.0, 0.0))


def streams(rows, stamped=True, prefix=""):
    """One NavSatFix and one TwistStamped per vehicle."""
    lines = []
    for row in geographic(rows).itertuples():
        stamp = round(row.t_s * 1e9)
        head = header(stamp if stamped else 0)
        space = f"{prefix}/vehicle_{row.vehicle_id}"
        fix = fix_of(head, row.lat_deg, row.lon_deg)
        speed = STORES.serialize_cdr(STORES.types[TWIST](head, twist_of(row.speed_mps)), TWIST)
        lines += [
            Line(f"{space}/fix", FIX, stamp + 20_000_000, fix),
            Line(f"{space}/speed", TWIST, stamp, bytes(speed)),
        ]
    return lines


def odometry(rows, topic="/{}/odom", frame="map", child="base_link", late=0.0):
    """nav_msgs/Odometry per vehicle, received `late` seconds after its stamp."""
    lines = []
    for row in rows.itertuples():
        name = row.vehicle_id
        yaw = getattr(row, "yaw", 0.0 if name == "a" else np.pi / 2.0)
        state = np.array([row.x_m, row.y_m, yaw, row.speed_mps])
        stamp = round(row.t_s * 1e9)
        data = encode_state(state, child.format(name), frame.format(name), stamp)
        lines.append(Line(topic.format(name), ODOMETRY, stamp + round(late * 1e9), data))
    return lines


def write(path, lines, plugin=StoragePlugin.MCAP):
    """Write a genuine bag."""
    return rosbags_bag(path, map(astuple, lines), plugin)


@pytest.fixture
def plain(tmp_path):
    return read_log(save(geographic(crossing()), tmp_path)).encounters[0]


@pytest.mark.parametrize("plugin", StoragePlugin, ids=lambda plugin: plugin.value)
def test_fixes_and_speeds(tmp_path, plain, plugin):
    bag = write(tmp_path / "drive", streams(crossing()), plugin)
    (bare,) = (file for file in bag.iterdir() if file.suffix in (".mcap", ".db3"))
    for path in (bag, bare):
        result = read_log(path)
        (encounter,) = result.encounters
        assert encounter.name == "drive"
        assert [vehicle.id for vehicle in encounter.vehicles] == ["a", "b"]
        assert encounter.start_ns == plain.start_ns  # of the header, not of the reception
        np.testing.assert_allclose(encounter.position, plain.position, atol=1e-3)
        assert result.quality.rows == 484
    (bag / "metadata.yaml").unlink()
    assert len(read_log(bag).encounters) == 1


@pytest.mark.parametrize("compression", [None, *Ros1Writer.CompressionFormat], ids=str)
def test_ros_1_bag_equals_ros_2(tmp_path, compression):
    """Its headers have a number, its types other names, and one topic is of a type that nobody knows."""
    types = get_typestore(Stores.ROS1_NOETIC)
    types.register(
        get_types_from_msg("std_msgs/Header header\ntime at\nstring[] words", "my_msgs/msg/Odd")
    )
    lines = [*streams(crossing()), *odometry(crossing())]
    writer = Ros1Writer(tmp_path / "drive.bag")
    if compression:
        writer.set_compression(compression)
    with writer:
        known = {}
        for line in lines:
            if line.topic not in known:
                known[line.topic] = writer.add_connection(line.topic, line.type, typestore=types)
            writer.write(known[line.topic], line.stamp, STORES.cdr_to_ros1(line.data, line.type))
        odd = writer.add_connection("/odd", "my_msgs/msg/Odd", typestore=types, latching=1)
        time = types.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2)
        head = types.types["std_msgs/msg/Header"](seq=7, stamp=time, frame_id="map")
        message = types.types["my_msgs/msg/Odd"](header=head, at=time, words=["a", "bc"])
        writer.write(odd, 5, types.serialize_ros1(message, "my_msgs/msg/Odd"))
    write(tmp_path / "drive", lines)
    for kinds in (FIX, TWIST), (ODOMETRY,):
        config = LogConfig(
            topics=",".join(dict.fromkeys(line.topic for line in lines if line.type in kinds))
        )
        first, second = (
            read_log(tmp_path / name, config).encounters[0] for name in ("drive.bag", "drive")
        )
        for name in ("position", "heading", "speed"):
            assert getattr(first, name).tobytes() == getattr(second, name).tobytes()
    (latched,) = (topic for topic in bag_topics(tmp_path / "drive.bag") if topic.name == "/odd")
    assert (latched.count, latched.quality.transient_local) == (1, True)
    (found,) = read_messages(tmp_path / "drive.bag", lambda name: name == "/odd")
    ros2 = get_typestore(Stores.ROS2_JAZZY)
    ros2.register(
        get_types_from_msg(
            "std_msgs/Header header\nbuiltin_interfaces/Time at\nstring[] words", "my_msgs/msg/Odd"
        )
    )
    assert ros2.deserialize_cdr(found.data, "my_msgs/msg/Odd").words == ["a", "bc"]


@pytest.mark.parametrize("damage", ["cut", "not closed", "other fields", "bomb"])
def test_unreadable_ros_1_bag_is_named(tmp_path, damage):
    types = get_typestore(Stores.ROS1_NOETIC)
    if damage == "other fields":
        types = get_typestore(Stores.EMPTY)
        types.register(get_types_from_msg("float64 latitude", FIX))
    path, writer = tmp_path / "drive.bag", Ros1Writer(tmp_path / "drive.bag")
    writer.set_compression(Ros1Writer.CompressionFormat.BZ2)
    with writer:
        connection = writer.add_connection("/a/fix", FIX, typestore=types)
        writer.write(connection, 5, bytes(100_000_000 if damage == "bomb" else 100))
    whole = path.read_bytes()
    if damage == "cut":
        path.write_bytes(whole[: len(whole) // 2])
    elif damage == "not closed":
        place = whole.index(b"index_pos=") + 10
        path.write_bytes(whole[:place] + bytes(8) + whole[place + 8 :])
    with pytest.raises(
        InputError, match=r"drive\.bag.*(rosbag reindex|choose other topics|most_chunk_bytes)"
    ):
        read_log(path)


def test_channels_without_schema_break_nothing(tmp_path):
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = McapWriter(stream)
        writer.start(profile="ros2")
        other = writer.register_schema("Status", "jsonschema", b"{}")
        channels = [
            writer.register_channel("/bare", "json", 0),
            writer.register_channel("/status", "json", other),
        ]
        for line in odometry(crossing()):
            if line.topic not in channels:
                channels.append(line.topic)
                schema = writer.register_schema(
                    line.type, "ros2msg", definition(line.type)[0].encode()
                )
                channels.append(writer.register_channel(line.topic, "cdr", schema))
            number = channels[channels.index(line.topic) + 1]
            writer.add_message(
                number, log_time=line.stamp, data=line.data, publish_time=line.stamp
            )
            for bare in channels[:2]:
                writer.add_message(bare, log_time=line.stamp, data=b"{}", publish_time=line.stamp)
        writer.finish()
    assert len(read_log(tmp_path / "a.mcap").encounters) == 1
    with pytest.raises(InputError, match=r"topic /bare has no type"):
        list(read_messages(tmp_path / "a.mcap", lambda name: name == "/bare"))


def test_missing_stamps_mean_time_of_reception(tmp_path, plain):
    result = read_log(write(tmp_path / "bag", streams(crossing(), stamped=False)))
    assert any("no header stamps" in line for line in result.quality.lines())
    assert abs(result.encounters[0].start_ns - plain.start_ns) <= 100_000_000


def test_without_speeds_the_positions_tell(tmp_path, plain):
    result = read_log(
        write(tmp_path / "bag", [line for line in streams(crossing()) if line.type == FIX])
    )
    np.testing.assert_allclose(result.encounters[0].speed, plain.speed, atol=0.8)
    assert any("has no speeds" in line for line in result.quality.lines())


def test_a_fix_without_fix_is_dropped(tmp_path):
    lines = streams(crossing())
    bad = STORES.deserialize_cdr(lines[40].data, FIX)
    bad.status.status = -1
    lines[40].data = bytes(STORES.serialize_cdr(bad, FIX))
    (drop,) = read_log(write(tmp_path / "bag", lines)).quality.dropped
    assert (drop.reason, drop.count) == ("position is not a number", 1)
    assert drop.first.endswith("topic /vehicle_a/fix, message 11")


def of(rows, name):
    return rows[rows.vehicle_id == name]


def transform(stamp_s, *entries, topic="/tf"):
    """A message of transforms (parent, child, x, y, turn)."""
    types = STORES.types
    made = [
        types["geometry_msgs/msg/TransformStamped"](
            header(round(stamp_s * 1e9), parent),
            child,
            types["geometry_msgs/msg/Transform"](
                types["geometry_msgs/msg/Vector3"](x, y, 0.0),
                types["geometry_msgs/msg/Quaternion"](
                    x=0.0, y=0.0, z=np.sin(turn / 2.0), w=np.cos(turn / 2.0)
                ),
            ),
        )
        for parent, child, x, y, turn in entries
    ]
    data = STORES.serialize_cdr(types[TRANSFORMS](made), TRANSFORMS)
    return Line(topic, TRANSFORMS, round(stamp_s * 1e9), bytes(data))


def transforms(rows):
    """The rows as transforms of body frames in map."""
    return [
        transform(
            row.t_s,
            ("map", f"{row.vehicle_id}/base_link", row.x_m, row.y_m, 0.0),
            (f"{row.vehicle_id}/base_link", f"{row.vehicle_id}/lidar", 1.0, 0.0, 0.0),
        )
        for row in rows.itertuples()
    ]


TURNS = {"a": 1.0, "b": -2.0}  # of the frames in which each vehicle's odometry counts
SHIFTS = {"a": (5.0, 7.0), "b": (-30.0, 2.0)}


def local(rows):
    """The rows in the odometry frame of each vehicle."""
    yaw = rows.vehicle_id.map({"a": 0.0, "b": np.pi / 2.0}) - rows.vehicle_id.map(TURNS)
    shift = np.array(rows.vehicle_id.map(SHIFTS).tolist())
    place = rows[["x_m", "y_m"]].to_numpy() - shift
    turn = -rows.vehicle_id.map(TURNS).to_numpy()
    x = np.cos(turn) * place[:, 0] - np.sin(turn) * place[:, 1]
    y = np.sin(turn) * place[:, 0] + np.cos(turn) * place[:, 1]
    return rows.assign(x_m=x, y_m=y, yaw=yaw)


def tied(stamps, topic):
    """Transforms from map to the odometry frame of each vehicle."""
    frames = [("map", f"{name}/odom", *SHIFTS[name], TURNS[name]) for name in "ab"]
    return [transform(stamp, *frames, topic=topic) for stamp in stamps]


def chain(rows):
    """Transforms map -> odom -> base_link alone."""
    lines = tied(rows.t_s.unique()[::5], "/tf")
    for row in local(rows).itertuples():
        name = row.vehicle_id
        entry = (f"{name}/odom", f"{name}/base_link", row.x_m, row.y_m, row.yaw)
        lines.append(transform(row.t_s, entry))
    return lines


def poses(rows):
    lines = []
    for line in odometry(rows, "/{}/pose"):
        message = STORES.deserialize_cdr(line.data, ODOMETRY)
        pose = STORES.types[POSE](message.header, message.pose.pose)
        lines.append(Line(line.topic, POSE, line.stamp, bytes(STORES.serialize_cdr(pose, POSE))))
    return lines


WAYS = {  # of recording two vehicles in one bag
    "odometry": odometry,
    "the first level in which topics differ": lambda rows: odometry(
        rows, "/fleet/vehicle_{}/local/ekf/odom"
    ),
    "child frames": lambda rows: odometry(rows, "/odom", child="{}/base_link"),
    "raw and filtered": lambda rows: [*odometry(rows), *odometry(rows, "/{}/odometry/filtered")],
    "transforms": transforms,
    "x points north": lambda rows: odometry(
        rows.assign(
            x_m=rows.y_m, y_m=rows.x_m, yaw=np.where(rows.vehicle_id == "a", np.pi / 2.0, 0.0)
        ),
        frame="map_ned",
    ),
    "poses": poses,
    "poses beside odometry": lambda rows: [*odometry(of(rows, "a")), *poses(of(rows, "b"))],
    "static transforms to map": lambda rows: [
        *odometry(local(rows), frame="{}/odom"),
        *tied([999.0], "/tf_static"),
    ],
    "moving transforms to map": lambda rows: [
        *odometry(local(rows), frame="{}/odom"),
        *tied(rows.t_s.unique()[::5], "/tf"),
    ],
    "a chain of transforms": chain,
    "localisation beside odometry": lambda rows: [
        *odometry(local(rows), frame="{}/odom"),
        *poses(rows[rows.t_s * 10 % 7 < 2.0]),
    ],
    "rear axles": lambda rows: [
        *odometry(
            rows.assign(
                x_m=rows.x_m - 1.4 * (rows.vehicle_id == "a"),
                y_m=rows.y_m - 1.4 * (rows.vehicle_id == "b"),
            ),
            child="{}/rear_axle",
        ),
        transform(999.0, *((f"{n}/rear_axle", f"{n}/center", 1.4, 0.0, 0.0) for n in "ab")),
    ],
}


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_ways_of_recording_two_vehicles(tmp_path, way):
    (plain,) = read_log(save(crossing(), tmp_path)).encounters
    (encounter,) = read_log(write(tmp_path / "bag", way(crossing()))).encounters
    assert [vehicle.id for vehicle in encounter.vehicles] == ["a", "b"]
    np.testing.assert_allclose(encounter.position, plain.position, atol=0.3)
    np.testing.assert_allclose(encounter.heading, plain.heading, atol=0.02)


def test_topic_in_each_bag_names_vehicles(tmp_path):
    rows = crossing()
    bags = [write(tmp_path / f"bag_{name}", odometry(of(rows, name), "/odom")) for name in "ab"]
    (encounter,) = read_log(bags).encounters
    assert [vehicle.id for vehicle in encounter.vehicles] == ["bag_a", "bag_b"]


def test_folder_of_bags_and_tables_works(tmp_path):
    bag = write(tmp_path / "bag", odometry(crossing()))
    folder = tmp_path / "drives"
    folder.mkdir()
    (plain,) = read_log(save(crossing(), folder, "day1.csv")).encounters
    next(bag.glob("*.mcap")).rename(folder / "run.mcap")
    encounters = read_log(folder).encounters
    assert {encounter.name for encounter in encounters} == {"run", "day1"}
    for encounter in encounters:
        np.testing.assert_allclose(encounter.position, plain.position, atol=0.02)


def test_differing_header_clocks_are_a_doubt(tmp_path):
    (plain,) = read_log(save(crossing(), tmp_path)).encounters
    rows = crossing()
    ahead = of(rows, "a").assign(t_s=lambda own: own.t_s + 2.0)
    lines = [*odometry(ahead, late=-2.0), *odometry(of(rows, "b"))]
    bag = write(tmp_path / "bag", sorted(lines, key=lambda line: line.stamp))
    with pytest.raises(DoubtError, match=r"clocks differ by 2\.0 s.*--set log\.stamps=received"):
        read_log(bag)
    (encounter,) = read_log(bag, LogConfig(stamps="received")).encounters
    np.testing.assert_allclose(encounter.position, plain.position, atol=0.02)


def test_faster_header_clock_is_reported(tmp_path):
    rows = crossing()
    other = of(rows, "b")
    late = (other.t_s - 1000.0) * (1.0 / 1.03 - 1.0)
    lines = odometry(of(rows, "a"))
    for line, by in zip(odometry(other), late, strict=True):
        lines.append(replace(line, stamp=line.stamp + round(by * 1e9)))
    bag = write(tmp_path / "bag", sorted(lines, key=lambda line: line.stamp))
    assert "runs 1.03 times as fast" in " ".join(map(str, read_log(bag).doubts))


def test_clocks_of_objects_and_ego_compared(tmp_path):
    path, _ = tracked(tmp_path)
    (bag,) = path.glob("*.mcap")
    lines = [
        Line(m.topic, m.type, m.stamp_ns, m.data) for m in read_messages(bag, lambda _: True)
    ][1:]
    ego = of(crossing(start=2.0), "a").assign(y_m=-2.0)
    lines += odometry(ego, "/localization/kinematic_state", late=-2.0)
    both = write(tmp_path / "both", sorted(lines, key=lambda line: line.stamp))
    with pytest.raises(DoubtError, match=r"clocks differ by 2\.0 s.*--set log\.stamps=received"):
        read_log(both)
    assert "ego" in read_log(both, stamps="received").encounters[0].ids


def test_window_of_large_bag_is_unchanged(tmp_path, monkeypatch):
    bag = write(tmp_path / "drive", streams(crossing(40.0)))
    config = LogConfig(start=12.0, end=20.0)
    whole = read_log(bag, config)
    monkeypatch.setattr(scenario_gen.logs.bag, "LARGE_COUNT", 10)
    part = read_log(bag, replace(config, row_limit=whole.quality.rows - 1))
    (expected,), (encounter,) = whole.encounters, part.encounters
    assert encounter.start_ns == expected.start_ns
    np.testing.assert_array_equal(encounter.position, expected.position)
    assert part.quality.rows < whole.quality.rows


def test_stamps_in_milliseconds_stop(tmp_path):
    lines = odometry(crossing().assign(t_s=lambda own: own.t_s * 1000.0))
    for line in lines:
        line.stamp //= 1000
    bag = write(tmp_path / "bag", lines)
    with pytest.raises(DoubtError, match=r"1e\+03 times as fast.*--set log\.stamps=received"):
        read_log(bag)
    assert read_log(bag, stamps="received").encounters[0].speed.max() < 8.5


def test_recorded_tracks_are_read_bit_exactly(tmp_path, plain):
    data = encode_tracks(plain)
    lines = [
        Line("/case/tracks", TRACKS, 5, data),
        Line("/case/tracks", TRACKS, 6, data),
        *streams(crossing()),
    ]
    result = read_log(write(tmp_path / "bag", lines))
    (encounter,) = result.encounters
    assert encounter.name == "bag"
    for field in ("position", "heading", "speed"):
        assert getattr(encounter, field).tobytes() == getattr(plain, field).tobytes()
    assert (encounter.vehicles, encounter.start_ns, encounter.dt_ns) == (
        plain.vehicles,
        plain.start_ns,
        plain.dt_ns,
    )
    assert "/vehicle_a/fix" in result.quality.notes[0]
    part = read_log(tmp_path / "bag", LogConfig(start=2.0, end=5.0)).encounters[0]
    np.testing.assert_array_equal(part.position, plain.position[:, 20:51])
    chosen = read_log(
        tmp_path / "bag",
        LogConfig(topics="/vehicle_a/fix,/vehicle_a/speed,/vehicle_b/fix,/vehicle_b/speed"),
    )
    np.testing.assert_allclose(chosen.encounters[0].position, plain.position, atol=1e-3)
    with pytest.raises(InputError, match="at least 2"):
        read_log(tmp_path / "bag", LogConfig(vehicles="a"))


def test_several_tracks_are_several_encounters(tmp_path, plain):
    part = encode_tracks(read_log(tmp_path / "log.csv", LogConfig(end=8.0)).encounters[0])
    lines = [
        Line("/a/tracks", TRACKS, 5, encode_tracks(plain)),
        Line("/b/tracks", TRACKS, 6, part),
    ]
    assert [e.name for e in read_log(write(tmp_path / "bag", lines)).encounters] == [
        "bag-1",
        "bag-2",
    ]


@pytest.mark.parametrize("frame", ["gps" + "x" * k for k in range(9)])
def test_fix_is_read_with_any_frame(frame):
    fix = fix_of(header(7_000_000_005, frame), 48.1, 11.5)
    (samples,) = decode_samples([fix], FIX, str)
    assert samples.fix.tolist() == [[48.1, 11.5]] and samples.height.tolist() == [500.0]
    assert samples.stamp_ns.tolist() == [7_000_000_005] and samples.frame == ""


def chatter(_):
    text = STORES.serialize_cdr(STORES.types[STRING](data="hi"), STRING)
    return [Line("/chatter", STRING, 1, bytes(text))]


def damaged(rows):
    lines = streams(rows)
    return [*lines[:8], replace(lines[8], data=lines[8].data[:20]), *lines[9:]]


def two_receivers(rows):
    lines = streams(rows)
    return [*lines, replace(lines[0], topic="/vehicle_a/gps")]


REFUSED = {  # name: what is recorded, topics that are asked for, what the error names
    "frames of vehicles": (lambda rows: odometry(rows, frame="{}/odom"), "", "a/odom.*b/odom"),
    "a frame of odometry": (lambda rows: odometry(rows, frame="odom"), "", "'odom'"),
    "a frame that moves": (lambda rows: odometry(rows, frame="a/base_link"), "", "a/base_link"),
    "unknown types": (chatter, "", rf"/chatter \({STRING}\).*{FIX}"),
    "an unknown type that is asked for": (chatter, "/chatter", rf"/chatter: type {STRING}"),
    "no such topic": (chatter, "/fix", "'/fix'.*/chatter"),
    "two odometries": (
        lambda rows: [
            *odometry(of(rows, "a"), "/odom"),
            *odometry(of(rows, "a"), "/odometry/filtered"),
        ],
        "",
        "one vehicle",
    ),
    "two receivers": (two_receivers, "", "/vehicle_a/fix and /vehicle_a/gps"),
    "mixed types": (lambda rows: [*streams(rows), *odometry(rows)], "", r"log\.topics"),
    "speeds alone": (
        lambda rows: [line for line in streams(rows) if line.type == TWIST],
        "",
        "positions of a, b",
    ),
    "a damaged message": (damaged, "", rf"/vehicle_a/fix, message 3: not a {FIX}"),
}


@pytest.mark.parametrize(("recorded", "topics", "said"), REFUSED.values(), ids=REFUSED)
def test_unusable_topics_are_named(tmp_path, recorded, topics, said):
    bag = write(tmp_path / "bag", recorded(crossing()))
    with pytest.raises(InputError, match=said):
        read_log(bag, LogConfig(topics=topics))
