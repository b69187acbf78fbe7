# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Slips in tables, common ones and those that were reported: what can be read is read, and said; the rest says what to do."""

import re
import zipfile

import numpy as np
import pandas as pd
import pytest
from support.log_builders import crossing, geographic, save

from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, read_log

FOOT = 0.3048
LONG = 9007199254740992


def held(rows):
    """A fix each second, repeated in the rows between."""
    fix = rows.groupby("vehicle_id").cumcount() % 10 == 0
    position = rows[["x_m", "y_m"]].where(fix).groupby(rows["vehicle_id"]).ffill()
    return rows.assign(x_m=position["x_m"], y_m=position["y_m"])


def with_kind(rows):
    dog = rows[rows.vehicle_id == "a"].assign(vehicle_id="w", y_m=5.0)
    names = {"a": "Car", "b": "vehicle.car", "w": "animal.dog.0007"}
    return pd.concat([rows, dog]).assign(type=lambda own: own.vehicle_id.map(names))


def numbered(rows):
    own = with_kind(rows)
    return own.assign(type=own.vehicle_id.map({"a": 1, "b": 2, "w": 3}))


def nmea(rows):
    out = geographic(rows)
    for name in ("lat_deg", "lon_deg"):
        whole = np.trunc(out[name])
        out[name] = 100.0 * whole + 60.0 * (out[name] - whole)
    return out


def ahead(rows, metres):
    east = rows.vehicle_id == "a"
    return rows.assign(
        x_m=rows.x_m + metres * east,
        y_m=rows.y_m + metres * ~east,
        heading=np.where(east, 0.0, np.pi / 2.0),
    )


def sized(rows, length, width):
    return rows.assign(length=length, width=width)


def plain(rows):
    return rows.rename(
        columns={"t_s": "t", "vehicle_id": "id", "x_m": "x", "y_m": "y", "speed_mps": "speed"}
    )


def with_headings(rows):
    return plain(rows).assign(heading=np.where(rows["vehicle_id"] == "a", 0.0, np.pi / 2.0))


def ngsim(rows):
    names = {
        "t_s": "Global_Time",
        "vehicle_id": "Vehicle_ID",
        "x_m": "Local_X",
        "y_m": "Local_Y",
        "speed_mps": "v_Vel",
    }
    rows = rows.assign(
        t_s=(rows.t_s * 1000).round().astype(np.int64),
        vehicle_id=rows.vehicle_id.map({"a": 1, "b": 2}),
    )
    rows = rows.assign(**{name: rows[name] / FOOT for name in ("x_m", "y_m", "speed_mps")}).rename(
        columns=names
    )
    return rows.assign(
        Global_X=6e6, Global_Y=1.8e6, v_Length=4.5 / FOOT, v_Width=1.8 / FOOT, v_Acc=0.0, Lane_ID=2
    )


READ = {  # name: what is changed, columns, what is said (None: nothing), how the file is written
    "held fixes": (held, "", "position repeated while the vehicle moves"),
    "before 1970": (lambda rows: rows.assign(t_s=rows.t_s - 1006.0), "", "6 s are added to all"),
    "minutes": (lambda rows: rows.assign(t_min=rows.pop("t_s") / 60.0), "", ""),
    "the front's position": (lambda rows: ahead(rows, 2.4), "point=front", ""),
    "the rear axle's position": (lambda rows: ahead(rows, -1.44), "point=rear_axle", ""),
    "dogs": (with_kind, "", "1 × animal.dog.0007"),
    "dogs by a number": (numbered, "kind=type:1+2", "1 × unnamed 3"),
    "columns not read": (lambda rows: rows.assign(lane=3), "", "not read: lane"),
    "brackets": (
        lambda rows: rows.rename(columns={"x_m": "Ost X [m]", "y_m": "Nord [y] "}),
        "x=Ost X [m],y=Nord [y]",
        "",
    ),
    "spaces": (lambda rows: rows.rename(columns={"x_m": "Pos X [m]", "y_m": "y (m)"}), "", ""),
    "feet": (lambda rows: sized(rows, 15.0, 6.0), "", "like feet"),
    "zero": (lambda rows: sized(rows, 0.0, 0.0), "", "0 m × 0 m"),
    "length and width swapped": (lambda rows: sized(rows, 1.8, 4.5), "", "it looks swapped"),
    "degrees and minutes": (nmea, "lat=lat_deg:ddmm,lon=lon_deg:ddmm", ""),
    "a decimal comma": (
        plain,
        "",
        "its numbers have a decimal comma",
        {"sep": ";", "decimal": ","},
    ),
    "UTF-16": (plain, "", "the file is UTF-16", {"encoding": "utf-16"}),
    "bars": (plain, "", None, {"sep": "|"}),
    "spaces between fields": (plain, "", None, {"sep": " "}),
    "headings that fit": (with_headings, "", None),
    "no speed": (
        lambda rows: plain(rows).drop(columns="speed"),
        "",
        "speeds are derived from the positions",
    ),
    "NGSIM": (ngsim, "", "feet are converted to metres"),
    "headings that are zero": (
        lambda rows: with_headings(rows).assign(heading=0.0),
        "",
        "headings that contradict it are not used",
    ),
}


