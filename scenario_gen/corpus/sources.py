# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of messages, and how the database reads each kind of them.

A table has messages if its columns, found as for every log, are vehicle, time, latitude,
longitude, speed and heading; if vehicles are whole numbers; and if stamps are those of a common
clock (Gentime, Unix time or dates). Text may have a header, quotes, and be packed as .gz.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math
from pathlib import Path
import re

from scenario_gen.base.errors import guarded, InputError
from scenario_gen.logs.column import Column
from scenario_gen.logs.columns import find_columns
from scenario_gen.logs.formats import LOG_FORMATS
from scenario_gen.logs.recognise import head_of, is_packed, is_spmd
from scenario_gen.logs.tables import SPMD_EPOCH_NS
from scenario_gen.logs.text import Layout, layout_of, SPMD_COLUMNS

EPOCH_US = SPMD_EPOCH_NS // 1000
TYPES = {
    **dict.fromkeys(("vehicle", "clock"), "BIGINT"),
    **dict.fromkeys(("time", "lat", "lon"), "DOUBLE"),
    **dict.fromkeys(("speed", "heading"), "FLOAT"),
}
STAMP = re.compile(r"\d+(\.\d*)?([eE]\+?\d+)?")
DATE = re.compile(r"\d{4}-\d\d-\d\d[ T]")
VEHICLE = re.compile(r"\d{1,15}(\.0*)?")
OPTIONS = "hive_partitioning = false, union_by_name = false"
"""The database reads the columns of a file, and not those that its folders are named after."""
FILE = "name of the file"  # a column that no table has
MAX_LINE_BYTES = 65_536  # a longer line is not a row


@dataclass(frozen=True)
class MessageTable:
    """How the database reads tables of messages.

    Attributes:
        reader: call of the function that reads the variable `files`.
        columns: device, t, lat, lon, speed, heading, clock, as messages.sql names them.
        header: bytes above the first row of text; -1: the file is not divided.
        is_text: whether rows may be rejected.
    """

    reader: str
    columns: str
    header: int = -1
    is_text: bool = True


@dataclass(frozen=True)
class _Sample:
    """Some values of a table, as text.

    Attributes:
        header: names of the columns.
        values: of each column.
        is_text: whether it is no Parquet table.
        separator: between fields of a text.
        n_lines: lines above the first row of a text.
        above: their bytes; -1 if the file is not divided: Parquet and .gz.
        is_quoted: whether fields have quotes.
    """

    header: list[str]
    values: Sequence[Sequence[str]]
    is_text: bool = False
    separator: str = ","
    n_lines: int = 0
    above: int = -1
    is_quoted: bool = False


def message_table(path: Path, option: str = "") -> MessageTable | None:
    """Return how a file is read, if it has messages; None for other and unreadable files.

    Args:
        path: the file; of a text, its beginning is enough, of Parquet its end.
        option: the parameter `columns` of logs.
    """
    try:
        known = next((known for known in LOG_FORMATS.values() if known.accepts(path)), None)
        if known not in (LOG_FORMATS["spmd"], LOG_FORMATS["table"]):
            return None
        sample = _parquet_sample(path) if is_parquet(path) else _text_sample(path)
        columns = find_columns(sample.header, path, option)
        columns.pop("height", None)  # a bridge between two receivers is not told from their noise
    except (InputError, OSError):  # the reader of logs names the reason
        return None
    stamp = _stamp_type(sample, columns)
    return _table(sample, columns, stamp) if stamp else None


def is_parquet(path: Path) -> bool:
    """Return whether a name is that of a Parquet table."""
    return path.suffix.lower() in (".parquet", ".pq")


def _text_sample(path: Path) -> _Sample:
    """Return the first rows of a text.

    Raises:
        InputError: it has no header.
    """
    head = head_of(path)
    lines = head.decode("utf-8-sig", errors="replace").splitlines()
    n_lines, separator, header = 0, ",", SPMD_COLUMNS
    if not is_spmd(path):
        layout = layout_of(path)
        n_lines, separator = layout.above + 1, layout.separator
        names = "".join(lines[layout.above : n_lines]).split(separator)
        header = [name.strip(' "') for name in names]
        if layout != Layout(separator=separator, above=layout.above):
            raise InputError(f"{path} is UTF-16, or has decimal commas")
    rows = [
        [field.strip(' "') for field in line.split(separator)] for line in lines[n_lines:][:20]
    ]
    rows = [row for row in rows if len(row) == len(header)] or [[""] * len(header)]
    return _Sample(
        header,
        list(zip(*rows, strict=True)),
        is_text=True,
        separator=separator,
        n_lines=n_lines,
        above=-1 if is_packed(path) else sum(map(len, head.splitlines(keepends=True)[:n_lines])),
        is_quoted=any('"' in line for line in lines[:20]),
    )


