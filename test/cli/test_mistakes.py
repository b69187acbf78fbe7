# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Mistakes of users: each gets one line that says what is wrong and what to do, exit code 2, and nothing is lost."""

import numpy as np
from PIL import Image
import pytest

ROWS = "".join(
    f"{k / 10},a,{-60 + 0.8 * k:.2f},0,8\n{k / 10},b,0,{-70 + 0.8 * k:.2f},8\n" for k in range(150)
)
LOG = f"t,id,x,y,speed\n{ROWS}"
ROAD = ("--road", "four_way", "--count", "2")
GENERATE = ("generate", "my log ü.csv", *ROAD)
DRIVE = ("drive", "made/bag", "--planner", "IdmFollower")


@pytest.fixture(scope="module")
def folder(code_of, tmp_path_factory):
    """A folder with spaces and letters beyond ASCII in its path: a log, a result, and what is neither."""
    place = tmp_path_factory.mktemp("my data ü")
    (place / "my log ü.csv").write_text(LOG)
    (place / "note.txt").write_text("hello\n")
    (place / "columns.csv").write_text(LOG.replace("t,id,x", "tyme,id,x", 1))
    (place / "bad.yaml").write_text("a: [")
    (place / "cut.mcap").write_bytes(b"\x89MCAP0\r\n" + b"\xff" * 100)
    cells = np.full((900, 900), 254, dtype=np.uint8)
    cells[:, ::100] = 0  # strips of road with walls between, none of them long enough
    Image.fromarray(cells).save(place / "walled.pgm")
    (place / "walled.yaml").write_text(
        "{image: walled.pgm, resolution: 0.2, origin: [-90, -90, 0], negate: 0, occupied_thresh: 0.65, free_thresh: 0.196}"
    )
    (place / "nothing").mkdir()
    assert code_of("generate", place / "my log ü.csv", *ROAD, "--out", place / "made") == 0
    assert (place / "made" / "report.html").is_file() and (place / "made" / "bag").is_dir()
    return place


def files(folder):
    return {
        path.relative_to(folder): path.read_bytes() if path.is_file() else b""
        for path in folder.rglob("*")
    }


MISTAKES = [  # words of the command line, and what the message says: what is wrong, and what to do
    (("genrate", "log.csv"), "'generate'"),
    ((*GENERATE, "--raod", "x"), "No such option: --raod (Possible options: --order, --road"),
    (("generate", "my log ü.csv", "--road", "map.yaml"), "map.yaml: cannot be read (No such file"),
    ((*GENERATE, "--encounter", "my lag ü"), "did you mean my log ü?"),
    ((*GENERATE, "--ego", "c"), "no vehicle 'c' in my log ü; there are: a, b"),
    ((*GENERATE, "--set", "sampling.laterl_sigma=1"), "did you mean sampling.lateral_sigma?"),
    ((*DRIVE, "--ego", "zz"), "no vehicle 'zz' to be the ego; it has a, b"),
    (("drive", "bag"), "(MODULE:CLASS of the planner, e.g. mine:MyPlanner, or IdmFollower); see"),
    (("export", "bag", "--to", "pdf"), "'pdf' is none of the exports commonroad, openscenario"),
    ((*GENERATE, "--for-testing"), "name the vehicle that the planner replaces with --ego"),
    (("find", "nothing"), "holds no scenarios; write them with `scenario-gen batch"),
    ((*GENERATE, "--count", "0"), "'--count': "),
    ((*GENERATE, "--start", "a 0 0 0"), "is not of the form `id: x y yaw [speed]`"),
    (("generate", "my log u.csv", *ROAD), "did you mean my log ü.csv?"),
    (("generate", "nothing", *ROAD), "nothing is an empty folder; name a folder with a recording"),
    (("generate", "columns.csv", *ROAD), "--set log.columns=time=…; is it tyme?"),
    ((*GENERATE, "--params", "bad.yaml"), "bad.yaml: not YAML (line 2"),
    (("generate", "cut.mcap", *ROAD), "cut.mcap"),
    ((*GENERATE, "--out", "note.txt/out"), "because"),
]


@pytest.mark.parametrize(
    ("words", "said"), MISTAKES, ids=[" ".join(words) for words, _ in MISTAKES]
)
def test_mistake_is_one_line(folder, run, monkeypatch, words, said):
    monkeypatch.chdir(folder)
    before = files(folder)
    code, printed = run(*words)
    assert code == 2, printed
    (line,) = [line for line in printed.splitlines() if line.strip()]
    assert line.startswith("error: ") and said in line
    assert files(folder) == before


def test_road_without_way_is_refused(folder, run, monkeypatch):
    monkeypatch.chdir(folder)
    code, printed = run("generate", "my log ü.csv", "--road", "walled.yaml", "--out", "refused")
    assert code == 2 and "walled" in printed and "no route leads from" in printed
    assert not (folder / "refused").exists()
