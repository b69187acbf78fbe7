# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One published scenario again from what its bag says: template, road, parameters, seed and index.

On the same machine and versions the bytes are mostly the same; on another CPU the places are, within a centimetre.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

from scenario_gen.bags.recordings.read import (
    INFO,
    Namespace,
    read_recording,
    RequestSummary,
    ScenarioEntry,
)
from scenario_gen.bags.recordings.template import decode_template, missing_topics
from scenario_gen.bags.recordings.write import add_message, distance_apart, same_tracks
from scenario_gen.bags.storage.bag import BagMessage, naming_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.writer import atomic_bag
from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.base.folders import Kind, sha256_of
from scenario_gen.base.provenance import read_parameters, versions
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import MEASURES
from scenario_gen.method.fitting import fit_template, FittingConfig
from scenario_gen.method.routing import plan_routes, PlanningConfig
from scenario_gen.method.sampling import checker_of, Plan, regenerate, SamplingConfig
from scenario_gen.method.segmentation import segment, SegmentationConfig
from scenario_gen.method.validity import Limits
from scenario_gen.situation import mirrored, Situation
from scenario_gen.types import Encounter, GenerationResult, Request, Scenario, Segmentation

REGENERATED = Kind("regenerated bag")
MOST_APART_M = 0.01  # of the same scenario on two CPUs
TEMPLATE = ("tracks", "changepoints", "map", "fit")


@dataclass(frozen=True, eq=False)
class Regenerated:
    """A scenario made again.

    Attributes:
        scenario: that of the bag, its reference drive too.
        data: its CDR bytes as they are in the bag, whose SHA-256 is that in `scenarios/info`.
        messages: those of the bag that belong to it (template, road, routes, its own, its entry), for a bag of its own.
        sha256: of `data`.
        distance: largest distance [m] of what was made from what is in the bag; None if the bytes are the same.
    """

    scenario: Scenario
    data: bytes
    messages: tuple[BagMessage, ...]
    sha256: str
    distance: float | None

    @property
    def comparison(self) -> str:
        """Which of the two was seen."""
        return (
            "the same bytes"
            if self.distance is None
            else f"the same within {max(self.distance * 1e3, 0.001):.3f} mm"
        )


def regenerate_scenario(
    bag: Path,
    index: int,
    *,
    namespace: str | None = None,
    request: str | None = None,
    log: Path | None = None,
    config: BagConfig = BagConfig(),
) -> Regenerated:
    """Make scenario `index` of a bag again and compare it with the recorded one: its bytes, or its places within 1 cm.

    Everything is taken from the bag; where `log` is given, tracks and changepoints are made from that file instead, so that
    the whole chain is repeated.

    Args:
        bag: its folder.
        index: as in `scenarios/info`.
        namespace: where several hold such an index.
        request: id, likewise.
        log: the raw log.
        config: what is read of the bag at most.

    Raises:
        InputError: the bag, the index, or something that is needed is not there or ambiguous; the log is another one.
        ScenarioGenError: it comes out differently (another version); the message names what differs.
    """
    with naming_bag(bag):
        found = _find(bag, index, namespace, request, config)
        return _regenerate(found, f"{bag}: request {found.entry.request}", log)


def _regenerate(found: "_Found", what: str, log: Path | None) -> Regenerated:
    """Make the scenario that was found; `what` names bag and request in messages."""
    values, seed, index = found.summary.values, found.entry.seed, found.entry.index
    known = _replan(found, what, log)
    encounter, requested, sampling = known.planned.encounter, known.request, known.sampling
    plan = Plan.of(known.planned, sampling, known.limits, requested)
    check = None
    if requested.target or requested.order == "swap":  # a proposal is found again with them
        check = checker_of(plan, sampling, known.limits, requested).check
    scenario = regenerate(
        plan, sampling, seed=seed, index=index, request=requested, check=check, measures=MEASURES
    )
    recorded, witness = found.namespace.published(found.entry)
    pairs = [] if scenario is None else [(scenario, recorded)]
    if scenario is not None and scenario.reference_drive is not None:
        pairs.append((scenario.reference_drive, witness))
    distances = [distance_apart(made, encounter, data) for made, data in pairs]
    distance = max((each for each in distances if each is not None), default=None)
    if (
        scenario is None
        or bool(witness) != (scenario.reference_drive is not None)
        or (distance or 0.0) > MOST_APART_M
    ):
        now = versions()
        other = [
            f"{name} {values[name]} there, {now[name]} here"
            for name in now
            if values.get(name, now[name]) != now[name]
        ]
        why = ", ".join(other) or "the versions agree, so the bag was changed"
        raise ScenarioGenError(f"{what}: scenario {index} comes out differently: {why}")
    return Regenerated(scenario, recorded, found.messages, found.entry.sha256, distance)


