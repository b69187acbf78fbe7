# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`batch`: templates × roads × scenarios.

A task generates the scenarios of ten templates on one road, and writes three files:

    bags/road=NAME/part-00000/              a bag as from `generate`, a namespace per set
    scenarios/road=NAME/part-00000.parquet  a row per scenario: its place and its criticality
    cases/road=NAME/part-00000.parquet      a row per set: counts, and the causes of refusals

A template has one set, or one for each outcome of its decision (`sampling.decisions=drawn`).

The table of cases is written last, so a part is finished if that table exists. There is no other
record of progress. `recombined/encounters.parquet` has the templates that were recombined from
those of the corpus.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from itertools import groupby
import json
from pathlib import Path
import re
from textwrap import shorten
from typing import Any

import numpy as np

from scenario_gen.bags.recordings.write import add_results, scenario_bytes
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import InputError, needs, RefusedError
from scenario_gen.base.folders import sha256_of
from scenario_gen.base.provenance import parameter_texts, versions
from scenario_gen.base.stores import each_fetched, Place
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import encounter_of, row_of, tables_of, write_encounters
from scenario_gen.corpus.tables import rows_at, rows_of, write_table
from scenario_gen.corpus.tasks import agree, arriving, check_out, held, spread, undone, Workers
from scenario_gen.method.chain import EmptySetError, generate_set
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import criticality
from scenario_gen.method.fitting import LostEncounterError
from scenario_gen.method.outcome_sets import for_one_set, outcome_sets
from scenario_gen.method.recombination import recombinations
from scenario_gen.method.shortening import fit_what_matters
from scenario_gen.roads import build_road
from scenario_gen.types import (
    Encounter,
    GenerationResult,
    most_exposed,
    Note,
    NoteKind,
    Recombined,
    Request,
)

MANIFEST = "batch.json"
TASK_TEMPLATE_COUNT = 10
MAX_PARENT_COUNT = 1000  # encounters that are recombined: each is in memory
NO_CANDIDATE = "no valid candidate"
LOST_CONFLICT = "lost conflict"  # the cause of a case whose encounter is lost, on any road
SCENARIO_COLUMNS = {
    **dict.fromkeys(("template", "kind", "namespace", "sha256", "type", "outcome"), "string"),
    "types": "string[]",
    **dict.fromkeys(("vehicles", "part", "index", "seed"), "int64"),
    **dict.fromkeys(
        ("seconds", "distance", "ttc", "pet", "speed", "braking", "probability"), "double"
    ),
}
CASE_COLUMNS = {
    **dict.fromkeys(
        ("template", "kind", "namespace", "refused", "cause", "why", "outcome", "shortened"),
        "string",
    ),
    **dict.fromkeys(
        ("vehicles", "seed", "wanted", "published", "candidates", "part", "changepoints"), "int64"
    ),
}


@dataclass(frozen=True)
class BatchRequest:
    """The scenarios to generate from each template on each road.

    Attributes:
        config: the parameters of every stage.
        count: number of scenarios per template and road.
        seed: seed of the batch; the seed of a case follows from it, the template's name and the
            road.
        recombine: largest number of further templates, recombined from those of the corpus.
    """

    config: PipelineConfig = PipelineConfig()
    count: int = 50
    seed: int = 0
    recombine: int = 0


@dataclass(frozen=True)
class RecombineTask:
    """Templates (table, row) to recombine, and the table to write."""

    templates: tuple[tuple[Place, int], ...]
    target: Place
    request: BatchRequest

    @property
    def name(self) -> str:
        """The task in messages."""
        return "recombination"


@dataclass(frozen=True)
class PartTask:
    """Templates (table, row) to place on one road.

    The three files are `out`/…/road=`token`/part-`number`.
    """

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

    def file(self, folder: str, suffix: str = ".parquet") -> Place:
        """Return one of the three files."""
        return self.out / folder / f"road={self.token}" / f"part-{self.number:05}{suffix}"


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
    corpus: Place,
    roads: Sequence[str],
    out: Place,
    request: BatchRequest = BatchRequest(),
    *,
    templates: int = 0,
    workers: Workers = Workers(),
) -> Batch:
    """Generate scenarios from all templates of a corpus on all roads.

    Args:
        corpus: written by `mine`.
        roads: names or paths, as for `build_road`.
        out: folder of the tables and bags; an unfinished batch with the same corpus, roads and
            parameters is continued.
        request: the scenarios to generate from each template on each road.
        templates: number of templates, the first ones of the corpus; 0 uses all.
        workers: the processes.

    Raises:
        InputError: the corpus has no encounters, a road is unknown, or `out` has other content.
    """
    needs("corpus", "duckdb", "pyarrow")
    check_out(out, [corpus])
    rows: list[tuple[Place, int]] = []
    hashes = []
    for table, path in each_fetched(tables_of(corpus)):
        rows += [(table, k) for k, _ in enumerate(rows_of([path], ["name"]))]
        hashes.append(sha256_of(path))
    rows = rows[: templates or None]
    if not rows:
        raise InputError(f"{corpus} holds no encounter")
    first = next(encounter_of(row, table) for row, table in _rows(rows[:1]))
    # An unknown road ends the batch; a road that does not fit one encounter does not.
    for road in roads:
        with suppress(RefusedError):
            build_road(road, first, request.config.road)
    document = {
        "format": 2,
        "corpus": hashes,
        "roads": list(roads),
        "count": request.count,
        "seed": request.seed,
        "templates": len(rows),
        "recombine": request.recombine,
        "parameters": parameter_texts(request.config),
    }
    with held(out), spread(workers) as run:
        agree(out, MANIFEST, document, "batch")
        failed: list[str] = []
        if request.recombine:
            table = out / "recombined" / "encounters.parquet"
            failed = run(recombine, undone([RecombineTask(tuple(rows), table, request)]))
            if not failed:
                rows += [(table, k) for k, _ in enumerate(rows_of([table], ["name"]))]
        failed += run(generate_part, undone(parts(rows, roads, out, request)))
        return summary(out, failed)


