# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The command `scenario-gen search`: find the failures of a planner and estimate their rate."""

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

from scenario_gen.bags.recordings.read import named_vehicle
from scenario_gen.bags.recordings.write import add_results
from scenario_gen.bags.storage.writer import BagWriter
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import Kind, replaced_folder, sha256_of, write_text
from scenario_gen.base.parameters import assigned, values_of
from scenario_gen.base.provenance import parameter_texts, versions
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.criteria import find_criteria
from scenario_gen.closed_loop.results import as_junit, drawings, Drives, JUNIT
from scenario_gen.closed_loop.search.estimate import Estimate, Search
from scenario_gen.closed_loop.search.findings import Finding, findings_of
from scenario_gen.closed_loop.search.journal import open_journal
from scenario_gen.closed_loop.search.objective import AT_FAULT, COLLISION, Objective
from scenario_gen.closed_loop.search.problem import DrivenScenarios
from scenario_gen.closed_loop.search.settings import SETTINGS
from scenario_gen.closed_loop.trials import find_planner, Rate, trial_runner
from scenario_gen.method.evaluation import measures_in, wilson
from scenario_gen.method.sampling import checker_of, NaturalScenarios, Plan, SamplingConfig
from scenario_gen.method.validity import Limits
from scenario_gen.output.report.html import render_page
from scenario_gen.types import (
    Decision,
    EgoSlot,
    GenerationResult,
    Interval,
    Note,
    NoteKind,
    Planned,
    Request,
    ScenarioSet,
    with_witness,
)

JSON = "search.json"
PAGE = "search.html"
BAG = "bag"
SEARCHED = Kind("searched")
JOURNAL = ".journal.jsonl"  # suffix to the name of the folder of results


@dataclass(frozen=True, eq=False)
class SearchRequest:
    """The parameters of a search.

    Attributes:
        planned: a template on its road, without scenarios.
        request: conditions on the scenarios.
        sampling: parameters of the sampler.
        limits: limits of valid scenarios.
        planner: MODULE:CLASS.
        ego: id of the vehicle that the planner replaces; "": that of the request, or the first.
        objective: definition of a failure.
        budget: largest number of drives.
        seed: of the search. Seed, planner and scenarios determine the result.
        worst: search for the worst failures instead of the rate.
        assignments: parameters of a drive as name=value.
    """

    planned: Planned
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
        """Return the id of the vehicle that the planner replaces.

        Raises:
            InputError: there is no such vehicle.
        """
        ids = [vehicle.id for vehicle in self.planned.encounter.vehicles]
        wanted = self.ego or self.request.ego or ids[0]
        vehicle = named_vehicle(ids, wanted)
        if not vehicle:
            raise InputError(
                f"--ego {wanted}: there is no such vehicle; there are {', '.join(ids)}"
            )
        return vehicle

    def identity(self) -> dict[str, Any]:
        """Return everything that determines the drives; the budget does not change them."""
        config = self.drive_config()
        criteria = find_criteria(config.criteria)
        return {
            "template": self.planned.encounter.name,
            "decision": str(self.planned.encounter.decision or ""),
            "road": self.planned.road.name,
            "scenarios": str(self.planned.seed),
            "request": parameter_texts(self.request),
            "sampling": parameter_texts(self.sampling),
            "limits": parameter_texts(self.limits),
            "planner": self.planner,
            "planner's file": _source_hash(find_planner(self.planner)),
            "criteria's files": [_source_hash(each.measure) for each in criteria],
            "drive": parameter_texts(config),
            "ego": self.ego_id(),
            "objective": str(self.objective),
            "seed": self.seed,
            "worst": self.worst,
            "versions": versions(),
        }

    def drive_config(self) -> ClosedLoopConfig:
        """Return the parameters of a drive.

        Raises:
            InputError: a name is unknown, or a value is not valid.
        """
        config = reduce(assigned, self.assignments, ClosedLoopConfig(limits=self.limits))
        return self.objective.configured(config)