@dataclass(frozen=True, eq=False)
class Replanned:
    """What the scenarios of a recorded request were drawn from: the template on its road, the request and the parameters."""

    planned: GenerationResult
    request: Request
    sampling: SamplingConfig
    limits: Limits


def replanned(
    bag: Path, namespace: str | None = None, config: BagConfig = BagConfig()
) -> Replanned:
    """Return what the scenarios of a bag were drawn from; those of its first request, if there are several.

    Args:
        bag: its folder.
        namespace: where several hold scenarios.
        config: what is read of the bag at most.

    Raises:
        InputError: the bag or something that is needed is not there, or several namespaces hold scenarios.
    """
    with naming_bag(bag):
        entries = _entries(bag, config)
        names = sorted({where.name for where, _, _ in entries})
        if namespace is None and len(names) > 1:
            raise InputError(
                f"{bag}: {len(names)} namespaces hold scenarios; choose one: --namespace {' or '.join(names)}"
            )
        own = [entry for where, entry, _ in entries if namespace in (None, where.name)]
        if not own:
            raise InputError(
                f"{bag}: no namespace {namespace!r}; there is {', '.join(map(repr, names))}"
            )
        found = _find(bag, own[0].index, namespace, own[0].request, config)
        known = _replan(found, f"{bag}: request {found.entry.request}", None)
        facts, planned = found.entry.status.values, known.planned
        road, placed = planned.road_and_fit()
        fit = found.namespace.fit[
            0
        ]  # with what was decided, which the messages of one request do not hold
        if fit is not None and not known.request.moves:
            placed = replace(fit, requested=placed.requested)
        encounter = replace(planned.encounter, name=facts.get("template", planned.encounter.name))
        planned = replace(
            planned,
            encounter=encounter,
            road=replace(road, name=facts.get("road", road.name)),
            fit=placed,
        )
        return replace(known, planned=planned)


def _replan(found: "_Found", what: str, log: Path | None) -> Replanned:
    """Return what a scenario was drawn from; `what` names bag and request in messages."""
    values, seed = found.summary.values, found.entry.seed
    requested = Request(
        **{entry.name: values.get(entry.name, str(entry.default)) for entry in fields(Request)}
    )
    template = found.template(what)
    config = PipelineConfig(sampling=read_parameters(SamplingConfig(), values, "sampling.", what))
    config = replace(config, limits=read_parameters(Limits(), values, "limits.", what))
    planned = replace(template, seed=seed)
    if requested.moves or log is not None:  # what the bag has on `fit` need not be this request's
        encounter, segmentation, road = (
            template.encounter,
            template.segmentation,
            template.road_and_fit()[0],
        )
        if log is not None:
            encounter, segmentation = _from_log(log, encounter, found.summary, seed, what)
        fitting = read_parameters(FittingConfig(), values, "fitting.", what)
        planning = read_parameters(PlanningConfig(), values, "planning.", what)
        situation, limits = Situation.of(encounter), config.limits
        fit = fit_template(
            situation, segmentation, road, fitting, request=requested, limits=limits
        )
        routes = plan_routes(road, fit, planning, seed, limits)
        planned = GenerationResult(encounter, segmentation, road, fit, routes, seed=seed)
    return Replanned(planned, requested, config.sampling, config.limits)


def write_regenerated(regenerated: Regenerated, folder: Path, inputs: Sequence[Path] = ()) -> Path:
    """Write the scenario, its entry and its template to a bag of its own; return `folder`.

    Args:
        regenerated: the scenario.
        folder: of the bag; one that this function wrote there earlier is replaced.
        inputs: the bag, and the log, it was made from.

    Raises:
        InputError: the folder is there and is something else, holds an input, or cannot be written.
    """
    with atomic_bag(folder, REGENERATED, inputs) as bag:
        for message in regenerated.messages:
            add_message(bag, message.topic, message.data, message.stamp_ns)
    return folder


