# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Files with the faults that once broke a reader, each made here from a small good one; laid out as the folder of those found.

A name says by whose reader it is read (its folder) and what is wrong; none of them is what was found.
"""

from collections.abc import Callable
from functools import cache
from io import BytesIO
from pathlib import Path
import sqlite3
import struct
import tempfile
import zlib

from mcap.writer import CompressionType
import pandas as pd
from PIL import Image
import pyarrow as pa
from pyarrow import parquet
from support.bag_examples import hand_made_run
from support.cut_bags import mcap_bytes, small_bag
from support.log_builders import crossing

from scenario_gen.bags.recordings.write import write_recording

Make = Callable[[], bytes]
LONG = "a" * 20_000
NUMBER = "9" * 5000
"""More digits than Python turns into a number."""


YAML = {
    "an_integer_of_nothing": '!!int ""',
    "no_month": "2026-13-45",
    "too_many_digits": NUMBER,
    "a_long_word": LONG,
}
"""Values that a reader of YAML stumbles over."""


def image(kind: str, size: tuple[int, int] = (40, 40)) -> bytes:
    """A picture, all free."""
    out = BytesIO()
    Image.new("L", size, 254).save(out, kind)
    return out.getvalue()


def bomb(width: int, height: int) -> bytes:
    """A PNG of a few bytes that says it is so large, of one bit each."""

    head = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    out = b"\x89PNG\r\n\x1a\n"
    for name, data in ((b"IHDR", head), (b"IDAT", zlib.compress(b"\0" * 1000)), (b"IEND", b"")):
        size, check = (struct.pack(">I", n) for n in (len(data), zlib.crc32(name + data)))
        out += size + name + data + check
    return out


def nav2(picture: str, **facts: str) -> bytes:
    """A map's facts."""
    given = {"image": picture, "resolution": "0.2", "origin": "[0, 0, 0]", "negate": "0"}
    given |= {"occupied_thresh": "0.65", "free_thresh": "0.25"} | facts
    return "".join(f"{key}: {value}\n" for key, value in given.items()).encode()


ALIASES = "a0: &a0 [1,1,1,1,1,1,1,1,1]\n" + "".join(
    f"a{k}: &a{k} [{','.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 8)
)
IMAGES = {
    "a_cut_png": ("m.png", lambda: image("png")[:-30]),
    "a_png_of_wrong_chunks": ("m.png", lambda: image("png").replace(b"IDAT", b"\0\0IE")),
    "a_huge_png": ("m.png", lambda: bomb(600_000, 500_000)),
    "a_cut_pgm": ("m.pgm", lambda: b"P5 40 40 255\n" + bytes(100)),
    "an_empty_file": ("m.webp", bytes),
}


def mcap(compression: CompressionType = CompressionType.NONE) -> bytes:
    """A small bag of several chunks by the mcap library."""
    text = b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00"
    messages = ((1000 + k, text + bytes([k])) for k in range(40))
    return mcap_bytes(messages, chunk_size=300, compression=compression)


def at_record(data: bytes, opcode: int, offset: int, value: bytes) -> bytes:
    """The same bytes with others at an offset from the beginning of the first record of a kind."""
    place = 8
    while data[place] != opcode:
        place += 9 + int.from_bytes(data[place + 1 : place + 9], "little")
    return data[: place + offset] + value + data[place + offset + len(value) :]


BEYOND = (2**64 - 1).to_bytes(8, "little")
ZSTD, LZ4, PLAIN = CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE
CHUNK, INDEX, SCHEMA = 0x06, 0x08, 0x03
MCAP: dict[str, Make] = {
    "a_chunk_beyond_64_bits": lambda: at_record(mcap(), CHUNK, 1, BEYOND),
    "an_index_that_points_beyond": lambda: at_record(mcap(), INDEX, 9 + 16, BEYOND),
    "a_schema_of_another_number": lambda: at_record(mcap(), SCHEMA, 9, b"\xcb\x00"),
    "zstd_of_no_frame": lambda: mcap(ZSTD).replace(b"\x28\xb5\x2f\xfd", b"\x28\xb5\x2f\x00"),
    "zstd_damaged": lambda: flipped(mcap(ZSTD), b"\x28\xb5\x2f\xfd", 9),
    "lz4_damaged": lambda: flipped(mcap(LZ4), b"\x04\x22\x4d\x18", 16),
    "cut_in_a_chunk": lambda: mcap()[:700],
    "seven_chunks_and_a_half": lambda: small(compress=True)[:900],
}


