# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Damaged and hostile logs: what is said of them, and what a small file may ask for."""

import os
from pathlib import Path
import tracemalloc

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import parquet
import pytest
from support.log_builders import crossing, geographic, save

from scenario_gen.base.errors import InputError, MAX_INPUT_CHARACTERS
from scenario_gen.logs import LogConfig, read_log


def test_stamp_of_another_age_is_dropped(tmp_path):
    rows = crossing()
    rows.loc[40, "t_s"] += 3e8
    (encounter,) = read_log(save(rows, tmp_path)).encounters
    assert encounter.duration > 9.0


def test_the_clock_of_all_vehicles_counts(tmp_path):
    path = save(crossing(seconds=12.0), tmp_path)
    assert read_log(path, LogConfig(tick_limit=240)).encounters
    with pytest.raises(InputError, match=r"240 ticks of 0\.1 s \(limit 239\)"):
        read_log(path, LogConfig(tick_limit=239))


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_another_unit_of_time_is_recognised(tmp_path, factor, unit):
    rows = crossing(start=0.0)
    rows["t_s"] = (rows["t_s"] * factor).round()
    path = save(rows, tmp_path)
    with pytest.raises(InputError, match=f"time=t_s:{unit}"):
        read_log(path)
    assert len(read_log(path, LogConfig(columns=f"time=t_s:{unit}")).encounters) == 1
    unnamed = save(rows.rename(columns={"t_s": "t"}), tmp_path)
    if unit == "ns":  # beyond the stamps that 64 bits have
        with pytest.raises(InputError, match=r"--set log\.columns=time=t:ns"):
            read_log(unnamed)
        return
    result = read_log(unnamed)
    assert len(result.encounters) == 1
    assert f"--set log.columns=time=t:{unit}" in " ".join(result.quality.notes)


@pytest.mark.parametrize(
    ("limit", "said"),
    [
        ({"row_limit": 100}, r"has at least \d+ rows \(limit 100\).*row_limit"),
        ({"vehicle_limit": 2}, r"3 vehicles \(limit 2.*vehicle_limit"),
    ],
)
@pytest.mark.parametrize("name", ["log.csv", "log.parquet"])
def test_limits_are_named_with_the_figure(tmp_path, limit, said, name):
    rows = pd.concat(
        [crossing(), crossing().query("vehicle_id == 'a'").assign(vehicle_id="c", y_m=20.0)]
    )
    path = tmp_path / name
    rows.to_csv(path, index=False) if name == "log.csv" else rows.to_parquet(path)
    with pytest.raises(InputError, match=said):
        read_log(path, LogConfig(**limit))
    assert read_log(path).encounters


def test_rows_of_several_files_count_together(tmp_path):
    for k in range(3):
        crossing(start=1000.0 + 20.0 * k).to_csv(tmp_path / f"{k}.csv", index=False)
    with pytest.raises(InputError, match=r"2\.csv.* rows \(limit 500\)"):
        read_log(tmp_path, LogConfig(row_limit=500))


def test_a_large_file_is_not_opened(tmp_path):
    path = tmp_path / "log.csv"
    with path.open("wb") as file:
        file.write(b"t,x,y,speed\n")
        file.truncate(300 << 20)
    with pytest.raises(InputError, match=r"300\.0 MiB .*limit 256 MiB.*size_limit"):
        read_log(path)


