# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Common slips in tables: what can be read is read, and said; for the rest the message says what to do."""

from log_builders import crossing
import numpy as np
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.logs import read_log

FOOT = 0.3048


def written(rows, tmp_path, **options):
    path = tmp_path / "log.csv"
    rows.to_csv(path, index=False, **options)
    return path


def plain(rows):
    return rows.rename(columns={"t_s": "t", "vehicle_id": "id", "x_m": "x", "y_m": "y", "speed_mps": "speed"})


def with_headings(rows):
    return plain(rows).assign(heading=np.where(rows["vehicle_id"] == "a", 0.0, np.pi / 2.0))


def ngsim(rows):
    names = {"t_s": "Global_Time", "vehicle_id": "Vehicle_ID", "x_m": "Local_X", "y_m": "Local_Y", "speed_mps": "v_Vel"}
    rows = rows.assign(t_s=(rows.t_s * 1000).round().astype(np.int64), vehicle_id=rows.vehicle_id.map({"a": 1, "b": 2}))
    rows = rows.assign(**{name: rows[name] / FOOT for name in ("x_m", "y_m", "speed_mps")}).rename(columns=names)
    return rows.assign(Global_X=6e6, Global_Y=1.8e6, v_Length=4.5 / FOOT, v_Width=1.8 / FOOT, v_Acc=0.0, Lane_ID=2)


READ = {
    "a decimal comma": (plain, {"sep": ";", "decimal": ","}, "its numbers have a decimal comma"),
    "UTF-16": (plain, {"encoding": "utf-16"}, "the file is UTF-16"),
    "bars": (plain, {"sep": "|"}, ""),
    "spaces": (plain, {"sep": " "}, ""),
    "units in brackets": (
        lambda rows: plain(rows).rename(columns={"t": "Time [s]", "x": "x (m)", "y": "y (m)", "speed": "Speed [m/s]"}),
        {},
        "",
    ),
    "no speed": (lambda rows: plain(rows).drop(columns="speed"), {}, "speeds are derived from the positions"),
    "NGSIM": (ngsim, {}, "feet are converted to metres"),
    "headings in degrees": (
        lambda rows: with_headings(rows).assign(heading=lambda own: np.degrees(own.heading)),
        {},
        "if they were in degrees (name the column heading_deg)",
    ),
    "headings clockwise from north": (
        lambda rows: with_headings(rows).assign(heading=lambda own: np.pi / 2.0 - own.heading),
        {},
        "clockwise from north",
    ),
    "headings that are zero": (
        lambda rows: with_headings(rows).assign(heading=0.0),
        {},
        "headings that contradict it are not used",
    ),
}


@pytest.mark.parametrize(("change", "options", "said"), READ.values(), ids=READ)
def test_what_can_be_read_is_read_and_said(tmp_path, change, options, said):
    (right,) = read_log(written(plain(crossing()), tmp_path)).encounters
    result = read_log(written(change(crossing()), tmp_path, **options))
    (encounter,) = result.encounters
    np.testing.assert_allclose(encounter.position, right.position, atol=0.1)
    np.testing.assert_allclose(encounter.speed, right.speed, atol=0.3)
    assert any(said in note for note in result.quality.notes) if said else not result.quality.notes
    if change is ngsim:
        assert encounter.vehicles[0].length == pytest.approx(4.5) and "front" in " ".join(result.quality.notes)


def test_swapped_axes_are_noticed_by_the_headings(tmp_path):
    result = read_log(written(with_headings(crossing()).rename(columns={"x": "y", "y": "x"}), tmp_path))
    assert any("if x and y are swapped (log.columns=x=…,y=…)" in note for note in result.quality.notes)


def test_speeds_in_another_unit_are_noticed(tmp_path):
    result = read_log(written(plain(crossing()).assign(speed=lambda own: own.speed * 3.6), tmp_path))
    assert any("positions in 2 of 2 vehicles; they look like km/h (name" in note for note in result.quality.notes)


def test_headings_that_fit_are_not_spoken_of(tmp_path):
    assert not read_log(written(with_headings(crossing()), tmp_path)).quality.notes


REFUSED = {
    "no header": (plain, {"header": False}, "line 1 has numbers instead of column names; put a line such as t,id,x,y,speed"),
    "another name for the vehicle": (
        lambda rows: plain(rows).rename(columns={"id": "who"}),
        {},
        "it could be who: --set log.columns=vehicle=who",
    ),
    "no vehicle": (lambda rows: plain(rows).drop(columns="id"), {}, "no column names the vehicle; add a column `id`"),
    "one vehicle": (lambda rows: plain(rows[rows.vehicle_id == "a"]).drop(columns="id"), {}, "Give the files of all vehicles"),
    "decimal commas between commas": (
        lambda rows: plain(rows).assign(t=[f"{t:.1f}".replace(".", ",") for t in rows.t_s]),
        {"quoting": 3, "escapechar": " "},
        "write 0.5, not 0,5",
    ),
    "a slip in a name": (
        lambda rows: plain(rows).rename(columns={"t": "timstamp"}),
        {},
        "--set log.columns=time=…; is it timstamp?",
    ),
    "latitude and longitude swapped": (
        lambda rows: plain(rows).assign(lon=48.0 + rows.x_m * 1e-5, lat=111.0 + rows.y_m * 1e-5).drop(columns=["x", "y"]),
        {},
        "lat and lon may be swapped",
    ),
}


@pytest.mark.parametrize(("change", "options", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_read_says_what_to_do(tmp_path, change, options, said):
    with pytest.raises(InputError) as error:
        read_log(written(change(crossing()), tmp_path, **options))
    assert said in str(error.value) and "log.csv" in str(error.value)


def test_files_without_a_vehicle_column_are_one_vehicle_each(tmp_path):
    rows = plain(crossing())
    for name in ("a", "b"):
        rows[rows.id == name].drop(columns="id").to_csv(tmp_path / f"car_{name}.csv", index=False)
    result = read_log([tmp_path / "car_a.csv", tmp_path / "car_b.csv"])
    assert [vehicle.id for vehicle in result.encounters[0].vehicles] == ["car_a", "car_b"]
    assert "each file is read as one vehicle" in " ".join(result.quality.notes)
