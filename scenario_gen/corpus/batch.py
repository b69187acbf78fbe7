# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`batch`: templates × roads × samples. A task generates all scenarios of ten templates on one road, and writes three files.

    bags/road=NAME/part-00000/              a bag as `generate` writes it, a namespace for each template
    scenarios/road=NAME/part-00000.parquet  a row for each scenario: where it is, and how critical
    cases/road=NAME/part-00000.parquet      a row for each template: how many there are, and why not more

The table of cases is written last, so a part is done where that table is; no other record of progress is kept.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from itertools import groupby
import json
from pathlib import Path
import re
from textwrap import shorten
from typing import Any

from scenario_gen.bags.recordings.write import add_results, scenario_bytes
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import InputError, needs, RefusedError
from scenario_gen.base.folders import sha256_of
from scenario_gen.base.provenance import parameter_texts, versions
from scenario_gen.base.stores import each_fetched, Place
from scenario_gen.corpus.encounters import encounter_of, tables_of
from scenario_gen.corpus.tables import rows_at, rows_of, write_table
from scenario_gen.corpus.tasks import agree, arriving, check_out, held, spread, undone, Workers
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import criticality
from scenario_gen.method.fitting import LostEncounterError
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import build_road, road_and_template
from scenario_gen.situation import Situation
from scenario_gen.types import GenerationResult, most_exposed

BATCH = "batch.json"
TEMPLATES = 10  # of one task
LONGEST_CAUSE = 80  # characters under which refusals are counted
LOST_CONFLICT = (
    "lost conflict"  # the cause of every case whose encounter is lost, whatever the road
)


@dataclass(frozen=True)
class BatchRequest:
    """What is generated from each template on each road.

    Attributes:
        config: of the pipeline.
        count: scenarios of each template on each road.
        seed: of all; each case has its own seed, which follows from this one, its template's name and its road.
    """

    config: PipelineConfig = PipelineConfig()
    count: int = 50
    seed: int = 0


@dataclass(frozen=True)
class PartTask:
    """Templates (table, row) to place on a road, and where the three files go: `out`/…/road=`token`/part-`number`."""

    templates: tuple[tuple[Place, int], ...]
    road: str
    token: str
    number: int
    out: Place
    request: BatchRequest

    @property
    def name(self) -> str:
        """The task in messages."""
        return f"part {self.number} on {self.token}"

    @property
    def target(self) -> Place:
        """The table of cases, which is written last."""
        return self.file("cases")

    def file(self, what: str, ending: str = ".parquet") -> Place:
        """Return where one of the three goes."""
        return self.out / what / f"road={self.token}" / f"part-{self.number:05}{ending}"


@dataclass(frozen=True)
class Batch:
    """The figures of a batch.

    Attributes:
        cases: number of pairs of template and road.
        scenarios: number of all scenarios.
        requested: number of scenarios requested.
        failures: cases without any scenario, by cause.
        refused: candidates refused, by cause.
        failed: messages of the tasks that failed.
    """

    cases: int
    scenarios: int
    requested: int
    failures: dict[str, int]
    refused: dict[str, int]
    failed: list[str]

    def lines(self) -> list[str]:
        """Return the summary for people."""
        lines = [
            f"{self.scenarios} of {self.requested} scenarios of {self.cases} cases (encounter and road)"
        ]
        lines += [
            f"{count} cases without any: {cause}"
            for cause, count in Counter(self.failures).most_common()
        ]
        lines += [
            f"{count} candidates refused: {cause}"
            for cause, count in Counter(self.refused).most_common()
        ]
        return lines + self.failed