def flipped(data: bytes, mark: bytes, offset: int) -> bytes:
    """The same bytes with a few turned over after every mark."""
    out = bytearray(data)
    place = out.find(mark)
    while place >= 0:
        for k in range(place + offset, min(place + offset + 6, len(out))):
            out[k] ^= 0xA5
        place = out.find(mark, place + 1)
    return bytes(out)


def small(*, compress: bool) -> bytes:
    """A bag as the project writes it."""
    with tempfile.TemporaryDirectory() as folder:
        return small_bag(Path(folder) / "bag", compress=compress).read_bytes()


@cache
def metadata() -> str:
    """The metadata of a bag as the project writes it."""
    with tempfile.TemporaryDirectory() as folder:
        return (
            write_recording(Path(folder) / "bag", hand_made_run()) / "metadata.yaml"
        ).read_text()


def versioned(value: str) -> bytes:
    """The same of another version."""
    return metadata().replace("version: 9", f"version: {value}").encode()


def sqlite(*changes: str, cut: int | None = None) -> bytes:
    """A bag in SQLite with three vehicles' messages, changed by statements, or cut."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag.db3"
        with sqlite3.connect(path) as bag:
            columns = "name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT"
            bag.execute(f"CREATE TABLE topics(id INTEGER PRIMARY KEY, {columns})")
            columns = "topic_id INTEGER, timestamp INTEGER, data BLOB"
            bag.execute(f"CREATE TABLE messages(id INTEGER PRIMARY KEY, {columns})")
            topics = [(f"/vehicle_{k}/fix", "sensor_msgs/msg/NavSatFix") for k in range(3)]
            bag.executemany("INSERT INTO topics VALUES(NULL, ?, ?, 'cdr', '')", topics)
            rows = [(1 + k % 3, 10**8 * k, bytes(124)) for k in range(90)]
            bag.executemany("INSERT INTO messages VALUES(NULL, ?, ?, ?)", rows)
            for statement in changes:
                bag.execute(statement)
        bag.close()
        return path.read_bytes()[:cut]


SQLITE: dict[str, Make] = {
    "cut": lambda: sqlite(cut=6000),
    "a_type_of_bytes": lambda: sqlite("UPDATE topics SET type = x'ff00' WHERE id = 2"),
    "a_topic_of_none": lambda: sqlite("UPDATE messages SET topic_id = NULL"),
    "no_messages": lambda: sqlite("DROP TABLE messages"),
}


def csv(rows: pd.DataFrame) -> bytes:
    return rows.to_csv(index=False).encode()


def table(row: int, column: str, value: object, start: float = 1000.0) -> pd.DataFrame:
    """The crossing with one value changed."""
    rows = crossing(start=start).astype({column: object})
    rows.loc[row, column] = value
    return rows


def spmd(stamp: str) -> bytes:
    """Two cars' basic safety messages as the Safety Pilot kept them, one stamp replaced."""
    lines = [
        f"1,1,{car},{300_000_000_000_000 + 100_000 * k},{k},{k % 128},{100 * k % 60_000},{42.28 + 1e-4 * car},"
        f"{-83.74 + 1.21e-5 * k},250.1,10.0,90.0,0.1,0.0,9.8,0.01,3,0.0,100"
        for k in range(120)
        for car in (17, 18)
    ]
    fields = lines[101].split(",")
    lines[101] = ",".join([*fields[:3], stamp, *fields[4:]])
    return "\n".join(lines).encode()


def arrow(change: Callable[[pa.Table], pa.Table]) -> bytes:
    """The crossing in Parquet, changed."""
    out = BytesIO()
    parquet.write_table(change(pa.Table.from_pandas(crossing(), preserve_index=False)), out)
    return out.getvalue()


