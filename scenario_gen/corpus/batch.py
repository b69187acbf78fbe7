# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`batch`: templates × roads × scenarios, in parts (`parts.py`) that are files (`store.py`).

A batch grows: further templates, roads and scenarios cost only what is not there yet.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby
import json
from pathlib import Path
from typing import Any

from scenario_gen.base.errors import InputError, needs, RefusedError
from scenario_gen.base.provenance import parameter_texts
from scenario_gen.corpus.encounters import encounter_of, tables_of, write_encounters
from scenario_gen.corpus.parts import (
    BatchRequest,
    generate_part,
    part_tasks,
    STEP_COUNT,
)
from scenario_gen.corpus.store import finished_parts, finished_tables, MANIFEST, write_json
from scenario_gen.corpus.tables import rows_at, rows_of
from scenario_gen.corpus.tasks import agree, check_out, held, spread, Workers
from scenario_gen.roads import build_road

BAGS = ("none", "hits", "all")
TABLE_TEMPLATE_COUNT = 500
IDENTITY = ("name", "source", "start_ns", "seconds", "gap", "distance", "speed")
SCHEMA = {
    "type": "object",
    "required": ["seed", "parameters", "roads", "counts"],
    "properties": {"format": {"const": 3}},
}
Row = tuple[Path, int]
"""A row of a table, by its number."""


@dataclass(frozen=True)
class Batch:
    """The figures of a batch.

    Attributes:
        cases: number of pairs of template and road.
        scenarios: number of all scenarios.
        requested: number of scenarios requested.
        failures: cases without any scenario, by cause.
        refused: candidates refused, by cause.
        outcomes: scenarios by the outcome of the decision, if decisions were drawn.
        shortened: sets from a shortened recording.
        failed: messages of the tasks that failed.
    """

    cases: int
    scenarios: int
    requested: int
    failures: dict[str, int]
    refused: dict[str, int]
    outcomes: dict[str, int]
    shortened: int
    failed: list[str]

    def lines(self) -> list[str]:
        """Return the summary in words."""
        lines = [
            f"{self.scenarios} of {self.requested} scenarios"
            f" from {self.cases} cases (encounter and road)"
        ]
        for outcome, count in Counter(self.outcomes).most_common():
            lines.append(f"{count} scenarios with the outcome: {outcome}")
        if self.shortened:
            lines.append(
                f"{self.shortened} sets from a recording shortened to fit the road "
                "(column shortened of cases/)"
            )
        for cause, count in Counter(self.failures).most_common():
            lines.append(f"{count} cases without any: {cause}")
        for cause, count in Counter(self.refused).most_common():
            lines.append(f"{count} candidates refused: {cause}")
        return lines + self.failed


def run_batch(
    corpus: Path,
    roads: Sequence[str],
    out: Path,
    request: BatchRequest = BatchRequest(),
    *,
    templates: int = 0,
    workers: Workers = Workers(),
) -> Batch:
    """Generate scenarios from all templates of a corpus on all roads.

    Args:
        corpus: written by `mine`.
        roads: names or paths, as for `build_road`.
        out: folder of the results. An existing batch with the same seed and parameters is
            continued: templates, roads and scenarios that it lacks are added.
        request: the scenarios to generate from each template on each road.
        templates: number of templates, the first ones of the corpus; 0 uses all.
        workers: the processes.

    Raises:
        InputError: the corpus has no encounters, a road is unknown, or `out` has other content.
    """
    needs("corpus", "duckdb", "pyarrow")
    check_out(out, [corpus])
    if request.bags not in BAGS or (request.bags == "hits") != bool(request.hits):
        raise InputError(
            f"bags {request.bags!r}, hits {request.hits!r}: give bags none or all, or"
            " hits with a condition"
        )
    chosen = _rows(tables_of(corpus))[: templates or None]
    if not chosen:
        raise InputError(f"{corpus} holds no encounter")
    table, number = chosen[0][0]
    first = encounter_of(rows_at(table, [number])[0], table)
    # An unknown road ends the batch; a road that does not fit one encounter does not.
    for road in roads:
        with suppress(RefusedError):
            build_road(road, first, request.config.road)
    with held(out), spread(workers) as run:
        manifest = _grow(out, roads, request)
        _add_templates(out, chosen)
        used = {token: road for token, road in manifest["roads"].items() if road in roads}
        finished = finished_parts(out)
        tasks = [
            task
            for task in part_tasks(out, used, manifest["counts"], request)
            if task.number not in finished.get(f"road={task.token}", ())
        ]
        failed = run(generate_part, tasks)
        return summary(out, failed)


