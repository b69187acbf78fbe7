# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The work of `scenario-gen search`: a template on its road and a planner in; its failures and their rate out."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import reduce
import json
import math
import os
from pathlib import Path
from typing import Any

from scipy import special

from scenario_gen.bags.recordings.write import add_results
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import Kind, replaced_folder, sha256_of, write_text
from scenario_gen.base.parameters import assigned, flatten
from scenario_gen.base.provenance import parameter_texts, versions
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.results import as_junit, drawings, JUNIT
from scenario_gen.closed_loop.search.estimate import Estimate, LEVEL, Search
from scenario_gen.closed_loop.search.findings import Finding, findings_of
from scenario_gen.closed_loop.search.journal import open_journal
from scenario_gen.closed_loop.search.objective import AT_FAULT, COLLISION, Objective
from scenario_gen.closed_loop.search.problem import DrivenScenarios
from scenario_gen.closed_loop.trials import find_planner, named_vehicle, Rate, trial_runner
from scenario_gen.method.evaluation import measures_in, wilson
from scenario_gen.method.sampling import checker_of, NaturalScenarios, Plan, SamplingConfig
from scenario_gen.method.validity import Limits
from scenario_gen.output.report.html import render_page
from scenario_gen.types import (
    EgoSlot,
    GenerationResult,
    Interval,
    Note,
    NoteKind,
    Request,
    ScenarioSet,
    with_witness,
)

JSON, PAGE, BAG = "search.json", "search.html", "bag"
SEARCHED = Kind("searched")
JOURNAL = ".journal.jsonl"  # behind the name of the results' folder