def _parquet_sample(path: Path) -> _Sample:
    """Return the smallest and largest values of a Parquet table.

    Raises:
        InputError: it is damaged.
    """
    from pyarrow import parquet

    with guarded(str(path)):
        metadata = parquet.read_metadata(path)
        header = metadata.schema.names
        groups = [metadata.row_group(k) for k in range(metadata.num_row_groups)]
        columns = [[group.column(k).statistics for group in groups] for k in range(len(header))]
        ends = [
            [text for part in column if part for text in (str(part.min), str(part.max))]
            for column in columns
        ]
    return _Sample(header, ends)


def _stamp_type(sample: _Sample, columns: Mapping[str, Column]) -> str:
    """Return the type of the stamps in the database; "" if the columns are not those of messages.

    Stamps are from 2004 to 2044.
    """
    is_usual = all(column.factor > 0.0 and not column.minutes for column in columns.values())
    is_unique = len(set(sample.header)) == len(sample.header)
    if columns.keys() != TYPES.keys() - {"clock"} or not (is_usual and is_unique):
        return ""
    vehicles, stamps = (
        sample.values[sample.header.index(columns[name].name)] for name in ("vehicle", "time")
    )
    if not any(map(VEHICLE.fullmatch, vehicles)):
        return ""
    if columns["time"].is_gentime:
        return "BIGINT"
    if any(map(DATE.match, stamps)):
        return "TIMESTAMPTZ"
    factor = 1e6 * columns["time"].factor
    numbers = (factor * float(text) - EPOCH_US for text in stamps if STAMP.fullmatch(text))
    latest_us = 40 * 365 * 24 * 3_600_000_000  # 40 years after 2004, as in messages.sql
    return "DOUBLE" if any(0.0 < number < latest_us for number in numbers) else ""


def _table(sample: _Sample, columns: Mapping[str, Column], stamp: str) -> MessageTable:
    """Return how a table of messages is read; `stamp` is the type of its stamps.

    No quotes are parsed: an unpaired one would cost more than its row.
    """
    places = {quantity: sample.header.index(column.name) for quantity, column in columns.items()}
    lower = [name.lower() for name in sample.header]
    if stamp == "BIGINT" and "dsecond" in lower:
        places["clock"] = lower.index("dsecond")
    types = {name: (TYPES | {"time": stamp})[name] for name in places}
    is_plain = not sample.is_quoted and stamp != "TIMESTAMPTZ"
    fields = _fields(sample, "c{}" if is_plain else "trim(c{}, ' \"')")
    values = {name: _cast(fields[k], types[name]) for name, k in places.items()}
    reader = f"read_parquet(getvariable('files'), {OPTIONS}, filename = '{FILE}')"
    if sample.is_text:
        reader = _text_reader(sample, {places[name]: types[name] for name in places if is_plain})
    return MessageTable(reader, _selected(values, columns, stamp), sample.above, sample.is_text)


def _fields(sample: _Sample, field: str) -> list[str]:
    """Return the columns in SQL; those of texts are numbered, in the format `field`."""
    if sample.is_text:
        return [field.format(k) for k in range(len(sample.header))]
    return ['"{}"'.format(name.replace('"', '""')) for name in sample.header]


def _text_reader(sample: _Sample, types: Mapping[int, str]) -> str:
    """Return the call that reads a text; `types` are those of columns that are no text."""
    columns = {f"c{k}": types.get(k, "VARCHAR") for k in range(len(sample.header))}
    packed = f", compression = 'gzip', skip = {sample.n_lines}" if sample.above < 0 else ""
    return (
        f"read_csv(getvariable('files'), columns = {columns}, header = false, "
        f"auto_detect = false, delim = '{sample.separator}', quote = '', escape = '', "
        "strict_mode = false, store_rejects = true, "
        f"{OPTIONS}, filename = '{FILE}', max_line_size = {MAX_LINE_BYTES}{packed})"
    )


def _cast(value: str, data_type: str) -> str:
    return f"TRY_CAST({value} AS {data_type})"


def _selected(values: Mapping[str, str], columns: Mapping[str, Column], stamp: str) -> str:
    """Return the columns of messages in their units, from the values of a table's columns."""
    scaled = {name: _product(values[name], column.factor) for name, column in columns.items()}
    time = values["time"]
    if stamp == "TIMESTAMPTZ":
        time = f"epoch_us({time}) - {EPOCH_US}"
    elif stamp == "DOUBLE":
        unix_us = _product(time, 1e6 * columns["time"].factor)
        time = _cast(f"round({unix_us} - {EPOCH_US})", "BIGINT")
    degrees = _product(values["heading"], round(math.degrees(columns["heading"].factor), 9))
    heading = degrees if columns["heading"].clockwise else f"90.0 - {degrees}"
    return (
        f"{values['vehicle']} AS device, {time} AS t, {scaled['lat']} AS lat, "
        f"{scaled['lon']} AS lon, ({scaled['speed']})::FLOAT AS speed, "
        f"({heading})::FLOAT AS heading, {values.get('clock', 'NULL')} AS clock, "
        f'"{FILE}" AS filename'
    )


def _product(value: str, factor: float) -> str:
    return value if factor == 1.0 else f"{value} * {factor!r}"
