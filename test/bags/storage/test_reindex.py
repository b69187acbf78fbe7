# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Saving what is whole of a damaged bag: every whole chunk, whatever else is cut off, lost or overwritten."""

from io import BytesIO
import random
import shutil

from mcap.reader import make_reader
import pytest
from rosbags.rosbag2 import Reader
from support.cut_bags import chunk_ends, salvaged, small_bag
from support.lengths import LONG
from typer.testing import CliRunner

from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.bags.storage.reindex import reindex
from scenario_gen.base.errors import InputError
from scenario_gen.cli.commands import app


@pytest.fixture(params=["compressed", "plain"])
def bag(request, tmp_path):
    return small_bag(tmp_path / "bag", compress=request.param == "compressed")


def told(path):
    return [(m.topic, m.type, m.stamp_ns, m.data) for m in read_messages(path)]


def test_every_cut_leaves_the_whole_chunks_before_it(bag, tmp_path):
    """Every cut; in the short form those near the ends of the last two chunks, and others."""
    whole, messages = bag.read_bytes(), told(bag)
    ends = chunk_ends(whole)
    rng = random.Random(3)
    near = [
        cut
        for cut in range(ends[-3][0], ends[-1][0] + 1)
        if any(-100 <= cut - end <= 20 for end, _ in ends)
    ]
    for cut in (
        range(len(whole) + 1) if LONG else (*near, *(rng.randrange(len(whole)) for _ in range(60)))
    ):
        expected = max((count for end, count in ends if end <= cut), default=0)
        found = salvaged(whole[:cut], tmp_path / "cut.mcap")
        assert found == [(stamp, data) for _, _, stamp, data in messages[:expected]], cut


def test_what_is_saved_of_a_cut_bag_opens_everywhere(bag, tmp_path):
    whole, messages = bag.read_bytes(), told(bag)
    ends = chunk_ends(whole)
    rng = random.Random(5)
    few = (0, 1, 8, len(whole) - 1, *(rng.randrange(len(whole)) for _ in range(8)))
    for cut in range(len(whole)) if LONG else few:
        (tmp_path / "cut.mcap").write_bytes(whole[:cut])
        expected = max((count for end, count in ends if end <= cut), default=0)
        shutil.rmtree(tmp_path / "saved", ignore_errors=True)
        if not expected:
            with pytest.raises(InputError, match="no whole message"):
                reindex(tmp_path / "cut.mcap", tmp_path / "saved")
            continue
        made = reindex(tmp_path / "cut.mcap", tmp_path / "saved")
        assert made.messages == expected and made.unclosed == ("cut.mcap",)
        assert told(tmp_path / "saved") == messages[:expected]
        with Reader(tmp_path / "saved") as reader:
            assert [(c.topic, stamp, bytes(data)) for c, stamp, data in reader.messages()] == [
                (topic, stamp, data) for topic, _, stamp, data in messages[:expected]
            ]
        with (tmp_path / "saved" / "saved_0.mcap").open("rb") as stream:
            assert sum(1 for _ in make_reader(stream).iter_messages()) == expected


@pytest.mark.parametrize("what", ["content", "length", "opcode", "nothing left", "zeros"])
def test_a_damaged_chunk_costs_no_other(bag, tmp_path, what):
    whole, messages = bag.read_bytes(), told(bag)
    ends = chunk_ends(whole)
    starts = [8 + 9 + int.from_bytes(whole[9:17], "little")]
    for end, _ in ends[:-1]:
        at = end
        while whole[at] != 6:  # indexes stand between chunks
            at += 9 + int.from_bytes(whole[at + 1 : at + 9], "little")
        starts.append(at)
    for k, (start, (end, _)) in enumerate(zip(starts, ends, strict=True)):
        broken = bytearray(whole)
        if what == "content":
            broken[start + 60 : start + 90] = bytes(30)
        elif what == "length":
            broken[start + 1 : start + 9] = (2**40 + 7).to_bytes(8, "little")
        elif what == "opcode":
            broken[start] = 0
        else:
            broken[start:end] = (b"\xff" if what == "nothing left" else b"\0") * (end - start)
        lost = range(ends[k - 1][1] if k else 0, ends[k][1])
        kept = [(stamp, data) for n, (_, _, stamp, data) in enumerate(messages) if n not in lost]
        found = salvaged(bytes(broken), tmp_path / "broken.mcap")
        assert [entry for entry in found if entry in kept] == kept
        assert set(found) <= {(stamp, data) for _, _, stamp, data in messages}