def parts(
    rows: Sequence[tuple[Place, int]], roads: Sequence[str], out: Place, request: BatchRequest
) -> list[PartTask]:
    """Return the tasks: ten templates on one road each, for any number of workers."""
    tokens = tokens_of(roads)
    tasks = []
    for first in range(0, len(rows), TASK_TEMPLATE_COUNT):
        templates = tuple(rows[first : first + TASK_TEMPLATE_COUNT])
        number = first // TASK_TEMPLATE_COUNT
        for road, token in zip(roads, tokens, strict=True):
            tasks.append(PartTask(templates, road, token, number, out, request))
    return tasks


def tokens_of(roads: Sequence[str]) -> list[str]:
    """Return a unique name for each road that is valid as the name of a folder."""
    stems = ["".join(c if c.isalnum() else "_" for c in Path(road).stem) for road in roads]
    return [stem if stems.count(stem) == 1 else f"{stem}_{k}" for k, stem in enumerate(stems)]


def seed_of(seed: int, template: str, road: str) -> int:
    """Return the seed of one template on one road, below 2^32."""
    return int.from_bytes(sha256(f"{seed}\n{template}\n{road}".encode()).digest()[:4], "big")


def recombine(task: RecombineTask) -> None:
    """Recombine templates, if there are very many some of them, and write a table of the result.

    Raises:
        OSError: the disk is full or fails.
    """
    request = task.request
    order = np.random.default_rng(request.seed).permutation(len(task.templates))
    chosen = [task.templates[k] for k in sorted(order[:MAX_PARENT_COUNT].tolist())]
    recorded = [encounter_of(row, table) for row, table in _rows(chosen)]
    made, _ = recombinations(recorded, request.recombine, request.seed)
    rows = [row_of(encounter, "recombined", CorpusConfig()) for encounter in made]
    write_encounters(task.target, rows, {})


def generate_part(task: PartTask) -> None:
    """Generate the scenarios of a part; write its bag and its two tables.

    Raises:
        OSError: the disk is full or fails.
    """
    cases = []
    scenarios: list[dict[str, Any]] = []
    results: dict[str, GenerationResult] = {}
    for k, (row, table) in enumerate(_rows(task.templates)):
        for case, result in _generate_cases(row, table, f"/case_{k}", task):
            cases.append(case)
            if result is not None and len(result):
                results[case["namespace"]] = result
                scenarios += _scenario_rows(case, result, task)
    if results:
        with arriving(task.file("bags", "")) as part, BagWriter(part) as bag:
            add_results(bag, results)
    write_table(task.file("scenarios"), scenarios, SCENARIO_COLUMNS)
    write_table(task.target, cases, CASE_COLUMNS)


def _rows(templates: Sequence[tuple[Place, int]]) -> Iterator[tuple[dict[str, Any], Place]]:
    """Yield the rows of encounters (table, number) with their tables.

    A table is opened once for consecutive rows.
    """
    for table, group in groupby(templates, key=lambda template: template[0]):
        for row in rows_at(table, [number for _, number in group]):
            yield row, table


