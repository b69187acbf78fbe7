# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags by other libraries; a bag of several small chunks to cut and damage, and what the mcap library says of its chunks."""

from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk, StreamReader
from mcap.writer import Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from scenario_gen.bags.storage.definitions import type_store
from scenario_gen.bags.storage.writer import BagWriter


def rosbags_bag(
    folder: Path,
    messages: Iterable[tuple[str, str, int, bytes]],
    storage: StoragePlugin = StoragePlugin.MCAP,
    mode: CompressionMode = CompressionMode.NONE,
) -> Path:
    """Write messages (topic, type, stamp [ns], CDR bytes) by the rosbags library; return the folder."""
    writer = RosbagsWriter(folder, version=9, storage_plugin=storage)
    if mode is not CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    connections = {}
    with writer:
        for topic, kind, stamp_ns, data in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=type_store())
            writer.write(connections[topic], stamp_ns, data)
    return folder


def small_bag(folder: Path, *, compress: bool) -> Path:
    """Write a bag of two topics in seven chunks; return its file."""
    with BagWriter(folder, compress=compress, chunk_bytes=400) as bag:
        bag.add_topic("/a", "std_msgs/msg/String")
        bag.add_topic("/b", "std_msgs/msg/Header")
        for k in range(60):
            bag.write(
                "/a" if k % 3 else "/b",
                b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00" + bytes([k]),
                1000 + k,
            )
    return folder / f"{folder.name}_0.mcap"


def chunk_ends(whole: bytes) -> list[tuple[int, int]]:
    """Return where each chunk ends, and how many messages the file has up to there; by the mcap library."""
    stream = BytesIO(whole)
    found, count = [], 0
    for record in StreamReader(stream, emit_chunks=True).records:
        if isinstance(record, Chunk):
            count += sum(isinstance(inner, Message) for inner in breakup_chunk(record))
            found.append((stream.tell(), count))
    return found


def mcap_bytes(
    messages: Iterable[tuple[int, bytes]],
    *,
    encoding: str = "cdr",
    profile: str = "ros2",
    **options,
) -> bytes:
    """Return an MCAP file by the mcap library, of messages (stamp [ns], data) on /t; `options` are those of its writer."""
    out = BytesIO()
    writer = Writer(out, **options)
    writer.start(profile)
    schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
    channel = writer.register_channel("/t", encoding, schema)
    for stamp_ns, data in messages:
        writer.add_message(channel, stamp_ns, data, stamp_ns)
    writer.finish()
    return out.getvalue()