def run_batch(
    corpus: Place,
    roads: Sequence[str],
    out: Place,
    request: BatchRequest = BatchRequest(),
    *,
    templates: int = 0,
    workers: Workers = Workers(),
) -> Batch:
    """Generate scenarios of all templates of a corpus on all roads.

    Args:
        corpus: that `mine` wrote.
        roads: names or paths, as `build_road` takes them.
        out: of the tables and bags; an unfinished batch of the same corpus, roads and parameters is continued.
        request: what is generated from each template on each road.
        templates: the first so many of the corpus; 0 takes all.
        workers: who does it.

    Raises:
        InputError: the corpus has no encounters, a road is none, or `out` is of something else.
    """
    needs("corpus", "duckdb", "pyarrow")
    check_out(out, [corpus])
    tables = tables_of(corpus)
    rows: list[tuple[Place, int]] = []
    hashes = []
    for table, here in each_fetched(tables):
        rows += [(table, k) for k, _ in enumerate(rows_of([here], ["name"]))]
        hashes.append(sha256_of(here))
    rows = rows[: templates or None]
    if not rows:
        raise InputError(f"{corpus} holds no encounter")
    first = next(encounter_of(row, table) for row, table in _rows(rows[:1]))
    for road in roads:  # an unknown name ends the batch; it is no cause of single cases
        with suppress(RefusedError):
            build_road(road, first, request.config.road)
    document = {
        "format": 1,
        "corpus": hashes,
        "roads": list(roads),
        "count": request.count,
        "seed": request.seed,
        "templates": len(rows),
        "parameters": parameter_texts(request.config),
    }
    with held(out), spread(workers) as go:
        agree(out, BATCH, document, "batch")
        return summary(out, go(generate_part, undone(parts(rows, roads, out, request))))


def parts(
    rows: Sequence[tuple[Place, int]], roads: Sequence[str], out: Place, request: BatchRequest
) -> list[PartTask]:
    """Return the tasks: ten templates on one road each, whatever the number of workers."""
    tokens = tokens_of(roads)
    return [
        PartTask(tuple(templates), road, token, number, out, request)
        for number, templates in enumerate(
            rows[k : k + TEMPLATES] for k in range(0, len(rows), TEMPLATES)
        )
        for road, token in zip(roads, tokens, strict=True)
    ]


def tokens_of(roads: Sequence[str]) -> list[str]:
    """Return a name for each road that a folder can bear, no two the same."""
    stems = ["".join(c if c.isalnum() else "_" for c in Path(road).stem) for road in roads]
    return [stem if stems.count(stem) == 1 else f"{stem}_{k}" for k, stem in enumerate(stems)]


def seed_of(seed: int, template: str, road: str) -> int:
    """Return a case's own seed, below 2^32: of all randomness of one template on one road."""
    return int.from_bytes(sha256(f"{seed}\n{template}\n{road}".encode()).digest()[:4], "big")


def generate_part(task: PartTask) -> None:
    """Generate a part's scenarios and write its bag and its two tables.

    Raises:
        OSError: the disk is full, or fails.
    """
    cases, scenarios, results = [], [], dict[str, GenerationResult]()
    for k, (row, table) in enumerate(_rows(task.templates)):
        case, result = _generate_case(row, table, f"/case_{k}", task)
        cases.append(case)
        if result is not None and len(result.generated.scenarios):
            results[f"/case_{k}"] = result
            scenarios += _scenario_rows(case, result, task)
    if results:
        with arriving(task.file("bags", "")) as part, BagWriter(part) as bag:
            add_results(bag, results)
    write_table(task.file("scenarios"), scenarios, SCENARIO_COLUMNS)
    write_table(task.target, cases, CASE_COLUMNS)


def _rows(templates: Sequence[tuple[Place, int]]) -> Iterator[tuple[dict[str, Any], Place]]:
    """Yield the rows (table, number) of encounters, each with its table; a table is opened once for those that follow."""
    for table, own in groupby(templates, key=lambda template: template[0]):
        yield from ((row, table) for row in rows_at(table, [number for _, number in own]))


