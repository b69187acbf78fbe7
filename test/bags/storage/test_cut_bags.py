# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags that were cut off, damaged or never closed: what is whole before that is read, and the rest is named."""

import random

from mcap.writer import CompressionType
import pytest
from support.cut_bags import chunk_ends, mcap_bytes, small_bag
from support.lengths import LONG

from scenario_gen.bags.storage.bag import bag_warnings, read_messages
from scenario_gen.base.errors import InputError

MAGIC = b"\x89MCAP0\r\n"


@pytest.fixture(params=["compressed", "plain"])
def bag(request, tmp_path):
    return small_bag(tmp_path / "bag", compress=request.param == "compressed")


def told(path):
    return [(m.topic, m.type, m.stamp_ns, m.data) for m in read_messages(path)]


def test_every_cut_leaves_whole_chunks(bag, tmp_path):
    """Every cut; in the short form those near the ends of the last two chunks, and others."""
    whole, messages = bag.read_bytes(), told(bag)
    ends = chunk_ends(whole)
    rng = random.Random(3)
    near = [
        cut
        for cut in range(ends[-3][0], ends[-1][0] + 1)
        if any(-100 <= cut - end <= 20 for end, _ in ends)
    ]
    others = (0, 1, 8, len(whole) - 1, *(rng.randrange(len(whole)) for _ in range(60)))
    cut_off = tmp_path / "cut.mcap"
    for cut in range(len(whole)) if LONG else (*near, *others):
        cut_off.write_bytes(whole[:cut])
        expected = max((count for end, count in ends if end <= cut), default=0)
        if not expected:
            with pytest.raises(InputError, match=r"cut\.mcap"):
                told(cut_off)
            continue
        assert told(cut_off) == messages[:expected], cut
        lines = bag_warnings(cut_off)
        if cut >= len(whole) - len(MAGIC):
            assert not lines
        else:
            assert f"of {cut} is missing" in lines[0] and "`mcap recover cut.mcap`" in lines[0]


def test_damaged_chunk_is_named_after_others(bag):
    whole, messages = bag.read_bytes(), told(bag)
    ends = chunk_ends(whole)
    for (end, _), (_, before) in zip(ends[1:], ends, strict=False):
        broken = bytearray(whole)
        broken[end - 30 : end - 10] = bytes(20)
        bag.write_bytes(broken)
        read = []
        with pytest.raises(InputError, match=r"bag_0\.mcap: damaged: .*mcap recover"):
            read.extend(message.data for message in read_messages(bag))
        assert read == [data for *_, data in messages[:before]]


def test_loose_messages_are_sorted(tmp_path):
    """In a file without chunks."""
    messages = ((100 - k, bytes([k] * 12)) for k in range(40))
    whole = mcap_bytes(messages, use_chunking=False, compression=CompressionType.NONE)
    (tmp_path / "loose.mcap").write_bytes(whole)
    assert [m.stamp_ns for m in read_messages(tmp_path / "loose.mcap")] == list(range(61, 101))
    assert not bag_warnings(tmp_path / "loose.mcap")
    (tmp_path / "loose.mcap").write_bytes(whole[: len(whole) // 2])
    stamps = [m.stamp_ns for m in read_messages(tmp_path / "loose.mcap")]
    assert 10 < len(stamps) < 40 and stamps == list(range(101 - len(stamps), 101))
