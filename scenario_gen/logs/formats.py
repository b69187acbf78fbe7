# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The formats of logs: how a file is recognised, and which reader it needs."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
import re
from typing import Any
import zlib

from scenario_gen.bags.storage.files import files_of
from scenario_gen.base.errors import InputError, needs
from scenario_gen.base.registry import Registry

HEAD_BYTES = 65_536
"""Part of a file in which the marks of its format are expected, from either end."""

_TABLE_SUFFIXES = (".csv", ".tsv", ".txt", ".parquet", ".pq")
_PACKED_SUFFIXES = (".gz", ".zip")
_MCAP_MAGIC = b"\x89MCAP0\r\n\x01"
_MCAP_PROFILE = slice(17, 25)  # after the magic, the header's opcode and its length
_ROS2_PROFILE = b"\x04\0\0\0ros2"
_J2735_MARKS = (b'"coredata"', b'"signalgroup"')
_OSI_MARKS = (b"net.asam.osi", b"osi3.", b"ground_truth")

Predicate = Callable[[Path], bool]
Reader = Callable[[Sequence[Path], Any], Any]
"""Reads a RawLog from files, given a LogConfig, which this module cannot import: it has the names
of the formats."""


@dataclass(frozen=True)
class LogFormat:
    """A format of logs.

    Attributes:
        accepts: whether a file, or the folder of a bag, has this format, judged by its name and
            its first bytes; it never fails on other files.
        read: returns the log in files that were accepted, or for which the parameter `format`
            names this format. It raises InputError with file and row where they cannot be read,
            and respects `size_limit`, `row_limit` and `vehicle_limit`.
    """

    accepts: Predicate
    read: Reader


def without_packing(path: Path) -> Path:
    """Return a path without the suffix .gz or .zip."""
    return path.with_suffix("") if is_packed(path) else path


def is_packed(path: Path) -> bool:
    """Return whether a name ends with .gz or .zip."""
    return path.suffix.lower() in _PACKED_SUFFIXES


def is_bag(path: Path) -> bool:
    """Return whether a path is the folder of a bag, or a single .mcap, .db3 or .bag file."""
    return bool(files_of(path).files)


def is_osi(path: Path) -> bool:
    """Return whether a file is a trace of ASAM OSI: MCAP of another profile, with OSI's names."""
    if path.suffix.lower() != ".mcap" or not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
        file.seek(max(path.stat().st_size - HEAD_BYTES, 0))
        tail = file.read(HEAD_BYTES)
    is_foreign_mcap = head.startswith(_MCAP_MAGIC) and head[_MCAP_PROFILE] != _ROS2_PROFILE
    return is_foreign_mcap and any(mark in head or mark in tail for mark in _OSI_MARKS)


def is_spmd(path: Path) -> bool:
    """Return whether half of a file's first lines have the 19 numbers of SPMD's messages.

    Its first line has no names, even if it is damaged.
    """
    if without_packing(path).suffix.lower() not in (".csv", ".txt"):
        return False
    lines = head_of(path).decode("utf-8-sig", errors="replace").splitlines()[:10]
    rows = [[field.strip(' "') for field in line.split(",")] for line in lines]
    n_messages = sum(len(row) == 19 and all(map(_is_number_or_empty, row)) for row in rows)
    return 0 < len(rows) <= 2 * n_messages and any(map(_is_number, rows[0]))


def is_sumo(path: Path) -> bool:
    """Return whether a file has SUMO's floating-car data, or the net or lights that go with it."""
    marks = (b"<fcd-export", b"<tlsStates", b"<net ")
    return path.suffix.lower() == ".xml" and any(mark in _head(path) for mark in marks)


def is_bsm(path: Path) -> bool:
    """Return whether a file has messages of J2735, in JSON or in a table made from it."""
    if path.suffix.lower() == ".csv":
        return b"coredata_position_lat" in _head(path).lower()
    is_json = path.suffix.lower() in (".json", ".jsonl", ".ndjson", ".txt")
    head = _head(path).lower()
    return is_json and any(mark in head for mark in _J2735_MARKS)


def is_nmea(path: Path) -> bool:
    """Return whether a file has NMEA's sentences RMC."""
    is_text = path.suffix.lower() in (".nmea", ".txt", ".log", ".csv")
    return is_text and re.search(rb"^\$[A-Z]{2}RMC,", _head(path), re.MULTILINE) is not None


def is_tum(path: Path) -> bool:
    """Return whether the lines of a text have a stamp, a position and a unit quaternion."""
    numbers = _first_numbers(path)
    return len(numbers) == 8 and _is_unit(numbers[4:])


def is_kitti(path: Path) -> bool:
    """Return whether the lines of a text have the 3 x 4 matrix of a pose."""
    numbers = _first_numbers(path)
    return len(numbers) == 12 and all(_is_unit(numbers[k : k + 3]) for k in (0, 4, 8))


def _is_unit(vector: Sequence[float]) -> bool:
    return abs(sum(part * part for part in vector) - 1.0) < 0.01


def _first_numbers(path: Path) -> list[float]:
    """Return the numbers of the first line of a text that is no comment; none of other files."""
    if path.suffix.lower() not in (".txt", ".tum", ".csv"):
        return []
    lines = _head(path).decode("ascii", errors="replace").splitlines()
    first = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    try:
        return [float(text) for text in first.split()]
    except ValueError:
        return []