def test_swelling_parquet_is_refused_with_figures(tmp_path):
    """A few kilobytes of repetition: 500 MB of numbers, or of text that repeats."""
    count = 2_000_000
    columns = {name: pa.array(np.zeros(count)) for name in ("x_m", "y_m", "speed_mps")}
    columns |= {
        "t_s": pa.array(np.repeat(np.arange(4.0), count // 4)),
        "vehicle_id": pa.array(["a", "b"] * (count // 2)),
    }
    parquet.write_table(pa.table(columns), tmp_path / "log.parquet", compression="zstd")
    assert (tmp_path / "log.parquet").stat().st_size < 1 << 20
    with pytest.raises(
        InputError, match=r"log\.parquet has at least 2000000 rows \(limit 1000000"
    ):
        read_log(tmp_path / "log.parquet", LogConfig(row_limit=1_000_000))
    with pytest.raises(InputError, match=r"log\.parquet has at least .* MiB .*\(limit 8 MiB"):
        read_log(tmp_path / "log.parquet", LogConfig(size_limit=8))


def table_with(tmp_path, stamps):
    """The crossing as Parquet with an Arrow array of stamps, row by row of `crossing`."""
    rows = pa.Table.from_pandas(
        crossing(start=1_700_000_000.0).drop(columns="t_s"), preserve_index=False
    )
    path = tmp_path / "log.parquet"
    parquet.write_table(rows.append_column("time", stamps), path)
    return path


NS = (crossing(start=1_700_000_000.0)["t_s"] * 1000.0).round().astype(np.int64).to_numpy() * 10**6


@pytest.mark.parametrize(
    "kind",
    [
        *(
            pa.timestamp("ms"),
            pa.timestamp("us"),
            pa.timestamp("ns"),
            pa.timestamp("us", "UTC"),
            pa.timestamp("ns", "Europe/Berlin"),
        ),
        *(
            pa.timestamp("ms", "+05:30"),
            pa.float64(),
            pa.decimal128(30, 9),
            pa.string(),
            pa.large_string(),
        ),
        pa.dictionary(pa.int32(), pa.string()),
    ],
    ids=str,
)
@pytest.mark.parametrize("missing", [False, True])
def test_kinds_of_stamps_are_read_alike(tmp_path, kind, missing):
    """Each kind gives the same instants, with rows that miss theirs left out and counted."""
    stamps = pa.array([None if missing and k == 60 else int(ns) for k, ns in enumerate(NS)])
    if pa.types.is_timestamp(kind):
        values = (
            stamps.cast(pa.timestamp("ns"))
            .cast(pa.timestamp(kind.unit))
            .cast(pa.int64())
            .cast(kind)
        )
    else:
        seconds = [
            None if value is None else f"{value // 10**9}.{value % 10**9:09d}"
            for value in stamps.to_pylist()
        ]
        values = (
            pa.array(seconds).dictionary_encode()
            if pa.types.is_dictionary(kind)
            else pa.array(seconds).cast(kind)
        )
    result = read_log(table_with(tmp_path, values))
    (encounter,) = result.encounters
    assert encounter.start_ns == 1_700_000_000 * 10**9
    assert encounter.duration == pytest.approx(12.0)
    assert {drop.reason: drop.count for drop in result.quality.dropped} == (
        {"stamp is not a number": 1} if missing else {}
    )


@pytest.mark.parametrize(
    "stamps",
    [
        pa.array([True] * len(NS)),
        pa.array(NS).cast(pa.duration("ns")),
        pa.array([[1]] * len(NS)),
        pa.array([b"1"] * len(NS)),
        pa.array([253402214400] * len(NS)).cast(pa.timestamp("s")),
        pa.array([2**62] * len(NS)).cast(pa.timestamp("us")),
        pa.array([-(2**63)] * len(NS)),
        pa.array([2**64 - 1] * len(NS), type=pa.uint64()),
        pa.array(["9999-12-31"] * len(NS)),
        pa.array(["None"] * len(NS)),
        pa.nulls(len(NS)),
    ],
    ids=str,
)
def test_stamps_that_are_none_are_refused(tmp_path, stamps):
    with pytest.raises(InputError, match=r"stamp is out of range|'time'"):
        read_log(table_with(tmp_path, stamps))


TEXTS = {
    "a row with more fields": (
        lambda text: text.replace(",8.0\n", ",8.0,1\n", 1),
        "more fields|Expected 5 fields in line",
    ),
    "rows with more fields": (
        lambda text: "\n".join(line + ",1" * (k > 0) for k, line in enumerate(text.split("\n"))),
        "more fields",
    ),
    "no position": (lambda text: text.replace("x_m", "true", 1), "no column for position"),
    "UTF-16": (lambda text: text.encode("utf-16-le"), "not a text file .or UTF-16"),
    "Latin-1": (lambda text: text.replace("a,", "ä,").encode("latin-1"), "not UTF-8 text"),
    "a long name": (lambda text: "a" * 50_000 + text, "no column for time"),
    "an endless line": (
        lambda text: "a" * 100_000 + text,
        "its first line has 65536 characters or more",
    ),
    "no rows": (lambda text: text.split("\n", 1)[0] + "\n", "has a header but no rows"),
    "no text": (lambda text: "\n\n\n", "cannot be read as a table|no column"),
    "an open quote": (
        lambda text: text.replace("a,", '"a,', 1),
        "cannot be read as a table: .*EOF inside string",
    ),
    "zeros": (lambda text: "\0" * 1000, "not a text file"),
}


@pytest.mark.parametrize(("change", "said"), TEXTS.values(), ids=TEXTS)
def test_text_that_is_no_table(tmp_path, change, said):
    path = tmp_path / "log.csv"
    text = change(crossing().to_csv(index=False))
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=said) as error:
        read_log(path)
    assert "log.csv" in str(error.value) and len(str(error.value)) <= MAX_INPUT_CHARACTERS


@pytest.mark.parametrize("value", [1e300, -1e300, 1e308, 3e8])
def test_positions_beyond_the_earth_are_dropped(tmp_path, value):
    rows = crossing()
    rows.loc[50, "x_m"] = value
    (drop,) = read_log(save(rows, tmp_path)).quality.dropped
    assert (drop.reason, drop.count) == ("position is not on Earth", 1)


def test_numbers_and_names_of_any_length(tmp_path):
    rows = geographic(crossing()).astype(object)
    rows.loc[50, "lat_deg"] = "1" * 400
    rows["vehicle_id"] = rows["vehicle_id"] * 3000
    (drop,) = read_log(save(rows, tmp_path)).quality.dropped
    assert drop.count == 1


def test_what_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "log.csv")
    for path, said in (
        (tmp_path / "log.csv", "neither a file nor a folder"),
        (tmp_path / ("x" * 300), "name too long"),
    ):
        with pytest.raises(InputError, match=said):
            read_log(path)
    with pytest.raises(InputError):
        read_log(Path("a\0b"))


def test_repeated_long_texts_are_stored_once(tmp_path):
    text = "A" * 300_000
    table = {"t": [0.1 * k for k in range(400)], "id": ["a", "b"] * 200, "type": [text] * 400}
    pd.DataFrame({**table, "x": 0.0, "y": 0.0}).to_parquet(tmp_path / "log.parquet")
    tracemalloc.start()
    with pytest.raises(InputError, match="no two vehicles"):
        read_log(tmp_path / "log.parquet")
    assert tracemalloc.get_traced_memory()[1] < 50e6
    tracemalloc.stop()
