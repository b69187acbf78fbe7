# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`find`: scenarios from a batch, or encounters from a corpus, that meet a condition in SQL.

The scenarios are copied from the batch's bags.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from scenario_gen.bags.recordings.write import add_message
from scenario_gen.bags.storage.messages import BagMessage
from scenario_gen.bags.storage.writer import atomic_bag
from scenario_gen.base.errors import InputError
from scenario_gen.corpus.conditions import GENERATED, matching, MAX_SECONDS_S, NAMES
from scenario_gen.corpus.parts import finished_tables
from scenario_gen.output.review.replan import recorded_scenarios

COLUMNS = (
    "template", "kind", "road", "vehicles", "index", "type", "seconds", "distance", "ttc", "pet",
    "speed", "braking",
)  # fmt: skip
# The columns of an encounter with the names of a scenario's columns.
RECORDED = (
    "name AS template, source AS recording, kind, 'recorded' AS road, count AS vehicles,"
    " NULL AS index, NULL AS type, seconds, distance, ttc, pet, speed, NULL AS braking, gap"
)
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
    batch: Path, condition: str = "true", limit: int = 0, seconds: float = MAX_SECONDS_S
) -> Hits:
    """Return the scenarios of a batch, or the encounters of a corpus, that meet a condition.

    The most critical ones come first.

    Args:
        batch: written by `run_batch`, finished or not; or a corpus written by `mine`.
        condition: SQL over the columns template, recording, kind, road, vehicles, index, seed,
            seconds [s], distance [m], ttc [s], pet [s], speed [m/s], braking [m/s²], type (of the
            most exposed road user), types (of all road users), outcome (of the decision), its
            probability and sha256. Encounters have no index, seed, braking, types, outcome,
            probability and sha256, but gap [m].
        limit: number of rows to return; 0: all.
        seconds: longest search.

    Raises:
        InputError: there is no batch, or the condition is invalid or takes too long.
    """
    with search(batch, condition, seconds) as (base, matches):
        ((count,),) = matches.aggregate("count(*)").fetchall()
        ordered = matches.limit(limit or count)
        rows = [dict(zip(ordered.columns, row, strict=True)) for row in ordered.fetchall()]
        coverage = base.execute(
            f"SELECT kind, road, {PET_CLASS_SQL} AS pet, count(*)"
            " FROM scenarios GROUP BY ALL ORDER BY ALL"
        ).fetchall()
    return Hits(rows, count, coverage)


@contextmanager
def search(
    batch: Path, condition: str, seconds: float = MAX_SECONDS_S
) -> Iterator[tuple[Any, Any]]:
    """Give DuckDB's view of all scenarios or encounters, and those that meet a condition.

    Arguments and errors as for `find`.
    """
    generated = finished_tables(batch, "scenarios")
    tables = generated or sorted((batch / "encounters").glob("*.parquet"))
    if not tables:
        command = f"scenario-gen batch DIR --roads … --out {batch}"
        raise InputError(f"{batch} holds no scenarios; write them with `{command}`")
    remedy = f"the columns are {NAMES}"
    if not generated:
        remedy += "; if the corpus is from an older version, mine it again"
    columns = GENERATED if generated else RECORDED
    with matching(
        tables, condition, columns=columns, source=batch, remedy=remedy, seconds=seconds
    ) as (base, matches):
        yield base, matches.order("pet NULLS LAST, ttc, template, road, index")


def coverage_lines(hits: Hits, batch: Path) -> list[str]:
    """Return the coverage in words: for each kind and road, the scenarios by PET class."""
    kinds = sorted({kind for kind, *_ in hits.coverage})
    tables = finished_tables(batch, "cases")
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


def export_hits(batch: Path, rows: Sequence[Mapping[str, Any]], folder: Path) -> None:
    """Write the scenarios of rows to a bag, each in a namespace with its template and road.

    Args:
        batch: written by `run_batch`, with bags.
        rows: from `find`.
        folder: of the bag.

    Raises:
        InputError: there are no rows, a scenario is in no bag, or `folder` is not a bag.
    """
    if not rows:
        raise InputError("no scenario matches; nothing exported; use a wider condition")
    with atomic_bag(folder) as bag:
        for k, messages in _messages(batch, rows):
            for message in messages:
                topic = message.topic.removeprefix(rows[k]["namespace"])
                add_message(bag, f"/hit_{k + 1}{topic}", message.data, message.stamp_ns)


def _messages(
    batch: Path, rows: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[int, tuple[BagMessage, ...]]]:
    """Yield number and messages of each row's scenario; each bag is read once."""
    by_part: dict[tuple[str, int], list[int]] = {}
    for k, row in enumerate(rows):
        if row["index"] is None:
            raise InputError(
                f"{batch} holds recordings; to get a bag, generate scenarios with"
                f" `scenario-gen batch {batch} --roads … --bags all`"
            )
        by_part.setdefault((row["road"], row["part"]), []).append(k)
    for (road, part), numbers in by_part.items():
        bag = batch / "bags" / f"road={road}" / f"part-{part:05}"
        if not bag.exists():
            raise InputError(
                f"{bag} does not exist; write bags with `scenario-gen batch … --bags all`, or "
                "--hits with this condition"
            )
        wanted = [(rows[k]["namespace"], rows[k]["index"]) for k in numbers]
        for k, (messages, sha256) in zip(numbers, recorded_scenarios(bag, wanted), strict=True):
            if sha256 != rows[k]["sha256"]:
                raise InputError(f"{bag}: scenario {rows[k]['index']} differs from the table")
            yield k, messages