@pytest.mark.parametrize(
    ("change", "columns", "said", "options"), [(*row, {})[:4] for row in READ.values()], ids=READ
)
def test_table_is_read_as_driven(tmp_path, change, columns, said, options):
    (driven,) = read_log(save(crossing(), tmp_path)).encounters
    result = read_log(
        save(change(crossing()), tmp_path, "other.csv", **options), LogConfig(columns=columns)
    )
    (encounter,) = result.encounters
    size, names = ((4.5, 1.8), "12") if change is ngsim else ((4.8, 1.9), "ab")
    assert [(one.id, one.length, one.width) for one in encounter.vehicles] == [
        (name, *map(pytest.approx, size)) for name in names
    ]
    count = min(len(encounter.time), len(driven.time))
    for name in ("position", "speed"):
        mine, right = getattr(encounter, name)[:, :count], getattr(driven, name)[:, :count]
        origin = mine[:, :1] - right[:, :1] if encounter.origin and name == "position" else 0.0
        np.testing.assert_allclose(
            mine - origin, right, atol=0.7 if said and "repeated" in said else 0.25
        )
    assert said is not None or not result.quality.notes
    assert (said or "") in " ".join(result.quality.notes) + " ".join(
        map(str, result.quality.dropped)
    )


@pytest.mark.parametrize(("aside_share", "is_noted"), [(0.05, False), (0.15, True)])
def test_velocities_ahead_are_of_bodies(tmp_path, aside_share, is_noted):
    """Velocities with vy = 0 nearly always; in the frame of the map they contradict the one that drives north."""
    rows = crossing()
    turned = rows.groupby("vehicle_id").cumcount() % 20 < 20 * aside_share
    velocity = {"vx_mps": rows.speed_mps * ~turned, "vy_mps": rows.speed_mps * turned}
    rows = rows.drop(columns="speed_mps").assign(**velocity)
    notes = " ".join(read_log(save(rows, tmp_path), LogConfig(strict=False)).quality.notes)
    assert ("recorded velocities are far off" in notes) == is_noted


SAID = {  # what is read, but looks otherwise
    "knots": (
        lambda rows: rows.assign(speed_mps=rows.speed_mps * 3600 / 1852),
        "knots: --set log.columns=speed=speed_mps:kn",
    ),
    "overlaps": (
        lambda rows: rows.assign(
            x_m=rows.x_m.where(rows.vehicle_id == "a", 1.05 * rows.x_m.shift(1) + 2.0),
            y_m=0.0,
            speed_mps=np.nan,
        ),
        "overlap",
    ),
    "kinds without a meaning": (
        lambda rows: rows.assign(type=1),
        "column type has numbers (1) of unknown meaning",
    ),
    "swapped axes": (
        lambda rows: with_headings(rows).rename(columns={"x": "y", "y": "x"}),
        "if x and y are swapped: --set log.columns=x=y,y=x",
    ),
    "km/h": (
        lambda rows: plain(rows).assign(speed=lambda own: own.speed * 3.6),
        "it is assumed that speeds are in km/h: --set log.columns=speed=speed:kmh",
    ),
}


@pytest.mark.parametrize(("change", "said"), SAID.values(), ids=SAID)
def test_what_looks_otherwise_is_said_once(tmp_path, change, said):
    notes = read_log(save(change(crossing()), tmp_path), LogConfig(travel=0.0)).quality.remarks()
    assert sum(said in note for note in notes) == 1


@pytest.mark.parametrize(
    ("back", "rate"), [(0.5, 10.0), (1.0, 10.0), (1.0, 1.0), (1.5, 1.0), (0.7, 2.0)]
)
def test_a_clock_set_back_cuts(tmp_path, back, rate):
    rows = crossing(seconds=14.0, rate=rate)
    rows["t_s"] -= np.where(rows["t_s"] > 1006.0, back, 0.0)
    result = read_log(save(rows, tmp_path))
    assert len(result.encounters) == 2
    assert max(encounter.speed.max() for encounter in result.encounters) < 8.2
    assert "the clock steps" in " ".join(result.quality.notes)


