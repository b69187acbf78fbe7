# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags that once broke a reader, and bombs: an error that names the file, or what is whole of them; in little memory."""

from dataclasses import replace
import re
import resource
import shutil

from mcap.writer import CompressionType
import pytest
from support.bag_examples import copied, hand_made_run
from support.cut_bags import mcap_bytes

from msg_conventions import trajectory
from scenario_gen.bags.recordings.write import result_messages, write_recording
from scenario_gen.bags.storage.bag import bag_warnings, read_messages
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import InputError
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.types import Cause


def test_a_bag_without_metadata_is_read(tmp_path):
    bag = write_recording(tmp_path / "bag", hand_made_run())
    (bag / "metadata.yaml").unlink()
    assert not bag_warnings(bag)
    assert len(list(read_messages(bag))) == len(list(result_messages(hand_made_run())))


def bomb(path, size, chunks=1):
    """An MCAP file of a few kilobytes per gigabyte: chunks of `size` zeros in one message each."""
    messages = ((k, bytes(size)) for k in range(chunks))
    path.write_bytes(mcap_bytes(messages, chunk_size=1, compression=CompressionType.ZSTD))
    return path


def test_a_chunk_has_bounds(tmp_path):
    path = bomb(tmp_path / "a.mcap", 5_000_000)
    small = BagConfig(most_chunk_bytes=1_000_000)
    with pytest.raises(InputError, match=r"a\.mcap.*bag\.most_chunk_bytes is 1000000"):
        list(read_messages(path, config=small))
    assert len(list(read_messages(path))) == 1


def test_default_bounds_keep_memory_small(tmp_path):
    path = bomb(tmp_path / "a.mcap", 60_000_000, chunks=10)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError, match=r"bag\.most_bytes"):
        for _ in read_messages(path):
            pass
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 400_000  # kB


def test_split_files_are_read_by_time(tmp_path):
    for k in range(3):
        with BagWriter(tmp_path / f"part{k}") as bag:
            bag.add_topic("/t", "std_msgs/msg/String")
            for stamp in range(k, 30, 3):
                bag.write("/t", b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00" + bytes([k]), stamp // 2)
    folder = tmp_path / "bag"
    folder.mkdir()
    for k in range(3):
        shutil.copy(tmp_path / f"part{k}" / f"part{k}_0.mcap", folder / f"bag_{k}.mcap")
    read = [(message.stamp_ns, message.data[-1]) for message in read_messages(folder)]
    assert read == sorted((stamp // 2, k) for k in range(3) for stamp in range(k, 30, 3))


def changed(tmp_path, topic, change):
    """A bag in which `change` has changed the messages of a topic."""
    bag = write_recording(tmp_path / "bag", hand_made_run())
    return copied(
        bag,
        tmp_path / "broken",
        lambda message: change(message.data) if message.topic == topic else message.data,
    )


@pytest.mark.parametrize(
    "topic", ["/tracks", "/map", "/changepoints", "/scenarios/info", "/scenarios"]
)
@pytest.mark.parametrize("damage", ["cut", "other type"])
def test_damaged_messages_are_named_or_found(tmp_path, topic, damage):
    another = "map" if topic != "/map" else "tracks"
    (other,) = (data for name, data, _ in result_messages(hand_made_run()) if name == another)
    broken = changed(
        tmp_path, topic, lambda data: other if damage == "other type" else data[: len(data) // 2]
    )
    if topic == "/scenarios/info":
        with pytest.raises(InputError, match=topic):
            evaluate_bag(broken)
        return
    (found,) = evaluate_bag(broken)
    if topic == "/scenarios" or damage == "cut":
        assert found.valid == 0 and len(found.causes[Cause.UNUSABLE]) == 5
        assert all(topic in message for message in found.causes[Cause.UNUSABLE].values())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda message: replace(message, position=message.position * 1e9), "position is"),
        (lambda message: replace(message, speed=message.speed * 1e6), "speed is"),
        (
            lambda message: replace(message, time_ns=message.time_ns * 10_000),
            "at most 7200 s|steps of 0.001 to 10 s",
        ),
        (
            lambda message: replace(
                message, vehicles=tuple(replace(v, length=1e9) for v in message.vehicles)
            ),
            "0.01 to 1000 m",
        ),
    ],
    ids=["position", "speed", "time", "length"],
)
@pytest.mark.parametrize("topic", ["/tracks", "/scenarios"])
def test_impossible_motion_is_refused_early(tmp_path, topic, change, said):
    broken = changed(
        tmp_path, topic, lambda data: trajectory.encode(change(trajectory.decode(data, topic)))
    )
    (found,) = evaluate_bag(broken)
    assert found.valid == 0 and found.result is None
    assert all(re.search(said, message) for message in found.causes[Cause.UNUSABLE].values())