@dataclass(frozen=True, eq=False)
class _Found:
    """A scenario's entry in a bag, the summary of its request, and the messages that belong to it, its own among them."""

    namespace: Namespace
    entry: ScenarioEntry
    summary: RequestSummary
    messages: tuple[BagMessage, ...]

    def template(self, what: str) -> GenerationResult:
        """Return the template.

        Raises:
            InputError: a message that is needed is damaged, or not in the bag.
        """
        newest = {
            message.topic.removeprefix(self.namespace.where("")): message.data
            for message in self.messages
        }
        missing = missing_topics(newest)
        if missing:
            raise InputError(
                f"{what} cannot be made again: the bag has no {', '.join(missing)} with the scenario's stamp"
            )
        return decode_template(newest)


def _entries(bag: Path, config: BagConfig) -> list[tuple[Namespace, ScenarioEntry, BagMessage]]:
    """Return every scenario's entry with its namespace and message.

    Raises:
        InputError: there is none.
    """
    entries = []
    for namespace in read_recording(bag, config).namespaces.values():
        namespace.check_infos()
        entries += [
            (namespace, info, message)
            for message, infos in namespace.infos
            for info in infos
            if isinstance(info, ScenarioEntry)
        ]
    if not entries:
        raise InputError(
            f"{bag}: no scenario has an entry on `{INFO}`; only what this suite published can be made again"
        )
    return entries


def _find(
    bag: Path, index: int, namespace: str | None, request: str | None, config: BagConfig
) -> _Found:
    """Find the one scenario of that index.

    Raises:
        InputError: there is none, several, or its request was not closed.
    """
    entries = _entries(bag, config)
    own = [
        found
        for found in entries
        if namespace in (None, found[0].name) and request in (None, found[1].request)
    ]
    same = [found for found in own if found[1].index == index]
    if not same:
        known = sorted({entry.index for _, entry, _ in own})
        some = ", ".join(map(str, known[:20])) + (", …" if len(known) > 20 else "")
        raise InputError(
            f"{bag}: no scenario {index}; there are: {some or 'none in that namespace and request'}"
        )
    if len(same) > 1:
        places = "; ".join(
            f"--namespace '{where.name}' --request {entry.request}" for where, entry, _ in same
        )
        raise InputError(f"{bag}: {len(same)} scenarios have number {index}; choose one: {places}")
    ((where, entry, info),) = same
    summary = next(
        (
            candidate
            for candidate in reversed(where.summaries)
            if candidate.request == entry.request
        ),
        None,
    )
    if summary is None:
        raise InputError(
            f"{bag}: request {entry.request} was not closed on {where.where(INFO)}: its parameters are missing"
        )
    return _Found(where, entry, summary, where.messages_of(info, entry, summary))


def _from_log(
    log: Path, recorded: Encounter, summary: RequestSummary, seed: int, what: str
) -> tuple[Encounter, Segmentation]:
    """The template and its changepoints from the raw log.

    Raises:
        InputError: it is not the log that the bag was made from, or the bag does not say which that was.
    """
    known = {
        name: text.removeprefix("sha256 ")
        for name, text in summary.values.items()
        if name.startswith("log ")
    }
    if not known:
        raise InputError(
            f"{what}: the bag does not say which log it was made from (nodes do not know it); leave --log out"
        )
    own = sha256_of(log) if log.exists() else ""
    if own not in known.values():
        there = ", ".join(
            f"{name.removeprefix('log ')} (sha256 {text})" for name, text in known.items()
        )
        is_missing = (
            "is not there" if not own else f"has sha256 {own}: it is another file, or was changed"
        )
        raise InputError(f"{log} {is_missing}; the bag was made from {there}")
    config = read_parameters(LogConfig(), summary.values, "log.", what)
    images = (
        each
        for e in read_log(log, config).encounters
        if e.start_ns == recorded.start_ns
        for each in (e, mirrored(e))
    )
    same = [e for e in images if same_tracks(e, recorded)]
    if not same:
        raise InputError(
            f"{log}: no encounter in it is the one on the bag's tracks, though the file is the same"
        )
    return same[0], segment(
        same[0], read_parameters(SegmentationConfig(), summary.values, "segmentation.", what), seed
    )