def _grow(out: Path, roads: Sequence[str], request: BatchRequest) -> dict[str, Any]:
    """Return the manifest with these roads and this number of scenarios, and write it.

    Raises:
        InputError: the batch has another seed, other parameters or more scenarios.
    """
    document = {
        "format": 3,
        "seed": request.seed,
        "parameters": parameter_texts(request.config),
    }
    manifest = agree(out, MANIFEST, document, "batch")
    tokens: dict[str, str] = dict(manifest.get("roads", {}))
    for road in dict.fromkeys(roads):
        stem = token = "".join(c if c.isalnum() else "_" for c in Path(road).stem)
        while tokens.get(token, road) != road:
            token = f"{stem}_{len(tokens)}"
        tokens[token] = road
    counts = list(manifest.get("counts", []))
    if counts and counts[-1] > request.count:
        raise InputError(
            f"{out} is a batch with other count: it has {counts[-1]} scenarios per template and"
            f" road, and {request.count} are requested; it can only grow"
        )
    counts = sorted({*counts, request.count})
    grown = manifest | {"roads": tokens, "counts": counts}
    if grown != manifest:
        write_json(out / MANIFEST, grown)
    return grown


def _rows(tables: Sequence[Path]) -> list[tuple[Row, tuple[Any, ...]]]:
    """Return all rows of encounters in tables, with their identities."""
    return [
        ((table, number), tuple(row[name] for name in IDENTITY))
        for table in tables
        for number, row in enumerate(rows_of([table], IDENTITY))
    ]


def _templates(out: Path) -> list[Path]:
    return sorted((out / "templates").glob("*.parquet"))


def _read(rows: Sequence[Row]) -> Iterator[tuple[dict[str, Any], Path]]:
    """Yield the contents of rows and their tables; a table is opened once for its rows."""
    for table, group in groupby(rows, key=lambda row: row[0]):
        for content in rows_at(table, [number for _, number in group]):
            yield content, table


def _add_templates(out: Path, chosen: Sequence[tuple[Row, tuple[Any, ...]]]) -> None:
    """Add encounters that a batch lacks, as tables of their own.

    Its parts are numbered by these tables, so existing ones do not change.
    """
    tables = _templates(out)
    known = {identity for _, identity in _rows(tables)}
    lacking = [row for row, identity in chosen if identity not in known]
    for k in range(0, len(lacking), TABLE_TEMPLATE_COUNT):
        rows = [row for row, _ in _read(lacking[k : k + TABLE_TEMPLATE_COUNT])]
        number = len(tables) + k // TABLE_TEMPLATE_COUNT
        write_encounters(out / "templates" / f"templates-{number:05}.parquet", rows, {})


def summary(out: Path, failed: list[str]) -> Batch:
    """Return the figures of the finished parts."""
    figures: Counter[str] = Counter()
    failures: Counter[str] = Counter()
    refused: Counter[str] = Counter()
    outcomes: Counter[str] = Counter()
    for table in finished_tables(out, "cases"):
        pairs = set()
        for case in rows_of([table]):
            figures.update({name: case[name] for name in ("published", "wanted")})
            refused.update(json.loads(case["refused"]))
            failures[case["cause"]] += not case["published"]
            outcomes[case["outcome"]] += case["published"]
            figures["shortened"] += bool(case.get("shortened"))
            if case["part"] < STEP_COUNT:
                pairs.add((case["part"], case["template"], case["seed"]))
        figures["cases"] += len(pairs)
    del outcomes[""]  # of sets without a decision
    return Batch(
        figures["cases"],
        figures["published"],
        figures["wanted"],
        dict(+failures),
        dict(refused),
        dict(+outcomes),
        figures["shortened"],
        failed,
    )