def _refuse_kitti(paths: Sequence[Path], _: Any) -> Any:
    """Refuse poses without times.

    Raises:
        InputError: always; the message names a conversion.
    """
    raise InputError(
        f"{paths[0]}: poses of KITTI have no time and no common frame of several vehicles; join "
        "them with their times.txt to TUM's format in one frame with x east and y north (evo: "
        "kitti_poses_and_timestamps_to_trajectory.py)"
    )


def is_trajectory(path: Path) -> bool:
    """Return whether a name is that of a trajectory of one vehicle, possibly packed."""
    return without_packing(path).suffix.lower() in (".tum", ".gpx", ".nmea")


def is_table(path: Path) -> bool:
    """Return whether a name is that of a table, possibly packed."""
    return without_packing(path).suffix.lower() in _TABLE_SUFFIXES


def _starts_with(path: Path, mark: bytes, *suffixes: str) -> bool:
    """Return whether a file has one of these suffixes and the mark near its beginning."""
    return path.suffix.lower() in suffixes and mark in _head(path)


def _is_of_data_set(path: Path, name: str) -> bool:
    """Return whether a table has the header of a public data set."""
    if not is_table(path):
        return False
    tracks = import_module("scenario_gen.logs.adapters.tracks")  # pandas takes long to import
    return bool(tracks.recognised(path) == name)


def _is_number_or_empty(text: str) -> bool:
    return not text or _is_number(text)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def head_of(path: Path, size: int = HEAD_BYTES) -> bytes:
    """Return the first bytes of a file, unpacked if it is a .gz; none of a folder."""
    head = _head(path, size)
    if path.suffix.lower() == ".gz":
        with suppress(zlib.error):
            return zlib.decompressobj(wbits=31).decompress(head, size)
    return head


def _head(path: Path, size: int = HEAD_BYTES) -> bytes:
    """Return the first bytes of a file; none of a folder."""
    if not path.is_file():
        return b""
    with path.open("rb") as file:
        return file.read(size)


def _lazy_reader(module: str, extra: tuple[str, ...] = (), **options: Any) -> Reader:
    """Return a reader that imports its module when it is called: libraries take up to a second.

    Args:
        module: name below `scenario_gen.logs`; its function `read` is called.
        extra: the extra that installs the libraries, and their names.
        options: keyword arguments of `read`.
    """

    def read(paths: Sequence[Path], config: Any) -> Any:
        if extra:
            needs(*extra)
        return import_module(f"scenario_gen.logs.{module}").read(paths, config, **options)

    return read


def _data_set(name: str) -> LogFormat:
    return LogFormat(
        partial(_is_of_data_set, name=name), _lazy_reader("adapters.tracks", name=name)
    )


LOG_FORMATS = Registry[LogFormat](
    "scenario_gen.logs",
    {
        "osi": LogFormat(
            is_osi, _lazy_reader("adapters.osi", ("osi", "betterosi", "lz4", "mcap", "zstandard"))
        ),
        "bag": LogFormat(
            is_bag, _lazy_reader("bag", ("bags", "lz4", "mcap", "rosbags", "zstandard"))
        ),
        "commonroad": LogFormat(
            lambda path: _starts_with(path, b"<commonRoad", ".xml"),
            _lazy_reader("adapters.commonroad"),
        ),
        "openscenario": LogFormat(
            lambda path: _starts_with(path, b"<OpenSCENARIO", ".xosc", ".xml"),
            _lazy_reader("adapters.openscenario"),
        ),
        "bsm": LogFormat(is_bsm, _lazy_reader("adapters.bsm")),
        "fcd": LogFormat(is_sumo, _lazy_reader("adapters.fcd")),
        "nocturne": LogFormat(
            lambda path: _starts_with(path, b'"objects"', ".json"),
            _lazy_reader("adapters.nocturne"),
        ),
        "gpx": LogFormat(
            lambda path: _starts_with(path, b"<gpx", ".gpx", ".xml"),
            _lazy_reader("adapters.trajectories", kind="gpx"),
        ),
        "nmea": LogFormat(is_nmea, _lazy_reader("adapters.trajectories", kind="nmea")),
        "tum": LogFormat(is_tum, _lazy_reader("adapters.trajectories", kind="tum")),
        "kitti": LogFormat(is_kitti, _refuse_kitti),
        "spmd": LogFormat(is_spmd, _lazy_reader("tables")),
        "argoverse2": _data_set("argoverse2"),
        "interaction": _data_set("interaction"),
        "ind": _data_set("ind"),
        "highd": _data_set("highd"),
        "omega_prime": _data_set("omega_prime"),
        "table": LogFormat(is_table, _lazy_reader("tables")),
    },
    LogFormat,
)
"""All formats by name, tried in this order: the built-in ones, then those of plugins.

The order matters: an OSI trace has the suffix of a bag, and an SPMD file that of a table.
"""


def is_log(path: Path) -> bool:
    """Return whether a file, or the folder of a bag, has any of the formats.

    Raises:
        InputError: a plugin cannot be loaded.
    """
    return any(log_format.accepts(path) for log_format in LOG_FORMATS.values())
