# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How people really record: what a log does not name is found, or stops with the option that reads it right.

The truth is a meeting: A turns left through a junction in front of B, who comes straight on.
"""

from dataclasses import replace
import re

import numpy as np
import pandas as pd
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.logs.quality import DoubtError, Quantity

START_S = 1_760_000_000.0
FINE_S = np.linspace(0.0, 16.0, 16_001)


def turning(driven):
    """Positions and headings of a left turn with a radius of 15 m, by the distance driven."""
    angle = np.clip((driven - 60.0) / 15.0, 0.0, np.pi / 2.0)
    ahead = np.minimum(driven - 60.0, 0.0)
    beyond = np.maximum(driven - 60.0 - 7.5 * np.pi, 0.0)
    x = 2.0 - 15.0 + 15.0 * np.cos(angle) - beyond
    return x, 15.0 * np.sin(angle) + ahead, np.pi / 2.0 + angle


def truth(seconds):
    """{vehicle: x, y, heading, speed} at seconds (0 to 14) since the start."""
    speeds = {
        "A": lambda t: 8.0 - 3.0 * np.exp(-(((t - 6.5) / 2.0) ** 2)),
        "B": lambda t: 10.0 - 2.5 * np.exp(-(((t - 7.0) / 1.5) ** 2)),
    }
    seconds = np.asarray(seconds, float)
    states = {}
    for name, speed in speeds.items():
        steps = speed(FINE_S[1:]) * np.diff(FINE_S)
        driven = np.interp(seconds, FINE_S, np.concatenate([[0.0], np.cumsum(steps)]))
        if name == "A":
            x, y, heading = turning(driven)
        else:
            x, y = np.full_like(driven, -2.0), 75.0 - driven
            heading = np.full_like(driven, -np.pi / 2.0)
        states[name] = (x, y, heading, speed(seconds))
    return states


def meeting(rate=10.0):
    """Rows of the meeting (t, id, x, y, h, v), ordered by time."""
    seconds = np.arange(round(14.0 * rate) + 1) / rate
    parts = [
        pd.DataFrame({"t": START_S + seconds, "id": name, "x": x, "y": y, "h": h, "v": v})
        for name, (x, y, h, v) in truth(seconds).items()
    ]
    return pd.concat(parts).sort_values(["t", "id"], kind="stable", ignore_index=True)


def degrees(rows):
    """The rows with lat and lon instead of x and y."""
    lat, lon = 48.9 + rows.y / 111_216.0, 9.1 + rows.x / 73_210.0
    return rows.assign(lat=lat, lon=lon).drop(columns=["x", "y"])


def north_degrees(rows):
    """Headings in degrees clockwise from north."""
    return (90.0 - np.degrees(rows.h)) % 360.0


def distance(encounter, names=("A", "B"), start_s=None):
    """Largest distance [m] from the truth, without the offset that all vehicles share."""
    start_s = encounter.start_ns * 1e-9 - START_S if start_s is None else start_s
    right = truth(np.clip(encounter.time + start_s, 0.0, 14.0))
    ids = [vehicle.id for vehicle in encounter.vehicles]
    offsets = []
    for name, vehicle in zip("AB", names, strict=True):
        row = ids.index(vehicle)
        begin, end = encounter.present[row]
        offset = encounter.position[row] - np.column_stack(right[name][:2])
        offsets.append(offset[begin : end + 1])
    joined = np.concatenate(offsets)
    return float(np.hypot(*(joined - np.median(joined, axis=0)).T).max())


ROWS = meeting()
NAMES = {"h": "heading", "v": "speed"}


def with_zero_speeds(rows):
    """Speeds that are 0 for three seconds, where they are unknown."""
    return rows.assign(v=rows.v.where((rows.t < START_S + 5.0) | (rows.t >= START_S + 8.0), 0.0))


def nmea(values):
    whole = np.trunc(values)
    return 100.0 * whole + (values - whole) * 60.0


READ = {  # name: rows as they are written, what a note says
    "a speed of 0": (with_zero_speeds(ROWS).drop(columns="h"), "speed column ignored"),
    "time of the day": (
        ROWS.assign(t=pd.to_datetime(ROWS.t.round(2), unit="s").dt.strftime("%H:%M:%S.%f"))[
            ["t", "id", "x", "y"]
        ],
        "",
    ),
    "date and time": (
        ROWS.assign(
            date="09.10.2025", t=pd.to_datetime(ROWS.t.round(2), unit="s").dt.time.astype(str)
        )[["date", "t", "id", "x", "y"]],
        "",
    ),
    "headings from north": (
        degrees(ROWS).assign(h=north_degrees(ROWS)),
        "log.columns=heading=heading:north_deg",
    ),
    "headings in degrees": (
        ROWS.assign(h=np.degrees(ROWS.h)),
        "log.columns=heading=heading:deg",
    ),
    "frames": (
        meeting(25.0)
        .assign(t=lambda own: ((own.t - START_S) * 25).round())
        .drop(columns="h")
        .rename(columns={"t": "frame"}),
        "log.columns=time=frame:25fps",
    ),
    "feet": (
        ROWS.assign(x=ROWS.x / 0.3048, y=ROWS.y / 0.3048).drop(columns="h"),
        "log.columns=x=x:ft,y=y:ft",
    ),
    "hemispheres": (
        degrees(ROWS)
        .assign(lat=lambda own: nmea(own.lat), ns="N", lon=lambda own: nmea(own.lon), ew="E")
        .drop(columns=["h", "v"]),
        "",
    ),
    "an empty type": (
        ROWS.assign(type=ROWS.id.map({"A": "car", "B": ""})).drop(columns=["h"]),
        "",
    ),
    "rows that are not valid": (
        ROWS.drop(columns="h").assign(
            valid=(ROWS.t < START_S + 3.0) | (ROWS.t >= START_S + 3.8) | (ROWS.id == "B"),
            x=lambda own: own.x + 6.0 * ~own.valid,
        ),
        "8 × marked as not valid",
    ),
    "pixels beside metres": (
        ROWS[["t", "id", "x", "y"]].assign(
            x_m=ROWS.x, y_m=ROWS.y, x=2.0 * ROWS.x + 900.0, y=700.0 - 2.0 * ROWS.y
        ),
        "x from x_m, y from y_m",
    ),
    "rear axles by their name": (
        ROWS.assign(x=ROWS.x - 1.44 * np.cos(ROWS.h), y=ROWS.y - 1.44 * np.sin(ROWS.h)).rename(
            columns={"x": "rear_axle_x", "y": "rear_axle_y"}
        ),
        "positions are those of the point rear_axle",
    ),
    "zeros before the first fix": (
        ROWS.drop(columns=["h", "v"]).assign(
            x=ROWS.x.where(ROWS.t > START_S + 1.0, 0.0),
            y=ROWS.y.where(ROWS.t > START_S + 1.0, 0.0),
        ),
        "position is (0, 0)",
    ),
    "half sizes": (
        ROWS.drop(columns="h").assign(length=2.3, width=0.92),
        "--set log.columns=length=length:2,width=width:2",
    ),
    "two antennas": (
        pd.concat(
            [
                ROWS[["t", "id", "x", "y"]],
                ROWS[ROWS.id == "A"].assign(
                    id="rear",
                    x=lambda own: own.x - np.cos(own.h),
                    y=lambda own: own.y - np.sin(own.h),
                )[["t", "id", "x", "y"]],
            ]
        ),
        "vehicle rear, never farther than 1.",
    ),
}


@pytest.mark.parametrize(("rows", "said"), READ.values(), ids=READ)
def test_table_is_read_as_driven(tmp_path, rows, said):
    rows.rename(columns=NAMES).to_csv(tmp_path / "log.csv", index=False)
    result = read_log(tmp_path / "log.csv")
    (encounter,) = result.encounters
    start = None if encounter.start_ns > 1e18 else 2.0
    errors = [distance(encounter, start_s=start)]
    if start is not None:  # the encounter begins when the vehicles are near
        errors = [distance(encounter, start_s=s) for s in np.arange(0.0, 3.0, 0.1)]
    assert min(errors) < 0.5
    assert said in " ".join(result.quality.notes)
    assert all(not doubt.stops for doubt in result.doubts)


DOUBTED = {  # name: rows as they are written, the option that reads them right
    "minutes, west is positive": (
        degrees(ROWS)
        .assign(
            lat=lambda own: own.lat * 60,
            lon=lambda own: -own.lon * 60,
            heading_north_deg=north_degrees(ROWS),
        )
        .drop(columns="h"),
        "--set log.columns=lat=lat:min,lon=-lon:min",
    ),
    "swapped": (
        degrees(ROWS).rename(columns={"lat": "lon", "lon": "lat"}).drop(columns="h"),
        "--set log.columns=lat=lon,lon=lat",
    ),
    "y points down": (ROWS.assign(y=-ROWS.y), "--set log.columns=y=-y"),
    "y points down, vx and vy do not": (
        ROWS.assign(y=-ROWS.y, vx=ROWS.v * np.cos(ROWS.h), vy=ROWS.v * np.sin(ROWS.h)).drop(
            columns=["h", "v"]
        ),
        "--set log.columns=y=-y",
    ),
    "north first": (
        ROWS.assign(x=ROWS.y, y=ROWS.x, heading_north_deg=north_degrees(ROWS)).drop(columns="h"),
        "--set log.columns=x=y,y=x",
    ),
    "feet and km/h": (
        ROWS.assign(x=ROWS.x / 0.3048, y=ROWS.y / 0.3048, v=ROWS.v * 3.6).drop(columns="h"),
        "--set log.columns=x=x:ft,y=y:ft,speed=speed:kmh",
    ),
    "types that are no road users": (
        ROWS.drop(columns="h").assign(type="unknown"),
        "--set log.columns=kind=none",
    ),
    "frames without speeds": (
        meeting(25.0)
        .assign(t=lambda own: ((own.t - START_S) * 25).round())[["t", "id", "x", "y"]]
        .rename(columns={"t": "frame"}),
        "--set log.columns=time=frame:25fps",
    ),
}


@pytest.mark.parametrize(("rows", "option"), DOUBTED.values(), ids=DOUBTED)
def test_doubt_names_the_option_that_helps(tmp_path, rows, option):
    path = tmp_path / "log.csv"
    rows.rename(columns=NAMES).to_csv(path, index=False)
    with pytest.raises(InputError, match=re.escape(option)):
        read_log(path)
    config = LogConfig(columns=option.partition("log.columns=")[2])
    (encounter,) = read_log(path, config).encounters
    start = None if encounter.start_ns > 1e18 else np.arange(0.0, 3.0, 0.04)
    errors = [distance(encounter, start_s=s) for s in ([None] if start is None else start)]
    assert min(errors) < 0.5


def test_a_doubt_can_be_allowed(tmp_path):
    rows, _ = DOUBTED["y points down"]
    rows.rename(columns=NAMES).to_csv(tmp_path / "log.csv", index=False)
    allowed = read_log(tmp_path / "log.csv", LogConfig(allow="doubt"))
    assert any(doubt.stops for doubt in allowed.doubts)
    assert set(map(str, allowed.doubts)) <= set(allowed.notes)


STOPPED = {  # what no option reads right, and what is said
    "each from its own start": (
        ROWS.assign(
            x=ROWS.x - ROWS.groupby("id").x.transform("first"),
            y=ROWS.y - ROWS.groupby("id").y.transform("first"),
        ),
        "vehicles A, B all begin at 0, 0",
    ),
    "relative to one of them": (
        ROWS.drop(columns="h").assign(
            x=ROWS.x - ROWS.t.map(ROWS[ROWS.id == "A"].set_index("t").x),
            y=ROWS.y - ROWS.t.map(ROWS[ROWS.id == "A"].set_index("t").y),
        ),
        "vehicle A stays at 0, 0 while it drives",
    ),
    "one of two in feet": (
        ROWS.drop(columns="h").assign(
            x=ROWS.x / np.where(ROWS.id == "A", 0.3048, 1.0),
            y=ROWS.y / np.where(ROWS.id == "A", 0.3048, 1.0),
        ),
        "0.30 times for vehicle A, 1.00 times for vehicle B",
    ),
    "pixels": (
        ROWS[["t", "id", "x", "y"]].assign(x=20.0 * ROWS.x, y=20.0 * ROWS.y),
        "180 m/s by x, y: are they pixels",
    ),
    "four decimals of a degree": (
        degrees(ROWS).round(4),
        "four decimals: places are up to 6 m off",
    ),
    "feet, shown by the sizes": (
        ROWS.drop(columns="h").assign(
            x=ROWS.x / 0.3048, y=ROWS.y / 0.3048, v=ROWS.v / 0.3048, length=15.7, width=6.2
        ),
        "x=x:ft,y=y:ft,length=length:ft,width=width:ft,speed=speed:fps",
    ),
    "a scale": (
        ROWS.drop(columns="h").assign(x=1.25 * ROWS.x, y=1.25 * ROWS.y),
        r"x=x:0\.8,y=y:0\.8 or .*speed=speed:1\.25",
    ),
    "UTM with swapped axes": (
        ROWS.assign(x=ROWS.y + 5_328_000.0, y=ROWS.x + 691_000.0),
        "x is a northing of UTM.*x=y,y=x",
    ),
    "clockwise headings in degrees": (
        ROWS.assign(h=-np.degrees(ROWS.h)),
        "y=-y,heading=heading:deg .*heading=-heading:deg",
    ),
    "headings of one vehicle": (
        ROWS.assign(h=ROWS.h.where(ROWS.id == "A", ROWS.h + 2.0)),
        "nearly all of vehicles B; others agree; .*heading=none",
    ),
    "a slow clock of one vehicle": (
        ROWS.assign(t=START_S + (ROWS.t - START_S) * np.where(ROWS.id == "A", 1.0, 1.3)),
        "1.00 times for vehicle A, 1.30 times for vehicle B",
    ),
    "a bridge": (ROWS.assign(z=np.where(ROWS.id == "A", 300.0, 308.5)), "8.5 m apart in height"),
}


@pytest.mark.parametrize(("rows", "said"), STOPPED.values(), ids=STOPPED)
def test_a_contradiction_stops(tmp_path, rows, said):
    rows.rename(columns=NAMES).to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(InputError, match=said):
        read_log(tmp_path / "log.csv")


def test_wrong_speeds_are_a_doubt_only(tmp_path):
    with_zero_speeds(ROWS)[["t", "id", "x", "y", "v"]].to_csv(tmp_path / "log.csv", index=False)
    doubts = read_log(tmp_path / "log.csv").doubts
    assert {doubt.vehicle for doubt in doubts} == {"A", "B"}
    for doubt in doubts:
        assert doubt.quantity is Quantity.SPEED and doubt.unit == "m/s" and not doubt.stops
        assert abs(doubt.start - 5.0) < 0.6 and abs(doubt.end - 8.0) < 0.6


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("factor", "stops"), [(1.19, []), (1.21, [True]), (2.01, [True])])
def test_speeds_contradict_positions_from_a_fifth(tmp_path, factor, stops, sign):
    rows = ROWS.assign(v=ROWS.v * factor**sign).drop(columns="h").rename(columns=NAMES)
    rows.to_csv(tmp_path / "log.csv", index=False)
    config = LogConfig(allow="doubt", columns="speed=speed:mps")
    doubts = read_log(tmp_path / "log.csv", config).doubts
    assert [doubt.stops for doubt in doubts if "times those" in doubt.cause] == stops


@pytest.mark.parametrize(("factor", "is_doubted"), [(7.5, False), (8.0, True)])
def test_no_road_vehicle_exceeds_70_mps(tmp_path, factor, is_doubted):
    """The typical speed is 9 m/s."""
    rows = ROWS[["t", "id", "x", "y"]].assign(x=factor * ROWS.x, y=factor * ROWS.y)
    rows.to_csv(tmp_path / "log.csv", index=False)
    config = LogConfig(allow="doubt", proximity=1000.0)
    doubts = read_log(tmp_path / "log.csv", config).doubts
    assert any("are they pixels" in doubt.cause for doubt in doubts) == is_doubted


EGO_HEADINGS = {
    "relative": lambda rows: rows.h - rows.ego_yaw,
    "on the ground": lambda rows: rows.h,
}


@pytest.mark.parametrize("heading", EGO_HEADINGS.values(), ids=EGO_HEADINGS)
@pytest.mark.parametrize("has_ego", [True, False])
def test_relative_positions_have_ego_poses_applied(tmp_path, heading, has_ego):
    """The ego is a vehicle also if no row is its own."""
    ego = ROWS[ROWS.id == "A"].rename(columns={"x": "ego_x", "y": "ego_y", "h": "ego_yaw"})
    rows = ROWS.merge(ego[["t", "ego_x", "ego_y", "ego_yaw"]], on="t")
    offset = (rows.x - rows.ego_x) + 1j * (rows.y - rows.ego_y)
    offset *= np.exp(-1j * rows.ego_yaw)
    rows = rows.assign(x=np.real(offset), y=np.imag(offset), h=heading(rows))
    path = tmp_path / "log.csv"
    rows[has_ego | (rows.id == "B")].rename(columns=NAMES).to_csv(path, index=False)
    (encounter,) = read_log(path).encounters
    assert distance(encounter, ("A" if has_ego else "ego", "B")) < 0.5
    unknown = rows.drop(columns=["h", "v"]).rename(columns=NAMES)
    unknown.to_csv(path, index=False)
    with pytest.raises(DoubtError, match=r"ego_x=ego_x, or else .*ego_x=none"):
        read_log(path)
    (encounter,) = read_log(path, columns="ego_x=ego_x").encounters
    assert distance(encounter, ("A", "B")) < 0.5


@pytest.mark.parametrize("order", ["by time", "by vehicle", "column"])
def test_each_clock_restart_begins_a_scene(tmp_path, order):
    scenes = []
    for k in range(4):
        scene = ROWS.assign(t=ROWS.t - START_S, x=ROWS.x + 0.3 * k).drop(columns="h")
        if order == "by vehicle":
            scene = scene.sort_values(["id", "t"])
        scenes.append(scene.assign(case_id=k) if order == "column" else scene)
    rows = pd.concat(scenes)
    if order == "column":
        rows = rows.sort_values("t", kind="stable")
    rows.rename(columns=NAMES).to_csv(tmp_path / "log.csv", index=False)
    result = read_log(tmp_path / "log.csv")
    assert len(result.encounters) == 4
    assert not result.quality.dropped
    for encounter in result.encounters:
        assert min(distance(encounter, start_s=s) for s in np.arange(0.0, 3.0, 0.1)) < 0.5


@pytest.mark.parametrize("names", [("car_a.csv", "car_b.csv"), ("car_a/gps.csv", "car_b/gps.csv")])
def test_shared_id_is_named_by_file(tmp_path, names):
    paths = [tmp_path / name for name in names]
    for path, name in zip(paths, "AB", strict=True):
        path.parent.mkdir(exist_ok=True)
        ROWS[ROWS.id == name].assign(id="ego").rename(columns=NAMES).to_csv(path, index=False)
    (encounter,) = read_log(paths).encounters
    assert distance(encounter, ("car_a", "car_b")) < 0.5


def test_sizes_and_types_belong_to_tracks(tmp_path):
    car = ROWS.assign(length=4.4, width=1.8, type="car")
    lorry = car.assign(t=car.t + 90.0)
    lorry.loc[lorry.id == "A", ["length", "width", "type"]] = [16.5, 2.5, "truck"]
    pd.concat([car, lorry]).rename(columns=NAMES).to_csv(tmp_path / "log.csv", index=False)
    first, second = read_log(tmp_path / "log.csv").encounters
    assert (first.vehicles[0].length, second.vehicles[0].length) == (4.4, 16.5)
    assert first.vehicles[0].kind != second.vehicles[0].kind


def test_stamps_of_whole_seconds_stop(tmp_path):
    rows = ROWS.assign(t=np.floor(ROWS.t))
    rows.rename(columns=NAMES).to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(DoubtError, match="the clock is too coarse"):
        read_log(tmp_path / "log.csv")


def test_shared_stamps_name_the_scene_column(tmp_path):
    moved = pd.concat([ROWS.assign(lap=k, x=ROWS.x + 40.0 * k) for k in (1, 2)])
    path = tmp_path / "log.csv"
    moved.sort_values("t", kind="stable").rename(columns=NAMES).to_csv(path, index=False)
    with pytest.raises(InputError, match=r"--set log\.columns=scene=lap"):
        read_log(path)
    config = replace(LogConfig(), columns="scene=lap")
    assert len(read_log(path, config).encounters) == 2


def euroc(rows):
    stamps = (rows.t * 1e9).round().astype("int64")
    lines = [f"{t},{x:.4f},{y:.4f},0" for t, x, y in zip(stamps, rows.x, rows.y, strict=True)]
    header = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m]\n"
    return header + "\n".join(lines)


def test_trajectories_of_one_vehicle_a_file(tmp_path):
    for name in "AB":
        (tmp_path / f"{name}.csv").write_text(euroc(ROWS[ROWS.id == name]))
    (encounter,) = read_log(tmp_path).encounters
    assert distance(encounter) < 0.5


def test_unexpected_exception_is_called_a_bug(tmp_path, monkeypatch):
    path = tmp_path / "log.csv"
    ROWS.rename(columns=NAMES).to_csv(path, index=False)
    monkeypatch.setattr("scenario_gen.logs.read.clean", lambda *_: 1 / 0)
    with pytest.raises(InputError, match=r"this is a bug in scenario_gen.*attach .*log\.csv"):
        read_log(path)


def test_result_is_a_sequence_of_encounters(tmp_path):
    ROWS.rename(columns=NAMES).to_csv(tmp_path / "log.csv", index=False)
    result = read_log(tmp_path / "log.csv")
    (encounter,) = result
    assert len(result) == 1 and result[0] is result[:1][0] is encounter
    assert repr(result) == "LogResult(1 encounters, 2 vehicles, 0 doubts)"
    table = result.to_dataframe()
    assert set(table.encounter) == {"log"} and len(table) == len(encounter.to_dataframe())
    assert result.plot().get_title() == repr(result)
