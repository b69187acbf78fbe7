# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The parts of a batch: each has the scenarios of some templates on one road.

    templates/part-00000.parquet                         encounters, with the columns of a corpus
    scenarios/road=NAME/part-00000.parquet               a row per scenario: its criticality
    trajectories/kind=KIND/road=NAME/part-00000.parquet  a row per vehicle of a scenario
    bags/road=NAME/part-00000/                           a bag, where bags were requested
    cases/road=NAME/part-00000.parquet                   a row per set: counts, causes of refusals

The table of cases is written last, so a part is finished if that table exists. A template has one
set, or one for each outcome of its decision (`sampling.decisions=drawn`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, UTC
from hashlib import sha256
from itertools import pairwise
import json
from pathlib import Path
import re
from textwrap import shorten
from typing import Any

from scenario_gen.bags.recordings.write import add_results, scenario_bytes
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.provenance import RECORDING
from scenario_gen.corpus.conditions import matching
from scenario_gen.corpus.encounters import encounter_of
from scenario_gen.corpus.tables import rows_of, write_table
from scenario_gen.corpus.tasks import arriving
from scenario_gen.corpus.trajectories import write_trajectories
from scenario_gen.method.chain import EmptySetError
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import criticality
from scenario_gen.method.fitting import LostEncounterError
from scenario_gen.pipeline import generate_outcomes
from scenario_gen.types import GenerationResult, most_exposed, NoteKind, Scenario

STEP_COUNT = 10_000_000  # numbers of parts for each number of scenarios that a batch has grown to
MESSAGES = "messages"  # the source of encounters from the messages of an archive
NO_CANDIDATE = "no valid candidate"
LOST_CONFLICT = "lost conflict"  # the cause of a case whose encounter is lost, on any road
SCENARIO_COLUMNS = {
    **dict.fromkeys(
        ("template", "recording", "kind", "namespace", "sha256", "type", "outcome"), "string"
    ),
    "types": "string[]",
    **dict.fromkeys(("vehicles", "part", "index", "seed"), "int64"),
    **dict.fromkeys(
        ("seconds", "distance", "ttc", "pet", "speed", "braking", "probability"), "double"
    ),
}
CASE_COLUMNS = {
    **dict.fromkeys(("template", "recording", "kind", "namespace", "outcome"), "string"),
    **dict.fromkeys(("refused", "cause", "why", "shortened"), "string"),
    **dict.fromkeys(
        ("vehicles", "seed", "wanted", "published", "candidates", "part", "changepoints"), "int64"
    ),
}
Made = tuple[dict[str, Any], Scenario]
"""A scenario with its row."""


@dataclass(frozen=True)
class BatchRequest:
    """The scenarios to generate from each template on each road.

    Attributes:
        config: the parameters of every stage.
        count: number of scenarios per template and road.
        seed: seed of the batch; the seed of a case follows from it, the template's name and the
            road.
        bags: "none", "hits" or "all" of the scenarios are also written to bags.
        hits: condition of the scenarios for bags="hits", as for `find`.
    """

    config: PipelineConfig = PipelineConfig()
    count: int = 50
    seed: int = 0
    bags: str = "none"
    hits: str = ""


@dataclass(frozen=True)
class PartTask:
    """A table of templates to place on one road.

    The files are `out`/…/road=`token`/part-`number`. Each number of scenarios that the batch has
    grown to is a `step`, with seeds and numbers of its own.
    """

    table: Path
    number: int
    step: int
    road: str
    token: str
    out: Path
    request: BatchRequest

    @property
    def name(self) -> str:
        """The task in messages."""
        return f"part {self.number} on {self.token}"

    @property
    def target(self) -> Path:
        """The table of cases, which is written last."""
        return self.file("cases")

    def file(self, folder: str, suffix: str = ".parquet") -> Path:
        """Return one of the files."""
        return self.out / folder / f"road={self.token}" / f"part-{self.number:05}{suffix}"


def part_tasks(
    out: Path, roads: Mapping[str, str], counts: Sequence[int], request: BatchRequest
) -> list[PartTask]:
    """Return all tasks of a batch, in the order of its templates.

    Args:
        out: the batch.
        roads: each by the name of its folder.
        counts: numbers of scenarios that the batch has grown to, ascending.
        request: the scenarios to generate.
    """
    templates = sorted((out / "templates").glob("part-*.parquet"))
    return [
        PartTask(table, k, step, road, token, out, replace(request, count=high - low))
        for step, (low, high) in enumerate(pairwise([0, *counts]))
        for k, table in enumerate(templates, start=step * STEP_COUNT)
        for token, road in roads.items()
    ]


def finished_tables(out: Path, folder: str) -> list[Path]:
    """Return the tables of finished parts in a folder of a batch, sorted."""
    finished = {table.parts[-2:] for table in (out / "cases").glob("road=*/part-*.parquet")}
    tables = (out / folder).rglob("part-*.parquet")
    return sorted(table for table in tables if table.parts[-2:] in finished)


def recording_of(row: Mapping[str, Any]) -> str:
    """Return the recording of an encounter: its log, or ten minutes of an archive's messages."""
    if row["source"] != MESSAGES:
        return str(row["source"])
    start = datetime.fromtimestamp(row["start_ns"] // 10**9, UTC)
    return f"messages {start:%Y-%m-%dT%H:}{start.minute // 10}0"


def seed_of(seed: int, template: str, road: str, step: int = 0) -> int:
    """Return the seed of one template on one road, below 2^32."""
    text = f"{seed}\n{template}\n{road}" + (f"\n{step}" if step else "")
    return int.from_bytes(sha256(text.encode()).digest()[:4], "big")


@dataclass(frozen=True)
class PartResult:
    """What a part came to: rows of cases, scenarios with their rows, results by namespace."""

    cases: list[dict[str, Any]]
    scenarios: list[Made]
    results: dict[str, GenerationResult]


def _part_result(task: PartTask) -> PartResult:
    """Generate the scenarios of a part."""
    part = PartResult([], [], {})
    for k, row in enumerate(rows_of([task.table])):
        for case, result in _generate_cases(row, f"/case_{k}", task):
            part.cases.append(case)
            if result is not None and len(result):
                part.results[case["namespace"]] = result
                part.scenarios.extend(_scenario_rows(case, result, task))
    return part


def generate_part(task: PartTask) -> None:
    """Generate the scenarios of a part; write its tables, and its bag if it is requested.

    Raises:
        OSError: the disk is full or fails.
    """
    part = _part_result(task)
    kinds = {row["kind"] for row, _ in part.scenarios}
    for kind in sorted(kinds):
        scenarios = [(row, scenario) for row, scenario in part.scenarios if row["kind"] == kind]
        write_trajectories(task.file(f"trajectories/kind={kind}"), scenarios)
    write_table(task.file("scenarios"), [row for row, _ in part.scenarios], SCENARIO_COLUMNS)
    if task.request.bags != "none":
        _write_bag(task, part.results)
    write_table(task.target, part.cases, CASE_COLUMNS)


def _write_bag(task: PartTask, results: Mapping[str, GenerationResult]) -> None:
    """Write the requested scenarios of results to a bag; the table of scenarios is written."""
    chosen = {(name, scenario.index) for name in results for scenario in results[name]}
    if task.request.bags == "hits":
        with matching([task.file("scenarios")], task.request.hits) as (_, rows):
            chosen = set(rows.project("namespace, index").fetchall())
    if not chosen:
        return
    with arriving(task.file("bags", "")) as path, BagWriter(path) as bag:
        for name in sorted({name for name, _ in chosen}):
            result = results[name]
            kept = tuple(scenario for scenario in result if (name, scenario.index) in chosen)
            generated = replace(result.generated, scenarios=kept)
            add_results(bag, {name: replace(result, generated=generated)})


def _generate_cases(
    row: Mapping[str, Any], namespace: str, task: PartTask
) -> list[tuple[dict[str, Any], GenerationResult | None]]:
    """Generate the sets of one template; return the row and the result of each.

    A refused template has one row with the reason, and no result.
    """
    request = task.request
    seed = seed_of(request.seed, row["name"], task.road, task.step)
    case = {
        "template": row["name"],
        "recording": recording_of(row),
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
    config = request.config
    try:
        encounter = encounter_of(row, task.table)
        sets = generate_outcomes(encounter, task.road, config, count=request.count, seed=seed)
    except EmptySetError as error:
        return [(case | _set_columns(error.result), None)]
    except (RefusedError, InputError) as error:
        return [(case | {"cause": _cause(error), "why": str(error)}, None)]
    facts = {"template": encounter.recording, RECORDING: case["recording"], "roads": task.road}
    facts |= {"seed": str(seed), "count": str(request.count)}
    names = [namespace, *(f"{namespace}_{n}" for n in range(1, len(sets)))]
    return [
        (
            case | {"namespace": name} | _set_columns(result),
            replace(result, provenance={**facts, **result.provenance}),
        )
        for name, result in zip(names, sets, strict=True)
    ]


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
) -> list[Made]:
    """Return each scenario of a case with its row."""
    config = task.request.config.evaluation
    decision = result.encounter.decision
    rows = []
    for scenario in result.generated.scenarios:
        measures = criticality(scenario.resampled(config.period), config.ttc_horizon)
        row = {
            **{name: case[name] for name in SCENARIO_COLUMNS.keys() & case.keys()},
            "index": scenario.index,
            "sha256": scenario_bytes(scenario, result.encounter)[1],
            "seconds": float(scenario.time[-1]),
            "distance": measures.min_distance,
            "ttc": measures.min_ttc,
            "pet": measures.pet,
            "speed": float(scenario.speed.max()),
            "braking": float(-scenario.acceleration.min()),
            "type": most_exposed(scenario.vehicles),
            "types": [vehicle.type for vehicle in scenario.vehicles],
            "probability": decision.probability if decision else 1.0,
        }
        rows.append((row, scenario))
    return rows
