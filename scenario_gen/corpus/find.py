# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`find`: scenarios from a batch, or encounters from a corpus, that meet a condition in SQL.

The scenarios are copied to a bag or shown on a page, or generated again.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from threading import Timer
from typing import Any

from scenario_gen.bags.recordings.write import add_message
from scenario_gen.bags.storage.bag import BagMessage
from scenario_gen.bags.storage.writer import atomic_bag
from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.base.stores import fetched, Place, relative_name, workplace
from scenario_gen.corpus.messages import database, quoted
from scenario_gen.output.review.regenerate import (
    recorded_scenarios,
    regenerate_scenario,
    Regenerated,
)

COLUMNS = (
    "template", "kind", "road", "vehicles", "index", "type", "seconds", "distance", "ttc", "pet",
    "speed", "braking",
)  # fmt: skip
UNITS = {
    "seconds": "s",
    "distance": "m",
    "ttc": "s",
    "pet": "s",
    "speed": "m/s",
    "braking": "m/s²",
}
# The columns of an encounter with the names of a scenario's columns.
RECORDED = (
    "name AS template, kind, 'recorded' AS road, count AS vehicles, NULL AS index,"
    " NULL AS type, seconds, distance, ttc, pet, speed, NULL AS braking, gap"
)
MAX_SECONDS_S = 60.0  # of one search
PET_BOUNDS_S = (0.0, 1.0, 2.0, 4.0)  # bounds of the PET classes in the coverage table
PET_CLASSES = (*(f"< {bound:g} s" for bound in PET_BOUNDS_S), "more", "none")
PET_CLASS_SQL = (
    "CASE WHEN pet IS NULL THEN 'none' "
    + " ".join(f"WHEN pet < {bound:g} THEN '< {bound:g} s'" for bound in PET_BOUNDS_S)
    + " ELSE 'more' END"
)


@dataclass(frozen=True)
class Hits:
    """The result of a search.

    Attributes:
        rows: the first scenarios or encounters that meet the condition.
        count: number of all that meet it.
        coverage: (kind, road, PET class, number of scenarios) for the whole batch.
    """

    rows: list[dict[str, Any]]
    count: int
    coverage: list[tuple[str, str, str, int]]


def find(
    batch: Place, condition: str = "true", limit: int = 0, seconds: float = MAX_SECONDS_S
) -> Hits:
    """Return the scenarios of a batch, or the encounters of a corpus, that meet a condition.

    The most critical ones come first.

    Args:
        batch: written by `run_batch`, finished or not; or a corpus written by `mine`.
        condition: SQL over the columns template, kind, road, vehicles, index, seed, seconds [s],
            distance [m], ttc [s], pet [s], speed [m/s], braking [m/s²], type (of the most exposed
            road user), types (of all road users), outcome (of the decision), its probability and
            sha256. Encounters have no index, seed, braking, types, outcome, probability and
            sha256, but gap [m].
        limit: number of rows to return; 0: all.
        seconds: longest search.

    Raises:
        InputError: there is no batch, or the condition is invalid or takes too long.
    """
    finished = {
        relative_name(table, batch / "cases") for table in (batch / "cases").rglob("*.parquet")
    }
    scenarios: list[Place] = sorted((batch / "scenarios").rglob("*.parquet"), key=str)
    generated = [
        table for table in scenarios if relative_name(table, batch / "scenarios") in finished
    ]
    tables: list[Place] = generated or sorted((batch / "encounters").glob("*.parquet"), key=str)
    if not tables:
        command = f"scenario-gen batch DIR --roads … --out {batch}"
        raise InputError(f"{batch} holds no scenarios; write them with `{command}`")
    remedy = f"the columns are {', '.join(COLUMNS)}, types, seed, sha256, outcome, probability"
    if not generated:
        remedy += "; if the corpus is from an older version, mine it again"
    task = f"{batch}: condition {condition!r}"
    with (
        fetched(tables) as paths,
        database(workplace(batch), 400, task, remedy) as base,
        _time_limit(base, seconds, task),
    ):
        base.execute(
            f"CREATE VIEW scenarios AS SELECT {'*' if generated else RECORDED}"
            f" FROM read_parquet([{quoted([str(path) for path in paths])}],"
            " hive_partitioning=true, hive_types_autocast=false)"
        )
        base.execute(f"SET allowed_paths = [{quoted([str(path) for path in paths])}]")
        base.execute("SET max_temp_directory_size = '4GiB'")
        base.execute("SET enable_external_access = false")  # a condition must not read files
        base.execute("SET lock_configuration = true")
        # `filter` accepts one expression, not a second statement.
        matches = base.view("scenarios").filter(condition)
        ((count,),) = matches.aggregate("count(*)").fetchall()
        ordered = matches.order("pet NULLS LAST, ttc, template, road, index")
        ordered = ordered.limit(limit or count)
        rows = [dict(zip(ordered.columns, row, strict=True)) for row in ordered.fetchall()]
        coverage = base.execute(
            f"SELECT kind, road, {PET_CLASS_SQL} AS pet, count(*)"
            " FROM scenarios GROUP BY ALL ORDER BY ALL"
        ).fetchall()
    return Hits(rows, count, coverage)


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