def _source_hash(code: object) -> str:
    """Return the SHA-256 of the module of a class or instance; "" if it has no file."""
    source = Path(getattr(__import__(code.__module__, fromlist=["_"]), "__file__", None) or "")
    return sha256_of(source) if source.is_file() else ""


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The result of a search, the files with it, and the outcome that all scenarios have."""

    estimate: Estimate
    findings: Sequence[Finding]
    worst: bool
    written: Sequence[Path]
    decision: Decision | None = None

    @property
    def kinds(self) -> dict[str, list[Finding]]:
        """Findings by kind, the kind with the largest share of the rate first."""
        kinds: dict[str, list[Finding]] = {}
        for finding in self.findings:
            kinds.setdefault(finding.kind, []).append(finding)

        def weight(kind: str) -> float:
            return math.fsum(finding.weight or 0.0 for finding in kinds[kind])

        return {kind: kinds[kind] for kind in sorted(kinds, key=weight, reverse=True)}

    @property
    def plain(self) -> Rate:
        """The rate from the natural drives alone."""
        hits, total = self.estimate.plain
        return Rate(hits, total, wilson(hits, total, SETTINGS.confidence))

    @property
    def equal_plain(self) -> float:
        """Natural drives that would give an equally narrow interval; NaN without a failure."""
        rate = self.estimate.rate
        half_width = 0.5 * (rate.high - rate.low)
        if not (rate.value > 0.0 and half_width > 0.0):
            return math.nan
        z = float(special.ndtri(0.5 + 0.5 * SETTINGS.confidence))
        return z * z * rate.value * (1.0 - rate.value) / (half_width * half_width)

    def sentences(self) -> list[str]:
        """Return the result in sentences."""
        drives = self.estimate.drives
        if self.worst:
            return [
                f"{len(self.findings)} failure(s) shown, from {drives} drives; a search for the"
                " worst gives no rate"
            ]
        rate = self.estimate.rate
        if self.estimate.first:
            natural = f"at most {_share(rate.high)} of drives fail (95 %; none was seen to)"
            if rate.value > 0.0:
                interval = f"95 % interval {_share(rate.low)} to {_share(rate.high)}"
                natural = f"{_share(rate.value)} of drives fail ({interval})"
            messages = [
                f"{len(self.findings)} failures shown, the first in drive {self.estimate.first}"
                f" of {drives} steered drives",
                f"in natural traffic {natural}",
            ]
        else:
            messages = [
                f"no failure in {drives} drives; the natural drives bound the rate by"
                f" {_share(rate.high)} (95 %)"
            ]
        if self.decision is not None:
            weight = self.decision.probability
            low, high = _share(weight * rate.low), _share(weight * rate.high)
            messages.append(
                f"outcome: {self.decision} (probability {_share(weight)}); of all scenarios from"
                f" the encounter {low} to {high} fail in this way"
            )
        for name, share in self.estimate.events.items():
            event = "collisions by the ego's fault" if name == AT_FAULT else "collisions"
            interval = f"{_share(share.low)} to {_share(share.high)}"
            messages.append(f"{event}: {_share(share.value)} ({interval})")
        messages.append(f"natural drives alone: {self.plain}")
        if not math.isnan(self.equal_plain):
            messages.append(
                f"plain sampling would need {self.equal_plain:,.0f} drives for an equally narrow"
                " interval"
            )
        if self.estimate.first and not math.isnan(self.estimate.unexpected):
            messages.append(
                "failures that the regression does not expect: at most"
                f" {_share(self.estimate.unexpected)} (95 %)"
            )
        return messages


def _share(value: float) -> str:
    """Return a share in percent."""
    if math.isnan(value):
        return "–"
    return f"{100.0 * value if value > 1e-9 else 0.0:.3g} %"


def search_failures(
    request: SearchRequest,
    out: Path,
    *,
    workers: int = 0,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> SearchResult:
    """Search, and write search.json, search.html, junit.xml and a bag of the failures.

    A journal next to the folder has every drive. From it a stopped search continues, and a search
    with a larger budget, too.

    Args:
        request: the parameters of the search.
        out: folder of the results.
        workers: number of processes; 0: one for each core.
        progress: called with the number of completed drives and the budget.

    Raises:
        InputError: the planner fails, a vehicle or parameter is wrong, the journal belongs to
            another search, or a file cannot be written; the message names it.
        RefusedError: no scenario can be sampled.
    """
    if request.budget < 1:
        raise InputError(f"--budget {request.budget}: at least one drive is needed")
    config, ego = request.drive_config(), request.ego_id()
    identity = request.identity()
    plain = replace(request.request, target="")
    plan = Plan.of(request.planned, request.sampling, request.limits, plain)
    check = checker_of(plan, request.sampling, request.limits, request.request).check
    measures = measures_in(request.sampling.drivers, plan.encounter)
    natural = NaturalScenarios.of(plan, check, request.sampling, request.planned.seed, measures)
    if not natural.size:
        raise InputError("all scenarios of this template are equal, so there is nothing to search")
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
                problem,
                request.seed,
                request.budget,
                request.worst,
                event_names=(COLLISION, AT_FAULT),
            )
            estimate = search.run()
            findings = findings_of(search, problem, config)
        names = (JSON, PAGE, JUNIT, *((BAG,) if findings else ()))
        result = SearchResult(
            estimate,
            findings,
            request.worst,
            (*(out / name for name in names), journal_path),
            request.planned.encounter.decision,
        )
        _write(folder, result, request, identity, plan.requested)
    return result


def _write(
    folder: Path,
    result: SearchResult,
    request: SearchRequest,
    identity: dict[str, Any],
    requested: Any,
) -> None:
    """Write the files of a search into a folder."""
    document = _document(result, request, identity)
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)
    write_text(folder / JSON, text + "\n")
    outcomes = [finding.outcome for finding in result.findings]
    drives = Drives(outcomes, request.planner, request.drive_config())
    write_text(folder / JUNIT, as_junit(drives))
    write_text(folder / PAGE, _page(result, request))
    if result.findings:
        with BagWriter(folder / BAG) as bag:
            add_results(bag, {"": _failures(result, request, identity, requested)})


def _failures(
    result: SearchResult, request: SearchRequest, identity: dict[str, Any], requested: Any
) -> GenerationResult:
    """Return the failures as the scenarios of a generation, in the order of their drives."""
    encounter = request.planned.encounter
    ordered = sorted(result.findings, key=lambda finding: finding.drive)
    scenarios = tuple(finding.scenario(encounter.decision) for finding in ordered)
    ego = request.request.ego_of(encounter)
    slot = None
    if ego is not None:  # the request left it out
        slot = EgoSlot(encounter.vehicles[ego], requested.start[ego], requested.end[ego])
        scenarios = tuple(with_witness(scenario, ego) for scenario in scenarios)
    count = len(scenarios)
    note = Note.of(NoteKind.SEARCHED, planner=request.planner)
    provenance = {
        f"search.{name}": value
        if isinstance(value, str)
        else json.dumps(value, ensure_ascii=False)
        for name, value in identity.items()
    }
    generated = ScenarioSet(count, scenarios, count, Counter(), (note,), slot)
    failures = request.planned.with_scenarios(generated, requested)
    return replace(failures, provenance=provenance | versions())


def _rounded(value: float) -> float | None:
    return None if math.isnan(value) else float(f"{value:.6g}")


def _interval(share: Interval) -> dict[str, float | None]:
    return {name: _rounded(value) for name, value in asdict(share).items()}


def _document(
    result: SearchResult, request: SearchRequest, identity: dict[str, Any]
) -> dict[str, Any]:
    """Return the content of search.json."""
    estimate = result.estimate
    plain = result.plain
    rates = {name: _interval(rate) for name, rate in estimate.events.items()}
    plain_drives = _rounded(result.equal_plain)
    kinds = [
        {"kind": kind, "kept": len(findings), "likeliest": findings[0].trial.name}
        for kind, findings in result.kinds.items()
    ]
    return {
        **request.drive_config().facts(),
        "decision": result.decision.document() if result.decision else None,
        "rate": None if request.worst else _interval(estimate.rate),
        "plain": {"failures": plain.count, "drives": plain.of, **_interval(plain.share)},
        "drives": estimate.drives,
        "first_failure": estimate.first or None,
        "plain_drives_for_the_same_interval": None if request.worst else plain_drives,
        "rates": None if request.worst else rates,
        "unexpected_at_most": _rounded(estimate.unexpected),
        "bound": None if request.worst else _rounded(estimate.bound),
        "natural_scenarios": estimate.seen,
        "valid_share_of_candidates": _rounded(estimate.valid),
        "shares": {kind: _rounded(share) for kind, share in sorted(estimate.shares.items())},
        "kinds": kinds,
        "findings": [finding.document() for finding in result.findings],
        "sentences": result.sentences(),
        "search": {**identity, "budget": request.budget},
    }


def _page(result: SearchResult, request: SearchRequest) -> str:
    """Return search.html."""
    kinds = result.kinds
    ordered = [finding for kind in kinds for finding in kinds[kind]]
    outcomes = [finding.outcome for finding in ordered]
    trials = [finding.trial for finding in ordered]
    return render_page(
        "search.html.j2",
        ("scene.js", "drives.js", "tables.js"),
        drawings(outcomes, trials, range(len(ordered))),
        planner=request.planner,
        objective=str(request.objective),
        ego=request.ego_id(),
        title=request.planned.title,
        sentences=result.sentences(),
        kinds=kinds,
        shares=result.estimate.shares,
        rows=list(enumerate(ordered)),
        parameters=values_of(request.drive_config()),
    )