def test_jump_without_speeds_is_not_driven(tmp_path):
    rows = crossing(seconds=16.0, rate=2.0).drop(columns="speed_mps")
    rows.loc[(rows.vehicle_id == "a") & (rows.t_s > 1008.0), "y_m"] += 30.0
    result = read_log(save(rows, tmp_path))
    assert max(encounter.speed.max() for encounter in result.encounters) < 8.5


def test_sparse_fixes_do_not_refuse_log(tmp_path):
    points = [
        (7.9, -3.4),
        (12.4, -4.2),
        (21.5, -6.4),
        (28.8, -0.8),
        (46.2, -9.2),
        (55.1, -13.5),
        (61.4, -23.0),
        (57.3, -47.5),
    ]
    rows = [
        (5.0 * k, name, x, y + off)
        for k, (x, y) in enumerate(points)
        for name, off in (("1", 0.0), ("2", 8.0))
    ]
    assert read_log(save(pd.DataFrame(rows, columns=["t", "id", "x", "y"]), tmp_path)).encounters


@pytest.mark.parametrize("ids", [(LONG, LONG + 1), ("1e5", "100000"), ("12e3", "120e2")])
def test_ids_stay_what_they_are(tmp_path, ids):
    rows = crossing().assign(
        vehicle_id=lambda own: own.vehicle_id.map(dict(zip("ab", map(str, ids), strict=True)))
    )
    rows.loc[4, "vehicle_id"] = None
    (encounter,) = read_log(save(rows, tmp_path)).encounters
    assert {vehicle.id for vehicle in encounter.vehicles} == set(map(str, ids))


@pytest.mark.parametrize("above", ["# ours\n# ego: 1\n", "sep=,\n", "\n"])
def test_lines_above_the_header(tmp_path, above):
    rows = crossing()
    rows.loc[3, "x_m"] = np.nan
    (tmp_path / "log.csv").write_text(above + rows.to_csv(index=False))
    result = read_log(tmp_path / "log.csv")
    assert str(result.quality.dropped[0]).endswith(f"log.csv, line {above.count(chr(10)) + 5}")


def pose_lines(rows):
    """Rows of one vehicle as TUM writes them: no header; stamp, place, rotation."""
    return "".join(f"{r.t_s:.1f} {r.x_m} {r.y_m} 0 0 0 0 1\n" for r in rows.itertuples())


LAYOUTS = {  # the text of a table, as people have it
    "a separator at the end of each row": lambda text: text.replace("\n", ",\n").replace(
        ",\n", "\n", 1
    ),
    "decimal commas in quotes": lambda text: re.sub(r"(-?\d+)\.(\d+)", r'"\1,\2"', text),
    "newest first": lambda text: "\n".join([text.split("\n")[0], *text.split("\n")[:0:-1]]),
    "seconds and nanoseconds": lambda text: re.sub(
        r"(?m)^(\d+)\.(\d)", r"\1,\g<2>00000000", text.replace("t_s", "stamp.sec,stamp.nanosec")
    ),
    "a counter of 16 bits": lambda text: re.sub(
        r"(?m)^(\d+)\.(\d)",
        lambda found: str((int(found[1] + found[2]) * 100 - 940_000) % 65_536),
        text.replace("t_s", "t_ms"),
    ),
}


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_layouts_of_tables(tmp_path, layout):
    path = save(crossing().round(6), tmp_path)
    (plain,) = read_log(path).encounters
    path.write_text(layout(path.read_text()))
    (encounter,) = read_log(path).encounters
    np.testing.assert_allclose(encounter.position[:, 5:-5], plain.position[:, 5:-5], atol=0.5)


def test_foreign_files_and_days_are_apart(tmp_path):
    for name in "ab":
        (tmp_path / f"{name}.txt").write_text(pose_lines(crossing().query("vehicle_id == @name")))
    (tmp_path / "notes.txt").write_text("hello\n")
    result = read_log(tmp_path)
    assert result.encounters[0].ids == ("a", "b")
    assert any(
        note.startswith("not read: ") and "notes.txt" in note for note in result.quality.notes
    )
    days = [crossing(start=86_400.0 * k) for k in (20_000, 20_007, 20_014)]
    paths = [save(day, tmp_path, f"day{k}.csv") for k, day in enumerate(days)]
    assert len(read_log(paths).encounters) == 3


def test_types_decide_sizes_of_vehicles(tmp_path):
    rows = crossing().assign(type="car", length=1.0, width=0.8)
    save(rows.query("vehicle_id == 'a'"), tmp_path, "a.csv")
    save(crossing().query("vehicle_id == 'b'"), tmp_path, "b.csv")
    result = read_log(tmp_path)
    assert [vehicle.length for vehicle in result.encounters[0].vehicles] == [4.8, 4.8]
    assert "1 m × 0.8 m is not the size of a car" in " ".join(result.quality.notes)


