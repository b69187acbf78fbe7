# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Conditions in SQL over tables; a condition can neither read nor write other files."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import gettempdir
from threading import Timer
from typing import Any

from scenario_gen.base.errors import InputError
from scenario_gen.corpus.messages import database, pattern_of, quoted, tables

MAX_SECONDS_S = 60.0  # of one search
NAMES = (
    "template, recording, kind, road, vehicles, index, type, seconds, distance, ttc, pet, speed,"
    " braking, types, seed, sha256, outcome, probability"
)
# The columns of a batch; a road is the name of the folder `road=NAME`.
GENERATED = "* EXCLUDE filename, parse_filename(parse_dirpath(filename))[6:] AS road"


@contextmanager
def matching(
    paths: Sequence[Path],
    condition: str,
    *,
    columns: str = GENERATED,
    source: object = "hits",
    remedy: str = f"the columns are {NAMES}",
    seconds: float = MAX_SECONDS_S,
) -> Iterator[tuple[Any, Any]]:
    """Give a database with the view `scenarios`, and its rows that meet a condition.

    Args:
        paths: tables.
        condition: SQL over the columns.
        columns: of the view, in SQL.
        source: names the tables in messages.
        remedy: the end of messages.
        seconds: longest search.

    Raises:
        InputError: the condition is invalid or takes too long.
    """
    task = f"{source}: condition {condition!r}"
    names = [str(path.absolute()) for path in paths]
    files = quoted([*names, *map(pattern_of, names)])
    with database(Path(gettempdir()), 400, task, remedy) as base, _time_limit(base, seconds, task):
        base.execute(
            f"CREATE VIEW scenarios AS SELECT {columns} FROM {tables(paths, ', filename = true')}"
        )
        base.execute(f"SET allowed_paths = [{files}]")
        base.execute("SET max_temp_directory_size = '4GiB'")
        base.execute("SET enable_external_access = false")  # a condition must not read files
        base.execute("SET lock_configuration = true")
        # `filter` accepts one expression, not a second statement.
        yield base, base.view("scenarios").filter(condition)


@contextmanager
def _time_limit(base: Any, seconds: float, task: str) -> Iterator[None]:
    """Interrupt a database that takes too long.

    Raises:
        InputError: it does.
    """
    from duckdb import InterruptException

    timer = Timer(seconds, base.interrupt)
    timer.daemon = True
    timer.start()
    try:
        yield
    except InterruptException as error:
        raise InputError(
            f"{task} takes more than {seconds:g} s and is stopped; simplify the condition"
        ) from error
    finally:
        timer.cancel()
