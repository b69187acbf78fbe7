# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tables: columns by name, units by suffix, options, and errors that name the place."""

import shutil

import numpy as np
import pandas as pd
import pytest
from support.log_builders import crossing, geographic, save

from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.logs.synthetic import bundled


def test_a_plain_table(tmp_path):
    (encounter,) = read_log(save(crossing(), tmp_path)).encounters
    assert encounter.name == "log"
    assert [vehicle.id for vehicle in encounter.vehicles] == ["a", "b"]
    assert encounter.start_ns == 1000 * 10**9
    np.testing.assert_allclose(
        encounter.position[0, :, 0], -40.0 + 8.0 * encounter.time, atol=0.05
    )
    np.testing.assert_allclose(encounter.heading[0], 0.0, atol=0.01)
    np.testing.assert_allclose(encounter.heading[1], np.pi / 2.0, atol=0.01)
    assert (encounter.speed[1, -50:] == 0.0).all()


def same(a, b, atol=0.02):
    """Two encounters agree up to a shift of the frame."""
    for x, y in (
        (a.position - a.position[0, 0], b.position - b.position[0, 0]),
        (a.speed, b.speed),
    ):
        np.testing.assert_allclose(x, y, atol=atol)


RENAMES = {
    "kmh and ms": lambda rows: rows.assign(
        speed_kmh=rows.pop("speed_mps") * 3.6, time_ms=(rows.pop("t_s") * 1000).round()
    ),
    "nanoseconds": lambda rows: rows.assign(
        time_ns=(rows.pop("t_s") * 1e9).round().astype(np.int64)
    ),
    "feet": lambda rows: rows.assign(
        x_ft=rows.pop("x_m") / 0.3048,
        y_ft=rows.pop("y_m") / 0.3048,
        v_mph=rows.pop("speed_mps") / 0.44704,
    ),
    "utc wins over t": lambda rows: rows.assign(utc_s=rows["t_s"], t_s=0.0),
    "dates": lambda rows: rows.assign(
        timestamp=pd.to_datetime(rows.pop("t_s"), unit="s", utc=True).astype(str)
    ),
    "tracks": lambda rows: rows.rename(
        columns={"vehicle_id": "Track_ID", "x_m": "E_m", "y_m": "N_m", "speed_mps": "Speed"}
    ),
}


@pytest.mark.parametrize("change", RENAMES.values(), ids=RENAMES)
def test_units_and_names(tmp_path, change):
    (plain,) = read_log(save(crossing(), tmp_path)).encounters
    (other,) = read_log(save(change(crossing()), tmp_path, "other.csv")).encounters
    assert other.start_ns == plain.start_ns
    same(plain, other)


def test_latitude_and_longitude_become_local(tmp_path):
    (plain,) = read_log(save(crossing(), tmp_path)).encounters
    (other,) = read_log(save(geographic(crossing()), tmp_path)).encounters
    assert other.origin == pytest.approx((48.0, 11.0), abs=0.001)
    same(plain, other, atol=0.25)  # the builder's degrees are those of a sphere: 0.2 % off
    fixed = read_log(tmp_path / "log.csv", LogConfig(origin="48.0,11.0")).encounters[0]
    assert fixed.origin == (48.0, 11.0)
    assert fixed.position[0, 0] == pytest.approx([-40.0, 0.0], abs=0.2)


def test_headings(tmp_path):
    """Recorded headings decide where the path has no direction: a car that never moves."""
    rows = crossing()
    rows.loc[rows["vehicle_id"] == "b", ["x_m", "y_m", "speed_mps"]] = (10.0, -12.0, 0.0)
    unknown = read_log(save(rows, tmp_path))
    assert (unknown.encounters[0].heading[1] == 0.0).all()
    assert any("b never moves" in line for line in unknown.quality.lines())
    for column, value in (
        ("heading_rad", 0.5),
        ("heading_deg", np.degrees(0.5)),
        ("heading_north_deg", 90.0 - np.degrees(0.5)),
    ):
        known = read_log(save(rows.assign(**{column: value}), tmp_path)).encounters[0]
        np.testing.assert_allclose(known.heading[1], 0.5, atol=1e-6)


def test_sizes(tmp_path):
    rows = crossing().assign(length_m=5.5, width_m=np.nan)
    vehicle = read_log(save(rows, tmp_path), LogConfig(width=2.2)).encounters[0].vehicles[0]
    assert (vehicle.length, vehicle.width) == (5.5, 2.2)


def test_columns_by_option(tmp_path):
    (plain,) = read_log(save(crossing(), tmp_path)).encounters
    rows = crossing().rename(
        columns={
            "t_s": "when",
            "vehicle_id": "who",
            "x_m": "ost",
            "y_m": "nord",
            "speed_mps": "schnell",
        }
    )
    rows["schnell"] *= 3.6
    path = save(rows, tmp_path, "odd.csv")
    (other,) = read_log(
        path, LogConfig(columns="time=when, vehicle=who,x=ost,y=nord,speed=schnell:kmh")
    ).encounters
    same(plain, other, atol=1e-6)
    (derived,) = read_log(
        path, LogConfig(columns="time=when,vehicle=who,x=ost,y=nord,speed=none")
    ).encounters
    same(plain, derived, atol=0.6)
    for columns, words in (
        ("time=when", "no column for position"),
        ("time=now", "no column 'now'"),
        ("colour=red", "'colour' is none of"),
        ("speed=schnell:knots", "no unit 'knots'"),
    ):
        with pytest.raises(InputError, match=words):
            read_log(path, LogConfig(columns=columns))


def test_paths_that_are_no_logs(tmp_path):
    (tmp_path / "notes.md").write_text("hello")
    (tmp_path / "folder").mkdir()
    (tmp_path / "empty.csv").touch()
    for path, words in (
        ("nothing.csv", "does not exist"),
        ("notes.md", "not in a known log format"),
        ("folder", "empty folder"),
        ("empty.csv", "is empty"),
    ):
        with pytest.raises(InputError, match=words):
            read_log(tmp_path / path)


def test_frames_cannot_be_mixed(tmp_path):
    paths = [save(crossing(), tmp_path, "a.csv"), save(geographic(crossing()), tmp_path, "b.csv")]
    with pytest.raises(InputError, match="mix latitude"):
        read_log(paths)


@pytest.mark.parametrize("lon", [174.8, -179.5, 11.6])
@pytest.mark.parametrize("lat", [-41.3, 88.0, 0.2])
def test_degrees_named_as_metres_are_refused(tmp_path, lon, lat):
    """From New Zealand to the pole: as metres nobody would move."""
    rows = [
        f"{k / 10},{who},{lon + 1e-5 * k},{lat + shift},10"
        for who, shift in (("a", 0.0), ("b", 1e-4))
        for k in range(100)
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t,id,x,y,speed", *rows]) + "\n")
    with pytest.raises(InputError, match="lon=x,lat=y"):
        read_log(path)


def test_current_folder_names_its_log(tmp_path, monkeypatch):
    (tmp_path / "drives").mkdir()
    monkeypatch.chdir(tmp_path / "drives")
    for vehicle in "ab":
        shutil.copy(bundled("follower"), f"{vehicle}.csv")
    assert read_log(["a.csv", "b.csv"]).quality.name == "drives"