def coverage_lines(hits: Hits, batch: Place) -> list[str]:
    """Return the coverage in words: for each kind and road, the scenarios by PET class."""
    kinds = sorted({kind for kind, *_ in hits.coverage})
    tables = (batch / "cases").rglob("*.parquet")
    roads = sorted({table.parent.name.partition("=")[2] for table in tables}) or ["recorded"]
    cells = {(kind, road, pet): count for kind, road, pet, count in hits.coverage}
    size = len(kinds) * len(roads) * len(PET_CLASSES)
    lines = [f"coverage: {len(cells)} of {size} cells of kind × road × PET hold a scenario"]
    for kind, road in product(kinds, roads):
        counts = [
            f"{pet}: {cells[kind, road, pet]}" for pet in PET_CLASSES if (kind, road, pet) in cells
        ]
        text = f"PET {', '.join(counts)}" if counts else "no scenario"
        lines.append(f"  {kind} on {road}: {text}")
    return lines


def bag_of(batch: Place, row: Mapping[str, Any]) -> Place:
    """Return the bag with a row's scenario.

    Raises:
        InputError: the row is a recorded encounter.
    """
    if row["index"] is None:
        raise InputError(
            f"{batch} holds recordings; to get a bag, generate scenarios with"
            f" `scenario-gen batch {batch} --roads …`"
        )
    return batch / "bags" / f"road={row['road']}" / f"part-{row['part']:05}"


def make_again(batch: Place, row: Mapping[str, Any]) -> Regenerated:
    """Generate one scenario again from its template, road, parameters and seed.

    Raises:
        InputError: the row is a recorded encounter.
        ScenarioGenError: the SHA-256 differs from the one in the table.
    """
    bag = bag_of(batch, row)
    with fetched([bag]) as (path,):
        result = regenerate_scenario(path, row["index"], namespace=row["namespace"])
    _check_same(bag, row, result.sha256)
    return result


def _check_same(bag: Place, row: Mapping[str, Any], sha256: str) -> None:
    """Check that a row's scenario is that of its bag.

    Raises:
        ScenarioGenError: the SHA-256 differs from the one in the table.
    """
    if sha256 != row["sha256"]:
        raise ScenarioGenError(
            f"{bag}: scenario {row['index']} of {row['namespace']} differs from that in the table"
        )


def export_hits(batch: Place, rows: Sequence[Mapping[str, Any]], folder: Path) -> Path:
    """Copy the scenarios of rows to a bag; return its folder.

    Each scenario has a namespace with its template and road.

    Raises:
        InputError: there are no rows, a bag is missing or damaged, or `folder` is not a bag.
    """
    if not rows:
        raise InputError("no scenario matches; nothing exported; use a wider condition")
    with atomic_bag(folder) as bag:
        for k, messages in _copies(batch, rows):
            for message in messages:
                topic = message.topic.removeprefix(rows[k]["namespace"])
                add_message(bag, f"/hit_{k + 1}{topic}", message.data, message.stamp_ns)
    return folder


def _copies(
    batch: Place, rows: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[int, Sequence[BagMessage]]]:
    """Yield the numbers of rows and the messages of their scenarios; each bag is read once."""
    by_bag: dict[Place, list[int]] = {}
    for k, row in enumerate(rows):
        by_bag.setdefault(bag_of(batch, row), []).append(k)
    for source, hits in by_bag.items():
        wanted = [(rows[k]["namespace"], rows[k]["index"]) for k in hits]
        with fetched([source]) as (path,):
            for k, (messages, sha256) in zip(hits, recorded_scenarios(path, wanted), strict=True):
                _check_same(source, rows[k], sha256)
                yield k, messages