@dataclass(frozen=True, eq=False)
class SearchRequest:
    """What is searched, and how.

    Attributes:
        planned: a template on its road, with no scenarios.
        request: of the scenarios; sampling, limits: the parameters of scenarios.
        planner: MODULE:CLASS.
        ego: id of the vehicle in whose place it drives; "": that of the request, or the first.
        objective: what counts as a failure.
        budget: drives at most.
        seed: of the search; by it, planner and scenarios everything is determined.
        worst: look for the worst failure, not for the rate.
        assignments: parameters of a drive as name=value.
    """

    planned: GenerationResult
    request: Request
    sampling: SamplingConfig
    limits: Limits
    planner: str
    ego: str = ""
    objective: Objective = Objective()
    budget: int = 1000
    seed: int = 0
    worst: bool = False
    assignments: Sequence[str] = ()

    def ego_id(self) -> str:
        """Return the id of the vehicle in whose place the planner drives.

        Raises:
            InputError: there is no such vehicle.
        """
        ids = [vehicle.id for vehicle in self.planned.encounter.vehicles]
        wanted = self.ego or self.request.ego or ids[0]
        found = named_vehicle(ids, wanted)
        if not found:
            raise InputError(
                f"--ego {wanted}: there is no such vehicle; there are {', '.join(ids)}"
            )
        return found

    def identity(self) -> dict[str, Any]:
        """Return what the drives hang on; the budget does not change them."""
        make = find_planner(self.planner)
        source = Path(getattr(__import__(make.__module__, fromlist=["_"]), "__file__", None) or "")
        return {
            "template": self.planned.encounter.name,
            "road": self.planned.road_and_fit()[0].name,
            "scenarios": str(self.planned.seed),
            "request": parameter_texts(self.request),
            "sampling": parameter_texts(self.sampling),
            "limits": parameter_texts(self.limits),
            "planner": self.planner,
            "planner's file": sha256_of(source) if source.is_file() else "",
            "drive": parameter_texts(self.drive_config()),
            "ego": self.ego_id(),
            "objective": str(self.objective),
            "seed": self.seed,
            "worst": self.worst,
            "versions": versions(),
        }

    def drive_config(self) -> ClosedLoopConfig:
        """Return the parameters of a drive.

        Raises:
            InputError: a name is unknown, or a value does not suit.
        """
        return reduce(assigned, self.assignments, ClosedLoopConfig(limits=self.limits))


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What a search came to, and the files written."""

    estimate: Estimate
    findings: Sequence[Finding]
    worst: bool
    written: Sequence[Path]

    @property
    def kinds(self) -> dict[str, list[Finding]]:
        """Findings by kind, the kind with the greatest share of the rate first."""
        kinds: dict[str, list[Finding]] = {}
        for one in self.findings:
            kinds.setdefault(one.kind, []).append(one)
        return dict(
            sorted(
                kinds.items(), key=lambda item: -math.fsum(one.weight or 0.0 for one in item[1])
            )
        )

    @property
    def plain(self) -> Rate:
        """The rate by natural drives alone."""
        hits, total = self.estimate.plain
        return Rate(hits, total, wilson(hits, total, LEVEL))

    @property
    def equal_plain(self) -> float:
        """Natural drives that would give an interval as narrow; NaN where no failure was found."""
        rate = self.estimate.rate
        half = 0.5 * (rate.high - rate.low)
        z = float(special.ndtri(0.5 + 0.5 * LEVEL))
        return (
            z * z * rate.value * (1.0 - rate.value) / (half * half)
            if rate.value > 0.0 and half > 0.0
            else math.nan
        )

    def sentences(self) -> list[str]:
        """Return what it came to, in sentences."""
        e, rate = self.estimate, self.estimate.rate
        if self.worst:
            return [
                f"{len(self.findings)} failure(s) kept of {e.drives} drives; a search for the worst gives no rate"
            ]
        messages = [
            f"no failure in {e.drives} drives; by the natural ones the rate is at most {_share(rate.high)} (95 %)"
        ]
        if e.first:
            interval = f"95 % interval {_share(rate.low)} to {_share(rate.high)}"
            messages = [
                f"failure rate {_share(rate.value)} ({interval})",
                f"first failure: drive {e.first} of {e.drives}",
            ]
        for name, share in e.events.items():
            words = "collisions by the ego's fault" if name == AT_FAULT else "collisions"
            messages.append(
                f"{words}: {_share(share.value)} ({_share(share.low)} to {_share(share.high)})"
            )
        messages.append(f"natural drives alone: {self.plain}")
        if not math.isnan(self.equal_plain):
            messages.append(
                f"plain sampling would need {self.equal_plain:,.0f} drives for an interval as narrow"
            )
        if e.first and not math.isnan(e.unexpected):
            messages.append(
                f"failures that the regression does not expect: at most {_share(e.unexpected)} (95 %)"
            )
        return messages


def _share(value: float) -> str:
    return "–" if math.isnan(value) else f"{100.0 * value if value > 1e-9 else 0.0:.3g} %"


def search_failures(
    request: SearchRequest,
    out: Path,
    *,
    workers: int = 0,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> SearchResult:
    """Search, and write search.json, search.html, junit.xml and a bag of the failures.

    Every drive is kept in a journal beside the folder: the same search goes on where it was
    stopped, and with a larger budget.

    Args:
        request: what is searched.
        out: folder of the results.
        workers: processes; 0: one for each core.
        progress: called with how many drives are done, of how many.

    Raises:
        InputError: the planner fails, a vehicle or parameter is wrong, the journal is of another
            search, or a file cannot be written; the message names it.
        RefusedError: no scenario can be drawn.
    """
    if request.budget < 1:
        raise InputError(f"--budget {request.budget}: at least one drive is needed")
    config, ego = request.drive_config(), request.ego_id()
    identity = request.identity()
    plain = replace(request.request, target="")
    plan = Plan.of(request.planned, request.sampling, request.limits, plain)
    check = checker_of(plan, request.sampling, request.limits, request.request).check
    measures = measures_in(request.sampling.variety, plan.encounter)
    natural = NaturalScenarios.of(plan, check, request.sampling, request.planned.seed, measures)
    if not natural.size:
        raise InputError(
            "the scenarios have no freedom: all are the same, so there is nothing to search"
        )
    journal_path = out.with_name(out.name + JOURNAL)
    with replaced_folder(out, SEARCHED) as folder, open_journal(journal_path, identity) as journal:
        with trial_runner(request.planner, config, workers or os.cpu_count() or 1) as run:
            problem = DrivenScenarios(
                natural,
                ego,
                plan.road,
                request.objective,
                run,
                journal,
                lambda done: progress(done, request.budget),
            )
            search = Search(
                problem, request.seed, request.budget, request.worst, told=(COLLISION, AT_FAULT)
            )
            estimate = search.run()
            findings = findings_of(search, problem, config)
        names = (JSON, PAGE, JUNIT, *((BAG,) if findings else ()))
        result = SearchResult(
            estimate, findings, request.worst, (*(out / name for name in names), journal_path)
        )
        _write(folder, result, request, identity, plan.requested)
    return result


def _write(
    folder: Path,
    result: SearchResult,
    request: SearchRequest,
    identity: dict[str, Any],
    asked: Any,
) -> None:
    document = _document(result, request, identity)
    write_text(
        folder / JSON, json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    )
    write_text(
        folder / JUNIT,
        as_junit([one.outcome for one in result.findings], request.planner, _facts(request)),
    )
    write_text(folder / PAGE, _page(result, request))
    if result.findings:
        encounter, fit = request.planned.encounter, request.planned.road_and_fit()[1]
        scenarios = tuple(
            one.scenario() for one in sorted(result.findings, key=lambda one: one.drive)
        )
        ego = request.request.ego_of(encounter)
        slot = None
        if ego is not None:  # the request left it out
            slot = EgoSlot(encounter.vehicles[ego], asked.start[ego], asked.end[ego])
            scenarios = tuple(with_witness(one, ego) for one in scenarios)
        note = Note.of(NoteKind.SEARCHED, planner=request.planner)
        drawn = ScenarioSet(len(scenarios), scenarios, len(scenarios), Counter(), (note,), slot)
        texts = (
            value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
            for value in identity.values()
        )
        provenance = (
            dict(zip((f"search.{name}" for name in identity), texts, strict=True)) | versions()
        )
        delivered = replace(
            request.planned,
            fit=replace(fit, requested=asked),
            generated=drawn,
            provenance=provenance,
        )
        with BagWriter(folder / BAG) as bag:
            add_results(bag, {"": delivered})


def _facts(request: SearchRequest) -> dict[str, str]:
    return {"policy": request.drive_config().policy}


def _document(
    result: SearchResult, request: SearchRequest, identity: dict[str, Any]
) -> dict[str, Any]:
    e = result.estimate

    def rounded(value: float) -> float | None:
        return None if math.isnan(value) else float(f"{value:.6g}")

    def interval(share: Interval) -> dict[str, float | None]:
        return {name: rounded(value) for name, value in asdict(share).items()}

    plain = result.plain
    return {
        "rate": None if request.worst else interval(e.rate),
        "plain": {"failures": plain.count, "drives": plain.of, **interval(plain.share)},
        "drives": e.drives,
        "first_failure": e.first or None,
        "plain_drives_for_the_same_interval": None
        if request.worst
        else rounded(result.equal_plain),
        "rates": None
        if request.worst
        else {name: interval(each) for name, each in e.events.items()},
        "unexpected_at_most": rounded(e.unexpected),
        "bound": None if request.worst else rounded(e.bound),
        "natural_scenarios": e.seen,
        "valid_share_of_candidates": rounded(e.valid),
        "shares": {kind: rounded(value) for kind, value in sorted(e.shares.items())},
        "kinds": [
            {"kind": kind, "kept": len(own), "likeliest": own[0].trial.name}
            for kind, own in result.kinds.items()
        ],
        "findings": [one.document() for one in result.findings],
        "sentences": result.sentences(),
        "search": {**identity, "budget": request.budget},
    }


def _page(result: SearchResult, request: SearchRequest) -> str:
    ordered = [one for own in result.kinds.values() for one in own]
    outcomes, trials = [one.outcome for one in ordered], [one.trial for one in ordered]
    return render_page(
        "search.html.j2",
        ("scene.js", "drives.js", "tables.js"),
        drawings(outcomes, trials, range(len(ordered))),
        planner=request.planner,
        objective=str(request.objective),
        ego=request.ego_id(),
        title=request.planned.title,
        sentences=result.sentences(),
        kinds=result.kinds,
        shares=result.estimate.shares,
        rows=list(enumerate(ordered)),
        parameters={name: value for name, (_, value) in flatten(request.drive_config()).items()},
    )
