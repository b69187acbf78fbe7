# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags of all kinds as raw messages: compressed by file or message, SQLite that is no table, damage of every kind an error."""

import contextlib
import sqlite3

import pytest
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from support.bag_examples import bag_topics
from support.cut_bags import mcap_bytes, rosbags_bag

from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError

MESSAGES = [
    ("/t", "std_msgs/msg/String", 1000 + k, b"\x00\x01\x00\x00" + bytes([k] * 10))
    for k in range(20)
]


@pytest.mark.parametrize("plugin", list(StoragePlugin))
@pytest.mark.parametrize(
    "mode", [CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE]
)
def test_bags_of_rosbags_are_read(tmp_path, plugin, mode):
    rosbags_bag(tmp_path / "bag", MESSAGES, plugin, mode)
    assert [(m.stamp_ns, m.data[-1]) for m in read_messages(tmp_path / "bag")] == [
        (1000 + k, k) for k in range(20)
    ]
    assert bag_topics(tmp_path / "bag")[0].count == 20
    if mode is not CompressionMode.NONE:
        with pytest.raises(InputError, match=r"bag\.most_"):
            list(
                read_messages(
                    tmp_path / "bag", config=BagConfig(most_bytes=10, most_chunk_bytes=10)
                )
            )
        for file in tmp_path.glob("bag/bag.*"):
            file.write_bytes(
                file.read_bytes().replace(b"\x28\xb5\x2f\xfd", b"none")
            )  # what each compressed piece begins with
        with pytest.raises(InputError, match="bag"):
            list(read_messages(tmp_path / "bag"))


@pytest.mark.parametrize(
    "statement",
    [
        "alter table messages rename to old; create view messages as select * from old",
        "alter table messages rename to old; create view messages as "
        "with recursive r(n) as (select 1 union all select n + 1 from r) select n id, 1 topic_id, n timestamp, x'00' data from r",
        "alter table messages drop column data; alter table messages add column data blob as (zeroblob(1000000000))",
    ],
)
def test_a_changed_database_is_an_error(tmp_path, statement):
    rosbags_bag(tmp_path / "bag", MESSAGES, StoragePlugin.SQLITE3)
    (file,) = (tmp_path / "bag").glob("*.db3")
    with contextlib.closing(sqlite3.connect(file)) as base:
        base.executescript(
            "pragma writable_schema = on; drop index if exists timestamp_idx;" + statement
        )
        base.commit()
    with pytest.raises(InputError, match=r"\.db3"):
        list(read_messages(tmp_path / "bag"))


@pytest.mark.parametrize(
    ("encoding", "profile", "said"),
    [("json", "ros2", "/t is encoded as 'json'"), ("ros1", "ros1", "/t is encoded as 'ros1'")],
)
def test_other_encodings_are_refused_by_name(tmp_path, encoding, profile, said):
    data = mcap_bytes([(1, b"{}")], encoding=encoding, profile=profile)
    (tmp_path / "a.mcap").write_bytes(data)
    with pytest.raises(InputError, match=said):
        list(read_messages(tmp_path / "a.mcap"))