def test_type_numbers_are_read_from_parquet(tmp_path):
    crossing().assign(type=2).to_parquet(tmp_path / "log.parquet")
    (encounter,) = read_log(tmp_path / "log.parquet", columns="kind=type:car1+truck2")
    assert {vehicle.type for vehicle in encounter.vehicles} == {"truck"}


def test_vehicles_abreast_are_two(tmp_path):
    rows = crossing().query("vehicle_id == 'a'")
    both = pd.concat([rows, rows.assign(vehicle_id="c", y_m=3.2)])
    assert read_log(save(both, tmp_path)).encounters[0].ids == ("a", "c")


@pytest.mark.parametrize("ending", ["gz", "zip"])
def test_packed_logs(tmp_path, ending):
    crossing().to_csv(
        tmp_path / f"log.csv.{ending}",
        index=False,
        compression=None if ending == "zip" else "gzip",
    )
    if ending == "zip":
        with zipfile.ZipFile(tmp_path / "log.csv.zip", "w") as archive:
            archive.writestr("drive/log.csv", crossing().to_csv(index=False))
    (plain,) = read_log(save(crossing(), tmp_path, "plain.csv")).encounters
    path = tmp_path / f"log.csv.{ending}"
    np.testing.assert_array_equal(read_log(path).encounters[0].position, plain.position)
    with pytest.raises(InputError, match=rf"log\.csv\.{ending}.*limit 100\)"):
        read_log(path, LogConfig(row_limit=100))
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(InputError, match=rf"log\.csv\.{ending} cannot be unpacked"):
        read_log(path)


def test_files_without_ids_are_vehicles(tmp_path):
    rows = plain(crossing())
    for name in ("a", "b"):
        rows[rows.id == name].drop(columns="id").to_csv(tmp_path / f"car_{name}.csv", index=False)
    result = read_log([tmp_path / "car_a.csv", tmp_path / "car_b.csv"])
    assert [vehicle.id for vehicle in result.encounters[0].vehicles] == ["car_a", "car_b"]
    assert "each file is read as one vehicle" in " ".join(result.quality.notes)


REFUSED = {  # name: what is changed, what is said, how the file is written
    "ids that number the rows": (
        lambda rows: rows.rename(columns={"vehicle_id": "tracker"}).assign(id=range(len(rows))),
        "--set log.columns=vehicle=tracker",
    ),
    "hours": (
        lambda rows: rows.assign(t_s=(rows.t_s - 1000.0) / 3600.0),
        "it fits if the time is in h: --set log.columns=time=t_s:h",
    ),
    "degrees and minutes": (nmea, "lat=lat_deg:ddmm,lon=lon_deg:ddmm"),
    "1e-7 degrees": (
        lambda rows: geographic(rows).assign(lat_deg=4.8e8, lon_deg=1.1e8),
        "lat=lat_deg:e7,lon=lon_deg:e7",
    ),
    "a dog": (
        lambda rows: rows.assign(type=rows.vehicle_id.map({"a": "car", "b": "dog"})),
        "1 × dog",
    ),
    "ids of one ROS name": (
        lambda rows: rows.assign(vehicle_id=rows.vehicle_id.map({"a": "car-1", "b": "car_1"})),
        "vehicle ids 'car-1' and 'car_1' are both 'car_1' as ROS names; rename one",
    ),
    "no header": (
        plain,
        "line 1 has numbers instead of column names; insert a line such as t,id,x,y,speed",
        {"header": False},
    ),
    "another name for the vehicle": (
        lambda rows: plain(rows).rename(columns={"id": "who"}),
        "it could be who: --set log.columns=vehicle=who",
    ),
    "decimal commas between commas": (
        lambda rows: plain(rows).assign(t=[f"{t:.1f}".replace(".", ",") for t in rows.t_s]),
        "write 0.5, not 0,5",
        {"quoting": 3, "escapechar": " "},
    ),
    "a slip in a name": (
        lambda rows: plain(rows).rename(columns={"t": "timstamp"}),
        "--set log.columns=time=…; is it timstamp?",
    ),
}


@pytest.mark.parametrize(
    ("change", "said", "options"), [(*row, {})[:3] for row in REFUSED.values()], ids=REFUSED
)
def test_unreadable_files_have_a_remedy(tmp_path, change, said, options):
    with pytest.raises(InputError) as error:
        read_log(save(change(crossing()), tmp_path, **options))
    assert said in str(error.value)