def _generate_case(
    row: Mapping[str, Any], table: Place, namespace: str, task: PartTask
) -> tuple[dict[str, Any], GenerationResult | None]:
    """Generate one template's scenarios; a refusal is a case without any, with the reason."""
    request, seed = task.request, seed_of(task.request.seed, row["name"], task.road)
    case = {
        "template": row["name"], "kind": row["kind"], "vehicles": row["count"], "namespace": namespace, "seed": seed,
        "wanted": request.count, "published": 0, "candidates": 0, "refused": "{}", "cause": "", "why": "", "part": task.number,
        "changepoints": 0,
    }  # fmt: skip
    try:
        encounter = encounter_of(row, table)
        road, encounter = road_and_template(task.road, encounter, request.config.road)
        segmentation = segment(encounter, request.config.segmentation, seed)
        result = Chain(
            Situation.of(encounter),
            segmentation,
            road,
            request.config,
            count=request.count,
            seed=seed,
        ).run()
    except (RefusedError, InputError) as error:
        message = LOST_CONFLICT if isinstance(error, LostEncounterError) else str(error)
        cause = message if isinstance(error, RefusedError) else "input"
        return case | {"cause": _cause(cause), "why": str(error)}, None
    generated = result.generated
    facts = {
        "template": row["name"],
        "roads": task.road,
        "seed": str(seed),
        "count": str(request.count),
    }
    provenance = facts | versions() | parameter_texts(request.config)
    finished = case | {
        "published": len(generated.scenarios),
        "candidates": generated.candidates,
        "refused": json.dumps(
            {str(cause): number for cause, number in sorted(generated.refused.items()) if number}
        ),
        "changepoints": len(segmentation.changepoints),
        "cause": "" if len(generated.scenarios) else "no valid candidate",
    }
    return finished, GenerationResult(
        encounter,
        segmentation,
        road,
        result.fit,
        result.routes,
        generated,
        seed,
        provenance=provenance,
    )


def _cause(text: str) -> str:
    """A reason without the numbers and names that make each its own, and without what explains it."""
    words = [
        word if not any(c.isdigit() for c in word) else "…"
        for word in re.split(r"[:;(]", text)[0].split()
    ]
    return shorten(" ".join(words), LONGEST_CAUSE, placeholder=" …")


def _scenario_rows(
    case: Mapping[str, Any], result: GenerationResult, task: PartTask
) -> list[dict[str, Any]]:
    """A row for each scenario of a case."""
    rows = []
    for scenario in result.generated.scenarios:
        motion = scenario.resampled(task.request.config.evaluation.period)
        measures = criticality(motion, task.request.config.evaluation.ttc_horizon)
        rows.append({
            "template": case["template"], "kind": case["kind"], "vehicles": case["vehicles"], "namespace": case["namespace"],
            "part": task.number, "index": scenario.index, "seed": scenario.seed,
            "sha256": scenario_bytes(scenario, result.encounter)[1], "seconds": float(scenario.time[-1]),
            "distance": measures.min_distance, "ttc": measures.min_ttc, "pet": measures.pet,
            "speed": float(scenario.speed.max()), "braking": float(-scenario.acceleration.min()),
            "type": most_exposed(scenario.vehicles), "types": [vehicle.type for vehicle in scenario.vehicles],
        })  # fmt: skip
    return rows


SCENARIO_COLUMNS = {
    **dict.fromkeys(("template", "kind", "namespace", "sha256", "type"), "string"),
    "types": "string[]",
    **dict.fromkeys(("vehicles", "part", "index", "seed"), "int64"),
    **dict.fromkeys(("seconds", "distance", "ttc", "pet", "speed", "braking"), "double"),
}
CASE_COLUMNS = {
    **dict.fromkeys(("template", "kind", "namespace", "refused", "cause", "why"), "string"),
    **dict.fromkeys(
        ("vehicles", "seed", "wanted", "published", "candidates", "part", "changepoints"), "int64"
    ),
}


def summary(out: Place, failed: list[str]) -> Batch:
    """Return the figures of the parts that are done."""
    tables: list[Place] = sorted((out / "cases").rglob("*.parquet"), key=str)
    cases = list(rows_of(tables))
    refused: Counter[str] = Counter()
    for case in cases:
        refused.update(json.loads(case["refused"]))
    scenarios, requested = (
        sum(int(case[name]) for case in cases) for name in ("published", "wanted")
    )
    failures = Counter(case["cause"] for case in cases if not case["published"])
    return Batch(len(cases), scenarios, requested, dict(failures), dict(refused), failed)
