# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The command line as a person meets it: results that are whole, and errors that say what to do."""

import json

import numpy as np
import pandas as pd
from PIL import Image
import pytest
import yaml

from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.logs.synthetic import bundled

LOG = bundled("c")
QUICK = ("--road", "straight", "--count", "2", "--set", "evaluation.resamples=20")


def table(path, change=lambda rows: rows):
    """Write a plain table of two cars that follow each other, after `change`."""
    t = np.round(np.arange(0.0, 12.0, 0.1), 1)
    rows = pd.concat(
        pd.DataFrame({"t_s": t, "vehicle_id": who, "x_m": start + 8.0 * t, "y_m": 0.0, "speed_mps": 8.0})
        for who, start in (("lead", 20.0), ("tail", 0.0))
    ).reset_index(drop=True)
    change(rows).to_csv(path, index=False)
    return path


def test_generate_leaves_bag_report_and_figures_and_is_reproducible(ran, made, tmp_path):
    code, said, err = ran("generate", LOG, *QUICK, "--seed", 7, "--out", "out", "--json")
    answer = json.loads(said, parse_constant=pytest.fail)
    assert (
        code == 0
        and all((tmp_path / answer[name]).exists() for name in ("report", "bag", "figures"))
        and "2 of 2 scenarios" in err
    )
    assert answer["cases"][0]["scenarios"] == 2 and answer["cases"][0]["vehicles"]
    one, two = ([(m.topic, m.data) for m in read_messages(folder / "bag")] for folder in (made, tmp_path / "out"))
    assert one == two and {topic for topic, _ in one} >= {"/map", "/tracks", "/changepoints", "/scenarios"}
    figures = json.loads((tmp_path / "out" / "evaluation.json").read_text())
    assert figures["provenance"]["seed"] == "7"
    assert (tmp_path / "out" / "report.html").read_text().startswith("<!doctype html>")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def truncated_bag(folder):
    source = next(bundled("a").glob("*.mcap"))
    path = folder / "cut.mcap"
    path.write_bytes(source.read_bytes()[:4000])
    return path


def all_nan(folder):
    return table(folder / "nan.csv", lambda rows: rows.assign(x_m=np.nan))


def all_zero(folder):
    return table(folder / "zero.csv", lambda rows: rows.rename(columns={"x_m": "lat_deg", "y_m": "lon_deg"}).assign(lat_deg=0.0))


def out_of_order(folder):
    return table(folder / "order.csv", lambda rows: rows.iloc[[*range(10), 11, 10, *range(12, len(rows))]])


def duplicates(folder):
    return table(folder / "twice.csv", lambda rows: pd.concat([rows, rows.iloc[5:6]]))


STRICT = ("--set", "log.strict=true")


@pytest.mark.parametrize(
    ("make", "options", "said"),
    [
        (truncated_bag, (), "cut.mcap"),
        (all_nan, (), "nan.csv"),
        (all_zero, (), "zero.csv"),
        (out_of_order, STRICT, "order.csv, line 13"),
        (duplicates, STRICT, "twice.csv, line 242"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_bad_log_is_named_and_nothing_is_written(run, tmp_path, make, options, said):
    log = make(tmp_path)
    code, printed = run("generate", log, "--road", "straight", "--out", "out", *options)
    assert code == 2
    assert said in printed and "error:" in printed and "Traceback" not in printed
    assert [p.name for p in tmp_path.iterdir()] == [log.name]


def test_what_can_be_repaired_is_repaired_and_counted(run, tmp_path):
    log = out_of_order(tmp_path)
    code, printed = run("generate", log, *QUICK, "--out", "out")
    assert code == 0, printed
    assert "×" in (tmp_path / "out" / "report.html").read_text()


def test_an_unknown_topic_type_is_named(run, tmp_path, data):
    code, printed = run("generate", data / "bags" / "mcap" / "talker", "--road", "straight", "--out", "out")
    assert code == 2
    assert "talker" in printed and "std_msgs/msg/String" in printed


def test_a_road_with_no_way_through_is_refused(run, tmp_path):
    """Strips of road with walls between: the cars' own path crosses them, and no strip is long enough."""
    cells = np.full((60, 900), 254, dtype=np.uint8)
    cells[:, ::100] = 0
    Image.fromarray(cells).save(tmp_path / "walled.pgm")
    facts = {"image": "walled.pgm", "resolution": 0.2, "origin": [-10.0, -6.0, 0.0], "negate": 0}
    facts |= {"occupied_thresh": 0.65, "free_thresh": 0.196, "mode": "trinary"}
    (tmp_path / "walled.yaml").write_text(yaml.safe_dump(facts))
    code, printed = run("generate", table(tmp_path / "log.csv"), "--road", tmp_path / "walled.yaml", "--out", "out")
    assert code == 2
    assert "walled" in printed and "no way leads from" in printed
    assert not (tmp_path / "out").exists()
