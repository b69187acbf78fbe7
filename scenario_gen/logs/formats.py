# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The formats of logs: how a file is recognised, and which reader it needs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from scenario_gen.base.errors import needs
from scenario_gen.base.registry import Registry
from scenario_gen.logs.adapters.data_sets import recognised
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import RawLog
from scenario_gen.logs.recognise import (
    is_bag,
    is_bsm,
    is_spmd,
    is_sumo,
    is_table,
    starts_with,
)

Predicate = Callable[[Path], bool]
Reader = Callable[[Sequence[Path], LogConfig], RawLog]


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


def _lazy_reader(module: str, extra: tuple[str, ...] = (), **options: Any) -> Reader:
    """Return a reader that imports its module when it is called: libraries take up to a second.

    Args:
        module: its function `read` is called.
        extra: the extra that installs the libraries, and their names.
        options: keyword arguments of `read`.
    """

    def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
        if extra:
            needs(*extra)
        log: RawLog = import_module(module).read(paths, config, **options)
        return log

    return read


def _data_set(name: str) -> LogFormat:
    return LogFormat(
        lambda path: is_table(path) and recognised(path) == name,
        _lazy_reader("scenario_gen.logs.adapters.tracks", name=name),
    )


LOG_FORMATS = Registry[LogFormat](
    "scenario_gen.logs",
    {
        "bag": LogFormat(
            is_bag,
            _lazy_reader("scenario_gen.logs.bag", ("bags", "lz4", "mcap", "rosbags", "zstandard")),
        ),
        "commonroad": LogFormat(
            lambda path: starts_with(path, b"<commonRoad", ".xml"),
            _lazy_reader("scenario_gen.logs.adapters.commonroad"),
        ),
        "bsm": LogFormat(is_bsm, _lazy_reader("scenario_gen.logs.adapters.bsm")),
        "fcd": LogFormat(is_sumo, _lazy_reader("scenario_gen.logs.adapters.fcd")),
        "nocturne": LogFormat(
            lambda path: starts_with(path, b'"objects"', ".json"),
            _lazy_reader("scenario_gen.logs.adapters.nocturne"),
        ),
        "spmd": LogFormat(is_spmd, _lazy_reader("scenario_gen.logs.tables")),
        "argoverse2": _data_set("argoverse2"),
        "interaction": _data_set("interaction"),
        "ind": _data_set("ind"),
        "highd": _data_set("highd"),
        "omega_prime": _data_set("omega_prime"),
        "table": LogFormat(is_table, _lazy_reader("scenario_gen.logs.tables")),
    },
    LogFormat,
)
"""All formats by name, tried in this order: the built-in ones, then those of plugins.

The order matters: an SPMD file has the suffix of a table.
"""


def is_log(path: Path) -> bool:
    """Return whether a file, or the folder of a bag, has any of the formats.

    Raises:
        InputError: a plugin cannot be loaded.
    """
    return any(log_format.accepts(path) for log_format in LOG_FORMATS.values())
