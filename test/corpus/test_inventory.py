# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What lies in an archive: SPMD files, logs, bags, others; and a log without an encounter is a result."""

import os
from pathlib import Path
import socket

import pytest
from support.source_files import ROOT

from scenario_gen.base.errors import RefusedError
from scenario_gen.corpus.encounters import QUALITY
from scenario_gen.corpus.inventory import inventory
from scenario_gen.corpus.mine import mine

SPMD = ",".join(["1"] * 19) + "\n"


def test_each_archive_file_is_one_thing(tmp_path):
    for name, text in {
        "a/one.csv": SPMD,
        "a/deep/two.txt": SPMD,
        "b/log.csv": "id,time,x,y\n",
        "b/readme.md": "",
        ".hidden.csv": SPMD,
        "bag/metadata.yaml": "rosbag2_bagfile_information: {relative_file_paths: [bag_0.mcap]}\n",
        "bag/bag_0.mcap": "",
        "bag/notes.txt": "words",
        "c/loose.mcap": "",
        "c/d/log.csv": "id,time,x,y\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    messages, logs, others, _ = inventory([tmp_path])
    messages = [path for path, _ in messages]
    names = [
        [path.relative_to(tmp_path).as_posix() for path in own]
        for own in (messages, *logs, others)
    ]
    assert names == [
        ["a/deep/two.txt", "a/one.csv"],
        ["b/log.csv"],
        ["c/d/log.csv"],
        ["bag"],
        ["c/loose.mcap"],
        ["b/readme.md"],
    ]


def test_log_without_encounter_is_a_result(tmp_path, monkeypatch):
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / "sub").mkdir()
    (logs / "sub" / "good.csv").write_text((ROOT / "examples" / "my_log.csv").read_text())
    rows = [f"{n},{k / 10:.1f},{500.0 * n + k:.1f},0.0,10.0" for n in (1, 2) for k in range(100)]
    (logs / "apart.csv").write_text("\n".join(["vehicle_id,time,x,y,speed", *rows]) + "\n")
    (logs / "alone.csv").write_text("\n".join(["vehicle_id,time,x,y,speed", *rows[:100]]) + "\n")
    (logs / "labels.csv").write_text("name,label\na,1\n")
    (logs / "notes.txt").write_text("Recorded in May.\nTwo, three, four, five words\n")
    made = mine([logs], tmp_path / "corpus")
    assert made.encounters == 1 and not made.failed
    left_out = [one for one in made.findings if one.kind != QUALITY]
    assert {Path(name).stem for one in left_out for name in one.entries} == {
        *("alone", "apart", "labels", "notes")
    }
    assert "--set log.proximity=510 accepts them" in [
        why.rpartition("; ")[2] for one in left_out for why in one.entries.values()
    ]
    monkeypatch.setattr(
        "scenario_gen.corpus.encounters.read_log", lambda *_: pytest.fail("it is read again")
    )
    assert mine([logs], tmp_path / "corpus").encounters == 1


def test_odd_entry_costs_only_itself(tmp_path):
    logs = tmp_path / "logs"
    (logs / "sub").mkdir(parents=True)
    (logs / "sub" / "good.csv").write_text((ROOT / "examples" / "my_log.csv").read_text())
    (logs / "dangling.csv").symlink_to(tmp_path / "nothing.csv")
    (logs / "loop.csv").symlink_to(logs / "loop.csv")
    (logs / "device.csv").symlink_to("/dev/zero")
    (logs / "folder").symlink_to(tmp_path)
    os.mkfifo(logs / "fifo.csv")
    os.mkfifo(logs / "fifo.db3")
    name = os.fsdecode(b"caf\xe9.csv")
    (logs / name).write_text(SPMD)
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(logs / "socket.csv"))
        made = mine([logs], tmp_path / "corpus")
    assert made.encounters == 1 and not made.failed
    odd = {"dangling.csv", "loop.csv", "device.csv", "folder", "fifo.csv", "fifo.db3"}
    odd |= {"socket.csv", "caf\\udce9.csv"}
    (unread, _) = made.findings
    assert {name.removeprefix(f"{logs}/") for name in unread.entries} == odd
    assert all(name in why for name, why in unread.entries.items())
    assert made.read == (1, 1 + len(odd))
    with pytest.raises(RefusedError, match="without --strict it is left out"):
        mine([logs], tmp_path / "strict", strict=True)
