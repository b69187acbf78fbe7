# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`batch`: templates × roads × scenarios, in parts that are files (`parts.py`).

A batch grows: further templates, roads and scenarios cost only what is not there yet.
"""

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
import json
from pathlib import Path
from typing import Any

from scenario_gen.base.errors import InputError, needs, RefusedError
from scenario_gen.base.folders import write_text
from scenario_gen.base.provenance import parameter_texts
from scenario_gen.corpus.encounters import encounter_of, tables_of, write_encounters
from scenario_gen.corpus.parts import (
    BatchRequest,
    finished_tables,
    generate_part,
    part_tasks,
    STEP_COUNT,
)
from scenario_gen.corpus.tables import rows_of
from scenario_gen.corpus.tasks import agree, arriving, check_out, held, spread, Workers
from scenario_gen.roads import build_road

BAGS = ("none", "hits", "all")
MANIFEST = "batch.json"
IDENTITY = ("name", "source", "start_ns", "seconds", "gap", "distance", "speed")


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
    tables = tables_of(corpus)
    row = next(rows_of(tables), None)
    if row is None:
        raise InputError(f"{corpus} holds no encounter")
    first = encounter_of(row, corpus)
    # An unknown road ends the batch; a road that does not fit one encounter does not.
    for road in roads:
        with suppress(RefusedError):
            build_road(road, first, request.config.road)
    with held(out), spread(workers) as run:
        manifest = _grow(out, roads, request)
        _add_templates(out, tables, templates, request.count)
        used = {token: road for token, road in manifest["roads"].items() if road in roads}
        tasks = part_tasks(out, used, manifest["counts"], request)
        failed = run(generate_part, [task for task in tasks if not task.target.exists()])
        return summary(out, failed)


def _grow(out: Path, roads: Sequence[str], request: BatchRequest) -> dict[str, Any]:
    """Return the manifest with these roads and this number of scenarios, and write it.

    Raises:
        InputError: the batch has another seed, other parameters or more scenarios.
    """
    document = {
        "format": 4,
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
        with arriving(out / MANIFEST) as part:
            write_text(part, json.dumps(grown, indent=1) + "\n")
    return grown


def _add_templates(out: Path, corpus: Sequence[Path], limit: int, count: int) -> None:
    """Add the encounters of a corpus that a batch lacks, as tables of their own.

    A table has the templates of a part: at least 10, of a large corpus as many as have 2,000
    scenarios. Existing tables do not change.

    Args:
        out: the batch.
        corpus: its tables.
        limit: number of encounters, the first ones; 0: all.
        count: of the scenarios of each.
    """
    from pyarrow import parquet

    size = sum(parquet.read_metadata(table).num_rows for table in corpus)
    size = max(10, min((limit or size) // 50, 2000 // count))
    tables = sorted((out / "templates").glob("part-*.parquet"))
    known = {tuple(row.values()) for row in rows_of(tables, IDENTITY)}
    lacking = (
        row
        for row in islice(rows_of(corpus), limit or None)
        if tuple(row[name] for name in IDENTITY) not in known
    )
    while rows := list(islice(lacking, size)):
        table = out / "templates" / f"part-{len(tables):05}.parquet"
        write_encounters(table, rows)
        tables.append(table)


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
