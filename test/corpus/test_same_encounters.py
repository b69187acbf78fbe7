# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`mine` and `read_log` find the same encounters in the same file."""

import gzip
import math

import numpy as np
import pandas as pd
import pyproj
import pytest
from synthetic_archive import ArchiveConfig, read_planted, write_archive

from scenario_gen.corpus.encounters import encounter_of, tables_of
from scenario_gen.corpus.inventory import inventory
from scenario_gen.corpus.mine import mine
from scenario_gen.corpus.tables import rows_of
from scenario_gen.logs import read_log
from scenario_gen.logs.tables import SPMD_EPOCH_NS
from scenario_gen.logs.text import SPMD_COLUMNS

pytestmark = pytest.mark.xdist_group("corpus")
GLOBE = pyproj.Proj(proj="aeqd", lat_0=42.3, lon_0=-83.7, ellps="WGS84")


def column(folder, count, behind, speed):
    """Basic safety messages of cars in one lane for 20 s, each `behind` seconds after the one before."""
    folder.mkdir()
    lines = []
    for k in range(count):
        for tick in range(200):
            longitude, latitude = GLOBE(speed * (0.1 * tick - behind * k), 0.0, inverse=True)
            stamp = 259_203_600_000_000 + 100_000 * tick
            row = [
                9,
                1,
                k + 1,
                stamp,
                0,
                0,
                stamp // 1000 % 60_000,
                f"{latitude:.7f}",
                f"{longitude:.7f}",
                250,
                speed,
                90,
            ]
            lines.append(",".join(map(str, [*row, 0, 0, 0, 0, 0, 0, 100])))
    (folder / "a.csv").write_text("\n".join(lines) + "\n")
    return folder


def both(folder, out):
    """The encounters, as (vehicles, begin and end to a second), of both."""
    mine([folder], out)
    mined = [encounter_of(row) for row in rows_of(tables_of(out))]
    read = read_log(sorted(folder.glob("[!s]*"))).encounters
    return (
        sorted(
            (
                sorted(int(v.id) for v in one.vehicles),
                round(one.start_ns * 1e-9),
                round(one.start_ns * 1e-9 + one.duration),
            )
            for one in found
        )
        for found in (mined, read)
    )


def test_a_column_of_13(tmp_path):
    mined, read = both(column(tmp_path / "in", 13, 1.2, 38.0), tmp_path / "out")
    assert read == mined
    assert {name for names, _, _ in read for name in names} == set(range(1, 14))


@pytest.mark.parametrize("seed", [3, pytest.param(5, marks=pytest.mark.long)])
def test_an_archive(tmp_path, seed):
    config = ArchiveConfig(30_000, 0.2, 12, 4, wrong_times=0.0, damaged=0.0, repeated_ids=0.0)
    planted = read_planted(write_archive(tmp_path / "in", config, seed))
    mined, read = both(tmp_path / "in", tmp_path / "out")
    assert [names for names, _, _ in read] == [names for names, _, _ in mined]
    assert np.allclose([times for _, *times in read], [times for _, *times in mined], atol=1.0)
    assert {tuple(names) for names, _, _ in read} == {
        tuple(sorted(one.devices)) for one in planted if one.inside
    }


UNIX = "Vehicle ID,timestamp,lat,lon,speed [km/h],yaw"


def written(lines, folder, form):
    """Write the same rows in another form."""
    folder.mkdir()
    rows = [line.split(",") for line in lines]
    header = [",".join(SPMD_COLUMNS)]
    if form == "header":
        (folder / "a.csv").write_text("\n".join([*header, *lines]))
    elif form == "quoted":
        quotes = ['"' + line.replace(",", '","') + '"' for line in [*header, *lines]]
        (folder / "a.csv").write_text("\n".join(quotes))
    elif form == "gzip":
        (folder / "a.csv.gz").write_bytes(gzip.compress("\n".join(lines).encode()))
    elif form == "named":
        named = [
            f"{row[2]};{int(row[3]) * 1e-6 + SPMD_EPOCH_NS * 1e-9:.6f};{row[7]};{row[8]};"
            f"{3.6 * float(row[10])};{math.radians(90.0 - float(row[11]))}"
            for row in rows
        ]
        (folder / "a.csv").write_text("\n".join([UNIX.replace(",", ";"), *named]))
    else:
        table = pd.DataFrame(rows, columns=SPMD_COLUMNS).astype(float)
        table = table.astype({"TxDevice": int, "Gentime": int, "DSecond": int})
        table["utc"] = pd.to_datetime(table["Gentime"] * 1000 + SPMD_EPOCH_NS, utc=True)
        table = table.rename(columns={"Heading": "heading_cw_deg"})
        table.drop(columns=["Gentime", "DSecond"]).to_parquet(folder / "a.parquet")
    return folder


@pytest.mark.parametrize("form", ["header", "quoted", "gzip", "named", "parquet"])
def test_rows_in_any_form(tmp_path, form):
    """The messages of a column, in a table that is no SPMD text."""
    lines = (column(tmp_path / "spmd", 4, 1.2, 20.0) / "a.csv").read_text().splitlines()
    folder = written(lines, tmp_path / form, form)
    _, logs, others, _ = inventory([folder])
    assert not logs and not others
    mined, read = both(folder, tmp_path / "out")
    assert read == mined and len(mined)
    table = next(rows_of(tables_of(tmp_path / "out")))
    assert abs(table["start_ns"] * 1e-9 - 259_203_600 - SPMD_EPOCH_NS * 1e-9) < 1.0