def _generate_cases(
    row: Mapping[str, Any], table: Place, namespace: str, task: PartTask
) -> list[tuple[dict[str, Any], GenerationResult | None]]:
    """Generate the sets of one template; return the row and the result of each.

    A refused template has one row with the reason, and no result.
    """
    request = task.request
    seed = seed_of(request.seed, row["name"], task.road)
    case = {
        "template": row["name"],
        "kind": row["kind"],
        "vehicles": row["count"],
        "namespace": namespace,
        "seed": seed,
        "wanted": request.count,
        "published": 0,
        "candidates": 0,
        "refused": "{}",
        "cause": "",
        "why": "",
        "part": task.number,
        "changepoints": 0,
        "outcome": "",
        "shortened": "",
    }
    generate = partial(
        fit_what_matters,
        partial(_generate_set, task, seed),
        shorten=request.config.fitting.shorten,
    )
    sampling = request.config.sampling
    try:
        encounter = encounter_of(row, table)
        sets = outcome_sets(generate, encounter, sampling, Request(), request.count, seed)
    except EmptySetError as error:
        return [(case | _set_columns(error.result), None)]
    except (RefusedError, InputError) as error:
        return [(case | {"cause": _cause(error), "why": str(error)}, None)]
    names = [namespace, *(f"{namespace}_{n}" for n in range(1, len(sets)))]
    return [
        (case | {"namespace": name} | _set_columns(result), result)
        for name, result in zip(names, sets, strict=True)
    ]


def _generate_set(task: PartTask, seed: int, encounter: Encounter, count: int) -> GenerationResult:
    """Return scenarios from an encounter.

    Raises:
        InputError, RefusedError: as `generate_set`.
    """
    config = task.request.config
    config = replace(config, sampling=for_one_set(config.sampling, encounter))
    result = generate_set(encounter, count, task.road, config=config, seed=seed)
    if isinstance(encounter.source, Recombined):
        result = result.noted(Note.of(NoteKind.RECOMBINED, **vars(encounter.source)))
    facts = {"template": encounter.recording, "roads": task.road, "seed": str(seed)}
    facts["count"] = str(count)
    return replace(result, provenance=facts | versions() | parameter_texts(config))


def _set_columns(result: GenerationResult) -> dict[str, Any]:
    """Return the columns of a case that follow from its result."""
    generated, decision = result.generated, result.encounter.decision
    shortened = [note for note in generated.adaptations if note.kind is NoteKind.SHORTENED]
    refused = {str(cause): number for cause, number in sorted(generated.refused.items()) if number}
    return {
        "wanted": generated.requested,
        "published": len(result),
        "candidates": generated.candidates,
        "refused": json.dumps(refused),
        "changepoints": len(result.segmentation.changepoints),
        "cause": "" if len(result) else NO_CANDIDATE,
        "outcome": decision.outcome if decision else "",
        "shortened": str(shortened[0].values["parts"]) if shortened else "",
    }


def _cause(error: RefusedError | InputError) -> str:
    """Return the cause under which an error is counted: its message without numbers and details.

    Words with digits differ from case to case, and the text after a colon explains the error.
    """
    if isinstance(error, LostEncounterError):
        return LOST_CONFLICT
    if isinstance(error, InputError):
        return "input"
    words = [
        "…" if any(c.isdigit() for c in word) else word
        for word in re.split(r"[:;(]|\. ", str(error))[0].split()
    ]
    return shorten(" ".join(words), 80, placeholder=" …")


def _scenario_rows(
    case: Mapping[str, Any], result: GenerationResult, task: PartTask
) -> list[dict[str, Any]]:
    """Return a row for each scenario of a case."""
    config = task.request.config.evaluation
    decision = result.encounter.decision
    rows = []
    for scenario in result.generated.scenarios:
        measures = criticality(scenario.resampled(config.period), config.ttc_horizon)
        row = {
            "template": case["template"],
            "kind": case["kind"],
            "vehicles": case["vehicles"],
            "namespace": case["namespace"],
            "part": task.number,
            "index": scenario.index,
            "seed": scenario.seed,
            "sha256": scenario_bytes(scenario, result.encounter)[1],
            "seconds": float(scenario.time[-1]),
            "distance": measures.min_distance,
            "ttc": measures.min_ttc,
            "pet": measures.pet,
            "speed": float(scenario.speed.max()),
            "braking": float(-scenario.acceleration.min()),
            "type": most_exposed(scenario.vehicles),
            "types": [vehicle.type for vehicle in scenario.vehicles],
            "outcome": case["outcome"],
            "probability": decision.probability if decision else 1.0,
        }
        rows.append(row)
    return rows


def summary(out: Place, failed: list[str]) -> Batch:
    """Return the figures of the finished parts."""
    tables: list[Place] = sorted((out / "cases").rglob("*.parquet"), key=str)
    cases = list(rows_of(tables))
    refused: Counter[str] = Counter()
    for case in cases:
        refused.update(json.loads(case["refused"]))
    scenarios = sum(int(case["published"]) for case in cases)
    requested = sum(int(case["wanted"]) for case in cases)
    failures = Counter(case["cause"] for case in cases if not case["published"])
    outcomes: Counter[str] = Counter()
    for case in cases:
        if case.get("outcome"):
            outcomes[case["outcome"]] += int(case["published"])
    pairs = {(case["template"], case["seed"]) for case in cases}
    return Batch(
        len(pairs),
        scenarios,
        requested,
        dict(failures),
        dict(refused),
        dict(outcomes),
        sum(bool(case.get("shortened")) for case in cases),
        failed,
    )