def stamps(values: pa.Array) -> Make:
    """The crossing in Parquet with other stamps."""
    return lambda: arrow(lambda rows: rows.set_column(0, "t_s", values))


ROWS = len(crossing())
NO_NUMBER = [None if k == 60 else k * 0.1 for k in range(ROWS)]
TABLES: dict[str, Make] = {
    "table/lines_without_ends.csv": lambda: b"\xef\xbb\xbf" + csv(crossing()).replace(b"\n", b""),
    "table/a_long_name.csv": lambda: csv(crossing()).replace(b"t_s", LONG.encode(), 1),
    "table/a_stamp_far_away.csv": lambda: csv(table(50, "t_s", 3e8)),
    "table_time_none.csv": lambda: csv(table(0, "vehicle_id", "%s%n").assign(t_s="none")),
    "spmd_grid_memoryerror_22GiB.csv": lambda: spmd("599999769000000"),
    "parquet/stamps_that_are_no_numbers.parquet": stamps(
        pa.array([float("nan")] * 3 + NO_NUMBER[3:], from_pandas=False)
    ),
    "parquet/a_stamp_far_away.parquet": stamps(
        pa.array([k * 0.1 for k in range(ROWS - 1)] + [3e8])
    ),
    "parquet/microseconds_beyond.parquet": stamps(
        pa.array([2**62] * ROWS).cast(pa.timestamp("us"))
    ),
    "parquet_nullable_boolean_time.parquet": stamps(pa.array([True] * ROWS)),
}


def zstd_bomb() -> bytes:
    """A bag of a few kilobytes whose only chunk holds a hundred megabytes, and says more."""
    messages = ((k, bytes(10_000_000)) for k in range(10))
    whole = mcap_bytes(messages, chunk_size=1 << 30, compression=ZSTD)
    return at_record(whole, CHUNK, 9 + 16, (2_500_000_000).to_bytes(8, "little"))


PARAMETERS = "/**:\n  ros__parameters:\n    log:\n      start: {}\n"
MAPS: dict[str, Make] = {
    **{
        f"map/{name}.yaml": lambda value=value: nav2("m.png", resolution=value)
        for name, value in YAML.items()
    },
    **{
        f"map/{name}.yaml": lambda picture=picture: nav2(picture)
        for name, (picture, _) in IMAGES.items()
    },
    **{f"map/{name}__{picture}": make for name, (picture, make) in IMAGES.items()},
    **{f"map/{name}__m.png": lambda: image("png") for name in YAML},
    "map/an_endless_cell__m.png": lambda: image("png"),
    "map/an_endless_cell.yaml": lambda: nav2("m.png", resolution=".inf"),
    "b2.png": lambda: bomb(20_000, 20_000),
    "bomb400M.yaml": lambda: nav2("b2.png"),
    "deep.yaml": lambda: b"a: " + b"[" * 20_000,
    "map_alias_bomb.yaml": lambda: ALIASES.encode() + nav2("m.png", origin="*a7"),
    "params_alias_bomb.yaml": (
        "/**:\n  ros__parameters:\n    " + ALIASES.replace("\n", "\n    ")
    ).encode,
}
FILES: dict[str, Make] = {
    **TABLES,
    **MAPS,
    **{f"meta/{name}.yaml": lambda value=value: versioned(value) for name, value in YAML.items()},
    **{
        f"params/{name}.yaml": lambda value=value: PARAMETERS.format(value).encode()
        for name, value in YAML.items()
    },
    "params/a_part_in_itself.yaml": lambda: b"/**:\n  ros__parameters:\n    a: &a {b: *a}\n",
    **{f"mcap_reader/{name}.mcap": make for name, make in MCAP.items()},
    **{f"sqlite/{name}.db3": make for name, make in SQLITE.items()},
    "reindex/a_name_twice.mcap": lambda: mcap()[:-8] + mcap()[8:],
    "reindex_huge_chunk.mcap": lambda: at_record(mcap(), CHUNK, 1, BEYOND)[:-60],
    "mcap_zstd_bomb.mcap": zstd_bomb,
}
"""Each file's name below the folder, and how it is made."""


def write(folder: Path) -> Path:
    """Write them all into a folder; return it."""
    for name, make in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(make())
    return folder
