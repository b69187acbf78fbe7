# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The outputs of a request: a bag, a report and the figures."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
import json
from pathlib import Path
import shutil
from typing import Any

from scenario_gen.bags.recordings.write import add_results, write_recording
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import Kind, replaced_folder, scratch, sha256_of, write_text
from scenario_gen.base.provenance import log_texts, what_makes_it_again
from scenario_gen.output.report.page import ReportInput, write_report
from scenario_gen.output.table import TABLES
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.types import as_markdown, GenerationResult, Request

BAG, REPORT, FIGURES, TABLE = "bag", "report.html", "evaluation.json", "evaluation.md"
GENERATED, EVALUATED = Kind("generated"), Kind("evaluated")


def report(
    target: Path | str | GenerationResult, *more: GenerationResult | Path | str, title: str = ""
) -> Path:
    """Write bag, report and figures of results to a folder, like `scenario-gen generate`.

    The path stands before the results or after them. One with the suffix .html becomes the page
    alone; without a path the folder is out/report. Returns the path of the page.

    Raises:
        InputError: no result or several paths are given, the folder has other contents, or the
            page exists.
    """
    given = (target, *more)
    cases = [each for each in given if isinstance(each, GenerationResult)]
    places = [each for each in given if not isinstance(each, GenerationResult)] or ["out/report"]
    if not cases or len(places) > 1:
        raise InputError("report: results and at most one path are needed")
    target, title = Path(places[0]), title or cases[0].title
    if target.suffix.lower() == ".html":
        with _new_file(target) as page:
            write_report(page, ReportInput(cases, title, (), cases[0].provenance))
        return target
    with replaced_folder(target, GENERATED) as place:
        write_results(place, cases, title=title, quality=(), provenance=cases[0].provenance)
    return target / REPORT


def save(result: GenerationResult, target: Path | str) -> Path:
    """Write a result to a bag, or to one file if the suffix names its kind; return its path.

    Args:
        result: from `generate`, or read from a bag.
        target: a folder for a bag; a file .mcap for the bag's messages, or .csv or .parquet for
            the table of `GenerationResult.to_dataframe`. `load` reads bags and .mcap files.

    Raises:
        InputError: the folder has other contents, or the file exists.
        MissingExtraError: pyarrow, which writes .parquet, is not installed.
    """
    target = Path(target)
    suffix = target.suffix.lower().removeprefix(".")
    if suffix in TABLES:
        with _new_file(target) as file:
            file.write_bytes(TABLES[suffix](result.to_dataframe()))
        return target
    if suffix == "mcap":
        with scratch() as place, _new_file(target) as file:
            (messages,) = write_recording(place / "bag", result).glob("*.mcap")
            shutil.copyfile(messages, file)
        return target
    return write_recording(target, result)


@contextmanager
def _new_file(target: Path) -> Iterator[Path]:
    """Return the path of a file that becomes `target` at the end.

    Raises:
        InputError: `target` exists.
    """
    if target.exists():
        raise InputError(f"{target} exists; delete it, or name another file")
    target.parent.mkdir(parents=True, exist_ok=True)
    with scratch(target.parent) as place:
        yield place / target.name
        (place / target.name).replace(target)


def write_results(
    folder: Path,
    cases: Sequence[GenerationResult],
    *,
    title: str,
    quality: Sequence[str],
    provenance: Mapping[str, str],
) -> None:
    """Write bag, report and figures of all cases to `folder`.

    Args:
        folder: a folder from `replaced_folder`; a bag that it already has is kept.
        cases: one per encounter and road; with several, each has its own namespace in the bag.
        title: heading of the report.
        quality: the log's data-quality summary, in lines.
        provenance: inputs, versions and parameters by name, to generate the results again.

    Raises:
        OSError: the disk is full, or fails.
    """
    if not (folder / BAG).exists():
        names = namespaces(len(cases))
        with BagWriter(folder / BAG) as bag:
            results = [
                replace(case, provenance={**provenance, **case.provenance}) for case in cases
            ]
            add_results(bag, dict(zip(names, results, strict=True)))
    write_report(folder / REPORT, ReportInput(cases, title, quality, provenance))
    figures = {"provenance": dict(provenance), "cases": [_figures(case) for case in cases]}
    write_text(folder / FIGURES, json.dumps(figures, indent=2) + "\n")


def _figures(case: GenerationResult) -> dict[str, Any]:
    """Return a case's similarity, reactions, evaluation and figures of the stages."""
    target: dict[str, Any] = {}
    if case.generated.reached is not None:
        weights = {str(each.index): each.facts.weight for each in case.generated}
        weights = {index: weight for index, weight in weights.items() if weight is not None}
        target = {**case.generated.reached.figures(), "weights": weights}
    vehicles = zip(case.encounter.vehicles, case.routes, strict=True) if case.routes else ()
    return {
        "similarity": case.similarity(),
        "reactions": case.reacting,
        **json.loads(case.evaluation.to_json()),
        "adaptations": [str(note) for note in case.generated.adaptations],
        "coverage": {} if case.coverage is None else case.coverage.document(),
        "target": target,
        "fit": {} if case.fit is None else case.fit.figures(),
        "routes": {vehicle.id: route.figures() for vehicle, route in vehicles},
    }


def write_evaluation(folder: Path, cases: Sequence[GenerationResult], bag: Path) -> None:
    """Write report, figures and table about a bag to a `folder` from `replaced_folder`.

    Raises:
        OSError: the disk is full, or fails.
    """
    write_text(folder / TABLE, as_table(cases) + "\n")
    write_text(
        folder / FIGURES,
        json.dumps({"cases": [_figures(case) for case in cases]}, indent=2) + "\n",
    )
    facts = {f"bag {bag.name}": f"sha256 {sha256_of(bag)}", **cases[0].provenance}
    page = ReportInput(cases, f"The scenarios of {bag.name}", provenance=facts)
    write_report(folder / REPORT, page)


def as_table(cases: Sequence[GenerationResult]) -> str:
    """Return the figures of all cases, with notes, as Markdown."""
    return "\n\n".join(map(_table, cases))


def _table(case: GenerationResult) -> str:
    notes = [f"- {as_markdown(str(note))}" for note in case.generated.adaptations]
    lines = [case.evaluation.to_markdown(), *notes]
    sentences = [f"- {as_markdown(line)}" for line in case.reacting["sentences"]]
    if sentences:
        lines += ["", "Who reacts to whom in the recording:", "", *sentences]
    return "\n".join(lines)


def namespaces(count: int) -> list[str]:
    """Return one ROS namespace per case; a single case needs none."""
    return [""] if count == 1 else [f"/case_{k + 1}" for k in range(count)]


def provenance_of(
    logs: Sequence[Path],
    seed: int,
    count: int,
    roads: Sequence[str],
    config: PipelineConfig,
    request: Request = Request(),
) -> dict[str, str]:
    """Return log hashes, seed, versions, request and parameters, to generate the results again."""
    names = [path.name for path in logs]
    hashes = {
        str(path) if names.count(path.name) > 1 else path.name: sha256_of(path) for path in logs
    }
    facts = log_texts(hashes)
    facts |= {"roads": ", ".join(roads), "seed": str(seed), "count": str(count)}
    return facts | what_makes_it_again(config, request)
