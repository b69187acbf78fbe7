# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A bag that is cut off at every byte: reindex saves every whole chunk before the cut, and what it writes opens everywhere."""

from collections.abc import Iterator
from pathlib import Path
import shutil

from cut_bags import chunk_ends, small_bag
from figures import Figure
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.bags.storage.reindex import reindex
from scenario_gen.base.errors import InputError


def run(state: Path) -> Iterator[Figure]:
    """Cut a compressed and a plain bag at every byte; goes on after the last cut that was tried."""
    for compress in (True, False):
        name = "compressed" if compress else "plain"
        folder = state / name
        bag = next(folder.glob("*.mcap")) if folder.exists() else small_bag(folder, compress=compress)
        whole = bag.read_bytes()
        done = state / f"{name}.done"
        first, wrong = map(int, done.read_text().split()) if done.exists() else (0, 0)
        for cut in range(first, len(whole) + 1):
            wrong += not is_right(whole, cut, folder, state / "cut")
            done.write_text(f"{cut + 1} {wrong}")
        promise = f"reindex saves every whole chunk of a bag cut off anywhere ({name})"
        yield Figure(promise, f"all of {len(whole) + 1} cuts", f"{len(whole) + 1 - wrong} right", not wrong)


def is_right(whole: bytes, cut: int, bag: Path, folder: Path) -> bool:
    """Whether the messages of the whole chunks before the cut are saved, no others, for three readers."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    (folder / "cut.mcap").write_bytes(whole[:cut])
    expected = max((count for end, count in chunk_ends(whole) if end <= cut), default=0)
    saved = folder / "saved"
    try:
        if reindex(folder / "cut.mcap", saved).messages != expected:
            return False
    except InputError:
        return expected == 0
    messages = [(m.topic, m.stamp_ns, m.data) for m in read_messages(bag)][:expected]
    with Reader(saved) as reader:
        by_rosbags = [(c.topic, stamp, bytes(data)) for c, stamp, data in reader.messages()]
    with (saved / "saved_0.mcap").open("rb") as stream:
        by_mcap = [(channel.topic, m.log_time, m.data) for _, channel, m in make_reader(stream).iter_messages()]
    return messages == by_rosbags == by_mcap == [(m.topic, m.stamp_ns, m.data) for m in read_messages(saved)]
