# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags: what is written opens everywhere, the same bytes each time, whole or not at all; what others wrote can be read."""

from collections import Counter
from dataclasses import replace
import os
from pathlib import Path
import subprocess
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores
from support.bag_examples import bag_topics, hand_made_run
import yaml

from msg_conventions.scenario_info import INFO
from msg_conventions.scenarios import messages_of
from msg_conventions.topics import topic_entry
from scenario_gen.bags.recordings.read import load, read_recording
from scenario_gen.bags.recordings.write import result_messages, write_recording
from scenario_gen.bags.storage.bag import bag_warnings, read_messages
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import InputError
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.types import describe_segments
from scenario_gen.types.generation import GenerationResult


@pytest.fixture
def run() -> GenerationResult:
    return hand_made_run()


def test_every_message_decodes_in_every_reader(run, tmp_path):
    folder = write_recording(tmp_path / "bag", {"/a": run, "": run})
    expected = 2 * len(list(result_messages(run)))
    counts = Counter()
    with AnyReader([folder], default_typestore=get_typestore(Stores.EMPTY)) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
            counts["rosbags"] += 1
    with (folder / "bag_0.mcap").open("rb") as stream:
        for schema, channel, _, message in make_reader(
            stream, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            assert message is not None
            assert schema.encoding == "ros2msg"
            assert channel.message_encoding == "cdr"
            counts["mcap_ros2"] += 1
    assert counts == {"rosbags": expected, "mcap_ros2": expected}
    assert len(list(read_messages(folder))) == expected


def test_the_file_says_what_rosbag2_wants(run, tmp_path):
    folder = write_recording(tmp_path / "bag", run)
    store = get_typestore(Stores.ROS2_JAZZY)
    with (folder / "bag_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary.chunk_indexes
        assert summary.chunk_indexes[0].compression == "zstd"
        for channel in summary.channels.values():
            schema = summary.schemas[channel.schema_id]
            assert channel.metadata["topic_type_hash"] == store.hash_rihs01(schema.name)
            (profile,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
            assert profile["durability"] == "transient_local"
            assert profile["depth"] == (
                1000 if "scenarios" in channel.topic else 100 if "diag" in channel.topic else 1
            )
    text = (folder / "metadata.yaml").read_text()
    info = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert info["version"] == 9
    assert info["storage_identifier"] == "mcap"
    assert info["relative_file_paths"] == ["bag_0.mcap"]
    assert info["starting_time"]["nanoseconds_since_epoch"] == run.encounter.start_ns
    assert info["message_count"] == sum(
        topic["message_count"] for topic in info["topics_with_message_count"]
    )
    topics = {
        topic["topic_metadata"]["name"]: topic["topic_metadata"]
        for topic in info["topics_with_message_count"]
    }
    assert topics["/scenarios"]["offered_qos_profiles"][0]["reliability"] == "reliable"
    assert "/vehicle_bus_2/route" in topics
    assert "&" not in text


@pytest.mark.parametrize(
    "indices",
    [(0, 1, 2, 3, 4), (1, 2, 1_000_001, 1_000_003, 4)],
    ids=["none refused", "refused and adapted"],
)
@pytest.mark.parametrize("begun", [3, 5, 7])
def test_repeated_request_counts_once(run, tmp_path, indices, begun):
    """As a sampler publishes it that was killed in the midst of it and started again."""
    scenarios = tuple(
        replace(s, index=index) for s, index in zip(run.generated.scenarios, indices, strict=True)
    )
    run = replace(run, generated=replace(run.generated, scenarios=scenarios))
    whole = list(read_messages(write_recording(tmp_path / "whole", run)))
    told = [message for message in whole if message.topic in ("/scenarios", "/scenarios/info")]
    bag = BagWriter(tmp_path / "twice")
    for topic in bag_topics(tmp_path / "whole"):
        bag.add_topic(topic.name, topic.type)
    for k, message in enumerate([*whole, *told[:begun], *told]):
        bag.write(message.topic, message.data, whole[0].stamp_ns + k)
    bag.close()
    got = load(tmp_path / "twice").generated
    assert [s.index for s in got.scenarios] == list(indices)
    assert [s.position.tobytes() for s in got.scenarios] == [
        s.position.tobytes() for s in run.generated.scenarios
    ]


def test_same_run_same_bytes(run, tmp_path):
    one, two = (write_recording(tmp_path / name / "bag", run) for name in "ab")
    for name in ("bag_0.mcap", "metadata.yaml"):
        assert (one / name).read_bytes() == (two / name).read_bytes()


def test_nothing_is_half_written(run, tmp_path):
    broken = replace(
        run, routes=(run.routes[0], replace(run.routes[1], anchor=np.array([0, 10, 22, 99])))
    )
    with pytest.raises(IndexError):
        write_recording(tmp_path / "bag", broken)
    assert list(tmp_path.iterdir()) == []
    write_recording(tmp_path / "bag", run)
    with pytest.raises(IndexError):
        write_recording(tmp_path / "bag", broken)
    assert len(list(read_messages(tmp_path / "bag"))) == len(
        list(result_messages(run))
    )  # the earlier one is still there
    write_recording(tmp_path / "bag", run)
    assert [p.name for p in tmp_path.iterdir()] == ["bag"]
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").touch()
    with pytest.raises(InputError, match=r"holds notes\.txt and is not an earlier result"):
        write_recording(tmp_path / "mine", run)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file"):
        write_recording(tmp_path / "file" / "bag", run)


KILLED = """
import os, sys
from pathlib import Path
from scenario_gen.bags.storage.writer import BagWriter
bag = BagWriter(Path(sys.argv[1]), chunk_bytes=2000)
bag.add_topic("/t", "std_msgs/msg/String")
for k in range(1000):
    bag.write("/t", b"\\x00\\x01\\x00\\x00\\x02\\x00\\x00\\x00a\\x00", k)
os.kill(os.getpid(), 9)
"""


def test_killed_recording_loses_its_last_chunk(tmp_path):
    assert (
        subprocess.run(
            [sys.executable, "-c", KILLED, str(tmp_path / "bag")], check=False
        ).returncode
        == -9
    )
    stamps = [message.stamp_ns for message in read_messages(tmp_path / "bag")]
    assert 950 <= len(stamps) < 1000  # a chunk of 2000 bytes holds about 50 such messages
    assert stamps == list(range(len(stamps)))
    assert "not closed by its recorder" in bag_warnings(tmp_path / "bag")[0]


def test_unknown_type_names_its_search_path(tmp_path):
    with (
        pytest.raises(InputError, match=r"no_such/msg/Thing.*AMENT_PREFIX_PATH"),
        BagWriter(tmp_path / "bag") as bag,
    ):
        bag.add_topic("/t", "no_such/msg/Thing")


def test_type_of_installed_package_is_found(tmp_path, monkeypatch):
    share = tmp_path / "share" / "my_msgs" / "msg"
    share.mkdir(parents=True)
    (share / "Inner.msg").write_text("float64[3] a\nstd_msgs/Header h\n")
    (share / "Outer.msg").write_text("Inner[] many\nInner one\nstring s\n")
    monkeypatch.setenv(
        "AMENT_PREFIX_PATH", os.pathsep.join([str(tmp_path / "elsewhere"), str(tmp_path)])
    )
    with BagWriter(tmp_path / "bag") as bag:
        bag.add_topic("/t", "my_msgs/msg/Outer")
        bag.write("/t", b"\x00\x01\x00\x00", 1)
    assert bag_topics(tmp_path / "bag")[0].type == "my_msgs/msg/Outer"


@pytest.mark.parametrize("name", ["wbag", "talker", "cdr_test", "test_bag_for_seek"])
def test_rosbag2_bags_are_read_alike(data: Path, name):
    read = {}
    for storage in ("mcap", "sqlite3"):
        folder = data / "bags" / storage / name
        messages = list(read_messages(folder))
        info = yaml.safe_load((folder / "metadata.yaml").read_text())[
            "rosbag2_bagfile_information"
        ]
        assert len(messages) == info["message_count"]
        assert sum(topic.count for topic in bag_topics(folder)) == len(messages)
        read[storage] = Counter((m.topic, m.type) for m in messages)
    assert read["mcap"] == read["sqlite3"]


def test_changing_presence_is_read_back(run, tmp_path):
    present = np.array([[0, 60], [20, 50]])
    scenarios = tuple(replace(scenario, present=present) for scenario in run.generated.scenarios)
    late = replace(
        run,
        encounter=replace(run.encounter, present=present),
        generated=replace(run.generated, scenarios=scenarios),
    )
    folder = write_recording(tmp_path / "bag", late)
    assert sum(message.topic == "/scenarios" for message in read_messages(folder)) == 2 * len(
        scenarios
    )
    found = read_recording(folder).namespaces[""]
    assert not found.missing
    assert not found.unknown
    assert found.encounter.present.tolist() == present.tolist()
    for before, after in zip(scenarios, found.scenario_set().scenarios, strict=True):
        for name in ("position", "heading", "speed", "acceleration", "present"):
            assert getattr(before, name).tobytes() == getattr(after, name).tobytes()
    (info, entry), summary = found.infos[2], found.summaries[0]
    alone = found.messages_of(info, entry, summary)
    assert [message.data for message in alone if message.topic == "/scenarios"] == list(
        messages_of(found.data("scenarios")[2])
    )


def test_saved_result_is_loaded_unchanged(run, tmp_path):
    found = load(run.save(tmp_path / "bag"))
    assert (len(found), found.seed, found.generated.candidates) == (
        5,
        7,
        8,
    ) and found.generated.refused == run.generated.refused
    assert all(np.array_equal(a.position, b.position) for a, b in zip(found, run, strict=True))
    assert found.road is not None and np.array_equal(found.road.drivable, run.road.drivable)
    assert (
        np.array_equal(found.segmentation.changepoints, run.segmentation.changepoints)
        and not found.evaluation.rows
    )
    described = describe_segments(found.encounter, run.segmentation.changepoints)
    assert found.segmentation.descriptions == described


def test_folder_without_result_is_refused(run, tmp_path):
    folder = write_recording(tmp_path / "bag", {"/case_1": run, "/case_2": run})
    assert len(load(str(folder), "/case_2")) == 5
    with pytest.raises(InputError, match="choose one: namespace='/case_1' or '/case_2'"):
        load(folder)
    with pytest.raises(InputError, match="no namespace has; is it a log"):
        load(bundled("a"))


def test_bag_of_draft_names_its_remedy(run, tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        for topic, data, stamp in result_messages(run):
            kind = (
                "diagnostic_msgs/msg/DiagnosticArray" if topic == INFO else topic_entry(topic)[0]
            )
            bag.add_topic(f"/{topic}", kind)
            bag.write(f"/{topic}", data, stamp)
    with pytest.raises(InputError, match=r"draft.*`scenario-gen generate .*bag`"):
        load(tmp_path / "bag")
    (again,) = read_log(tmp_path / "bag").encounters
    assert np.array_equal(again.position, run.encounter.position)