def test_what_was_lost_is_said_in_the_terminal(bag, tmp_path):
    broken = bytearray(bag.read_bytes())
    (end, count), (_, then) = chunk_ends(bytes(broken))[1:3]
    start = end
    while broken[start] != 6:
        start += 9 + int.from_bytes(broken[start + 1 : start + 9], "little")
    broken[start + 9 + 16 : start + 9 + 24] = (2**50).to_bytes(
        8, "little"
    )  # of what size it is after decompression
    bag.write_bytes(broken[:-20])
    answer = CliRunner().invoke(
        app, ["reindex", str(bag.parent), "--out", str(tmp_path / "saved")]
    )
    assert answer.exit_code == 0, answer.output
    said = answer.output
    assert (
        f"from byte {start}, {then - count} messages by its index" in said
        and "most_chunk_bytes" in said
    )
    assert "bag_0.mcap was not closed" in said and "bytes were skipped" in said


def without_summary_and(whole, drop):
    """The file without its end, and without the records of these kinds."""
    kept, at = [whole[:8]], 8
    while at < len(whole) - 8 and whole[at] != 15:
        after = at + 9 + int.from_bytes(whole[at + 1 : at + 9], "little")
        if whole[at] not in drop:
            kept.append(whole[at:after])
        at = after
    return b"".join(kept)


def loose(path):
    """A file without chunks: two topics, of which the schema of one and the channel of the other can be taken away."""
    from mcap.writer import CompressionType, Writer

    stream = BytesIO()
    writer = Writer(stream, use_chunking=False, compression=CompressionType.NONE)
    writer.start(profile="ros2")
    schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
    channel = writer.register_channel("/t", "cdr", schema)
    for k in range(40):
        writer.add_message(channel, log_time=100 - k, data=bytes([k] * 12), publish_time=k)
    writer.finish()
    path.write_bytes(stream.getvalue())
    return stream.getvalue()


def test_messages_outside_of_chunks_are_sorted_and_saved(tmp_path):
    whole = loose(tmp_path / "loose.mcap")
    assert [m.stamp_ns for m in read_messages(tmp_path / "loose.mcap")] == list(range(61, 101))
    (tmp_path / "loose.mcap").write_bytes(whole[: len(whole) // 2])
    made = reindex(tmp_path / "loose.mcap", tmp_path / "saved")
    stamps = [m.stamp_ns for m in read_messages(tmp_path / "saved")]
    assert made.messages > 10 and stamps == list(range(101 - made.messages, 101))


def test_messages_of_a_lost_topic_are_counted(tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    whole = loose(folder / "bag_0.mcap")
    loose(folder / "bag_1.mcap")
    (folder / "bag_0.mcap").write_bytes(without_summary_and(whole, drop={4}))
    made = reindex(folder, tmp_path / "saved")
    assert made.messages == 40 and sum(count for _, count in made.undescribed) == 40
    assert any("lost: 40 messages (channel 1 is not described" in line for line in made.lines())


def test_a_type_that_is_not_installed_is_saved_as_it_was_described(tmp_path):
    from mcap.writer import Writer

    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        schema = writer.register_schema("no_such/msg/Thing", "ros2msg", b"int32 a")
        channel = writer.register_channel(
            "/t", "cdr", schema, {"offered_qos_profiles": "[", "topic_type_hash": "RIHS01_1"}
        )
        writer.add_message(channel, log_time=5, data=bytes(8), publish_time=5)
        writer.finish()
    assert reindex(tmp_path / "a.mcap", tmp_path / "saved").messages == 1
    with (tmp_path / "saved" / "saved_0.mcap").open("rb") as stream:
        ((schema, _, message),) = make_reader(stream).iter_messages()
    assert (schema.name, schema.data, message.data) == ("no_such/msg/Thing", b"int32 a", bytes(8))
