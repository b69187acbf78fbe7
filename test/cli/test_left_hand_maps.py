# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Commands on a map whose traffic drives on the other side than that of the recording."""

import pytest
from support import map_builders


@pytest.fixture
def left_hand_map(tmp_path, monkeypatch):
    image = {
        name: ([(x, -y) for x, y in right], [(x, -y) for x, y in left], after)
        for name, (left, right, after) in map_builders.lanes().items()
    }
    monkeypatch.setattr(map_builders, "lanes", lambda: image)
    path = tmp_path / "left.osm"
    path.write_text(map_builders.lanelet2())
    return path


@pytest.fixture
def oncoming_log(tmp_path):
    """Two vehicles that pass each other on the right."""
    rows = ["time,vehicle,x,y,speed"]
    for k in range(81):
        along = k - 40.0
        rows.append(f"{k / 10:.1f},1,{along:.2f},-1.75,10.0")
        rows.append(f"{k / 10:.1f},2,{-along:.2f},1.75,10.0")
    path = tmp_path / "log.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def test_generate_mirrors_the_recording_and_says_so(run, left_hand_map, oncoming_log, tmp_path):
    code, text = run(
        *("generate", oncoming_log, "--road", left_hand_map, "--count", 2),
        *("--set", "evaluation.resamples=20", "--out", tmp_path / "made"),
    )
    assert code == 0, text
    assert "mirrored" in text and (tmp_path / "made" / "evaluation.json").is_file()


def test_batch_generates_from_mirrored_recordings(run, left_hand_map, oncoming_log, tmp_path):
    code, text = run("mine", oncoming_log, "--out", tmp_path / "corpus", "--workers", 1)
    assert code == 0, text
    code, text = run(
        *("batch", tmp_path / "corpus", "--roads", left_hand_map, "--count", 2),
        *("--workers", 1, "--out", tmp_path / "sets"),
    )
    assert code == 0, text
