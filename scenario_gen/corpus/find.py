# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`find`: the scenarios of a batch, or the encounters of a corpus, as a database: a condition in SQL.

What it finds of a batch becomes a bag or a page, or is made again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from scenario_gen.bags.recordings.write import add_message
from scenario_gen.bags.storage.writer import atomic_bag
from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.base.stores import below, fetched, Place, workplace
from scenario_gen.corpus.messages import database, quoted
from scenario_gen.output.review.regenerate import regenerate_scenario, Regenerated

MEMORY = 500  # MiB
COLUMNS = (
    "template",
    "kind",
    "road",
    "vehicles",
    "index",
    "type",
    "seconds",
    "distance",
    "ttc",
    "pet",
    "speed",
    "braking",
)
UNITS = {
    "seconds": "s",
    "distance": "m",
    "ttc": "s",
    "pet": "s",
    "speed": "m/s",
    "braking": "m/s²",
}
RECORDED = (  # an encounter's columns, with the names of a scenario's
    "name AS template, kind, 'recorded' AS road, count AS vehicles, NULL AS index, NULL AS type, seconds, distance, "
    "ttc, pet, speed, NULL AS braking, gap"
)
PET = (0.0, 1.0, 2.0, 4.0)  # s: bounds of the classes of the table of coverage
CLASSES = (
    "CASE WHEN pet IS NULL THEN 'none' "
    + " ".join(f"WHEN pet < {b:g} THEN '< {b:g} s'" for b in PET)
    + " ELSE 'more' END"
)


@dataclass(frozen=True)
class Hits:
    """The rows found, and the coverage of the whole batch: kind, road and class of PET -> scenarios."""

    rows: list[dict[str, Any]]
    coverage: list[tuple[str, str, str, int]]


def find(batch: Place, condition: str = "true") -> Hits:
    """Return the scenarios of a batch, or the encounters of a corpus, for which a condition holds, the most critical first.

    Args:
        batch: that `run_batch` wrote, finished or not; or a corpus that `mine` wrote.
        condition: SQL over the columns template, kind, road, vehicles, index, seed, seconds [s], distance [m], ttc [s],
            pet [s], speed [m/s], braking [m/s²], type (of the most exposed road user), types (of all), sha256; of encounters
            also gap [m], without index, seed, braking, types and sha256.

    Raises:
        InputError: there is no batch, or the condition is none.
    """
    done = {below(table, batch / "cases") for table in (batch / "cases").rglob("*.parquet")}
    listed: list[Place] = sorted((batch / "scenarios").rglob("*.parquet"), key=str)
    generated = [table for table in listed if below(table, batch / "scenarios") in done]
    tables: list[Place] = generated or sorted((batch / "encounters").glob("*.parquet"), key=str)
    if not tables:
        raise InputError(
            f"{batch} holds no scenarios; write them with `scenario-gen batch DIR --roads … --out {batch}`"
        )
    columns = f"the columns are {', '.join(COLUMNS)}, types, seed, sha256{'' if generated else '; mine a corpus of before anew'}"
    what = f"{batch}: condition {condition!r}"
    with fetched(tables) as here, database(workplace(batch), MEMORY, what, columns) as base:
        base.execute(
            f"CREATE TABLE scenarios AS SELECT {'*' if generated else RECORDED} FROM "
            f"read_parquet([{quoted(list(map(str, here)))}], hive_partitioning=true, hive_types_autocast=false)"
        )
        base.execute("SET enable_external_access = false")  # a condition reads no files
        found = (
            base.table("scenarios")
            .filter(condition)
            .order("pet NULLS LAST, ttc, template, road, index")
        )  # one expression
        names = found.columns
        rows = [dict(zip(names, row, strict=True)) for row in found.fetchall()]
        counts = f"SELECT kind, road, {CLASSES} AS pet, count(*) FROM scenarios GROUP BY ALL ORDER BY ALL"
        coverage = base.execute(counts).fetchall()
    return Hits(rows, coverage)


def coverage_lines(hits: Hits, batch: Place) -> list[str]:
    """Return the coverage for people: of each kind on each road the scenarios by class of PET, without empty classes."""
    classes = [*(f"< {bound:g} s" for bound in PET), "more", "none"]
    kinds = sorted({kind for kind, *_ in hits.coverage})
    roads = {
        table.parent.name.partition("=")[2] for table in (batch / "cases").rglob("*.parquet")
    } or {"recorded"}
    cells = {(kind, road, pet): count for kind, road, pet, count in hits.coverage}
    lines = [
        f"coverage: {len(cells)} of {len(kinds) * len(roads) * len(classes)} cells of kind × road × PET hold a scenario"
    ]
    for kind, road in product(kinds, sorted(roads)):
        counts = ", ".join(
            f"{pet}: {cells[kind, road, pet]}" for pet in classes if (kind, road, pet) in cells
        )
        lines.append(f"  {kind} on {road}: {f'PET {counts}' if counts else 'no scenario'}")
    return lines


def bag_of(batch: Place, row: Mapping[str, Any]) -> Place:
    """Return the bag in which a row's scenario is."""
    return batch / "bags" / f"road={row['road']}" / f"part-{row['part']:05}"


def make_again(batch: Place, row: Mapping[str, Any]) -> Regenerated:
    """Make a scenario again, alone, from its template, road, parameters and seed; it has the SHA-256 of the table.

    Raises:
        InputError: the row is a recorded encounter's.
        ScenarioGenError: it comes out differently; the message names what differs.
    """
    if row["index"] is None:
        raise InputError(
            f"{batch} holds recordings; for a bag write scenarios with `scenario-gen batch {batch} --roads …`"
        )
    with fetched([bag_of(batch, row)]) as (bag,):
        result = regenerate_scenario(bag, row["index"], namespace=row["namespace"])
    if result.sha256 != row["sha256"]:
        raise ScenarioGenError(
            f"{bag_of(batch, row)}: scenario {row['index']} of {row['namespace']} is not that of the table"
        )
    return result


def export_hits(batch: Place, rows: Sequence[Mapping[str, Any]], folder: Path) -> Path:
    """Write the scenarios of rows to a bag, each made again, with its template and road, in a namespace; return its folder.

    Raises:
        InputError: there is no row, a bag is missing or damaged, or `folder` is something else.
    """
    if not rows:
        raise InputError(
            "no scenario meets the condition, so there is nothing to export; use a wider condition"
        )
    with atomic_bag(folder) as bag:
        for k, row in enumerate(rows):
            for message in make_again(batch, row).messages:
                own = message.topic.removeprefix(row["namespace"])
                add_message(bag, f"/hit_{k + 1}{own}", message.data, message.stamp_ns)
    return folder
