# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What a request leaves behind: a bag, a report and the figures, whole or not at all."""

from collections.abc import Mapping, Sequence
import json
from pathlib import Path
import shutil

from scenario_gen.bags import Run, write_run
from scenario_gen.bags.provenance import parameter_texts, sha256_of, versions
from scenario_gen.errors import InputError
from scenario_gen.evaluation import Case, ReportInput, write_report
from scenario_gen.parameters import flatten
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.requests import Request

BAG, REPORT, FIGURES = "bag", "report.html", "evaluation.json"


def write_results(
    folder: Path,
    cases: Sequence[Case],
    *,
    seed: int,
    title: str,
    quality: Sequence[str],
    provenance: Mapping[str, str],
    bag: Path | None = None,
) -> None:
    """Write bag, report and figures of all cases to `folder`, replacing results that are there.

    Args:
        folder: where to; it is made, and nothing is left half-written if something fails.
        cases: one per encounter and road; with several, each has its own namespace in the bag.
        seed: of the request.
        title: heading of the report.
        quality: the log's data-quality summary, in lines.
        provenance: what is needed to do it again.
        bag: a bag that was recorded already, moved into place; without it one is written here.

    Raises:
        InputError: the folder holds something that is not an earlier result.
    """
    check_folder(folder)
    partial = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    try:
        if bag is None:
            names = namespaces(len(cases))
            write_run(partial / BAG, [as_run(case, seed, name, provenance) for case, name in zip(cases, names, strict=True)])
        else:
            shutil.copytree(bag, partial / BAG)
        write_report(partial / REPORT, ReportInput(cases, title, quality, provenance))
        figures = [json.loads(case.evaluation.to_json()) for case in cases]
        (partial / FIGURES).write_text(json.dumps({"provenance": dict(provenance), "cases": figures}, indent=2) + "\n")
        shutil.rmtree(folder, ignore_errors=True)
        partial.rename(folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def check_folder(folder: Path) -> None:
    """Raise InputError if `folder` holds anything but an earlier result."""
    if folder.exists() and (not folder.is_dir() or (any(folder.iterdir()) and not (folder / REPORT).exists())):
        raise InputError(f"{folder} exists and is not an earlier result; choose another --out")


def as_run(case: Case, seed: int, namespace: str = "", provenance: Mapping[str, str] | None = None) -> Run:
    """Return the case as the bag writer takes it.

    Raises:
        InputError: its road or its fit is not known.
    """
    if case.road is None or case.fit is None:
        raise InputError(f"{case.title}: without a road and a fit it cannot be written as a run")
    return Run(
        encounter=case.encounter,
        road=case.road,
        segmentation=case.segmentation,
        fit=case.fit,
        routes=tuple(case.routes),
        result=case.with_changepoints,
        seed=seed,
        namespace=namespace,
        provenance=provenance or {},
    )


def namespaces(count: int) -> list[str]:
    """Return one ROS namespace per case; a single case needs none."""
    return [""] if count == 1 else [f"/case_{k + 1}" for k in range(count)]


def provenance_of(
    logs: Sequence[Path],
    seed: int,
    count: int,
    roads: Sequence[str],
    config: PipelineConfig,
    request: Request = Request(),  # noqa: B008 - frozen
) -> dict[str, str]:
    """Return everything needed to do it again: log hashes, seed, versions, the request and all parameters."""
    facts = {f"log {path.name}": f"sha256 {sha256_of(path)}" for path in logs}
    facts |= {"roads": ", ".join(roads), "seed": str(seed), "count": str(count)}
    facts |= {name: value for name, (_, value) in flatten(request).items() if value}
    return facts | versions() | parameter_texts(config)
