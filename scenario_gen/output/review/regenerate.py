# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Regenerate a published scenario from its bag: template, road, parameters, seed and index.

With the same machine and versions, the bytes are mostly identical; on another CPU, positions agree
within a centimetre.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
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
from scenario_gen.base.errors import InputError, RefusedError, ScenarioGenError
from scenario_gen.base.folders import Kind, sha256_of
from scenario_gen.base.provenance import read_log_hashes, read_parameters, versions
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.method.decisions import decided
from scenario_gen.method.evaluation import MEASURES
from scenario_gen.method.fitting import fit_template, FittingConfig
from scenario_gen.method.routing import plan_routes, PlanningConfig
from scenario_gen.method.sampling import checker_of, Plan, regenerate, SamplingConfig
from scenario_gen.method.segmentation import segment, SegmentationConfig
from scenario_gen.method.shortening import cut
from scenario_gen.method.validity import Limits
from scenario_gen.situation import mirrored, Situation
from scenario_gen.types import Encounter, GenerationResult, Request, Scenario, Segmentation

REGENERATED = Kind("regenerated bag")
MAX_DISTANCE_M = 0.01  # between the same scenario on two CPUs
TEMPLATE = ("tracks", "changepoints", "map", "fit")


@dataclass(frozen=True, eq=False)
class Regenerated:
    """A regenerated scenario.

    Attributes:
        scenario: the scenario with its reference drive.
        data: its CDR bytes in the bag, whose SHA-256 is in `scenarios/info`.
        messages: its messages in the bag: template, road, routes, scenario and entry.
        sha256: SHA-256 of `data`.
        distance: largest distance [m] between the regenerated and the recorded positions; None if
            the bytes are identical.
    """

    scenario: Scenario
    data: bytes
    messages: tuple[BagMessage, ...]
    sha256: str
    distance: float | None

    @property
    def comparison(self) -> str:
        """The comparison with the recorded scenario in words."""
        if self.distance is None:
            return "the same bytes"
        return f"the same within {max(self.distance * 1e3, 0.001):.3f} mm"


def regenerate_scenario(
    bag: Path,
    index: int,
    *,
    namespace: str | None = None,
    request: str | None = None,
    log: Path | None = None,
    config: BagConfig = BagConfig(),
) -> Regenerated:
    """Regenerate scenario `index` of a bag and compare it with the recorded one.

    The bytes must be identical, or the positions equal within 1 cm. All inputs come from the bag;
    with `log`, tracks and changepoints come from that file, so that the whole chain is repeated.

    Args:
        bag: folder of the bag.
        index: index of the scenario in `scenarios/info`.
        namespace: its namespace, needed if several have such an index.
        request: id of its request, needed if several have such an index.
        log: the raw log.
        config: limits on the size of the bag.

    Raises:
        InputError: the bag, the index or a required message is missing or ambiguous, or the log is
            not the one of the bag.
        ScenarioGenError: the result differs, for example with another version; the message names
            the differing versions.
    """
    with naming_bag(bag):
        published = _find(bag, _entries(bag, config), index, namespace, request)
        return _regenerate(published, f"{bag}: request {published.entry.request}", log)


def recorded_scenarios(
    bag: Path, wanted: Iterable[tuple[str, int]], config: BagConfig = BagConfig()
) -> Iterator[tuple[tuple[BagMessage, ...], str]]:
    """Yield the messages of scenarios in a bag, and their SHA-256, by namespace and index.

    Raises:
        InputError: one is missing or ambiguous.
    """
    with naming_bag(bag):
        entries = _entries(bag, config)
        for namespace, index in wanted:
            published = _find(bag, entries, index, namespace, None)
            yield published.messages, published.entry.sha256


def _regenerate(published: "_Published", origin: str, log: Path | None) -> Regenerated:
    """Regenerate a published scenario; `origin` names bag and request in messages."""
    entry = published.entry
    source = _replan(published, origin, log)
    requested, sampling = source.request, source.sampling
    plan = Plan.of(source.planned, sampling, source.limits, requested)
    check = None
    if requested.target or requested.order == "swap":  # these proposals depend on the checks
        check = checker_of(plan, sampling, source.limits, requested).check
    scenario = regenerate(
        plan,
        sampling,
        seed=entry.seed,
        index=entry.index,
        request=requested,
        check=check,
        measures=MEASURES,
    )
    recorded, witness = published.namespace.published(entry)
    if scenario is None or bool(witness) != (scenario.reference_drive is not None):
        raise _differs(published, origin)
    pairs = [(scenario, recorded)]
    if scenario.reference_drive is not None:
        pairs.append((scenario.reference_drive, witness))
    encounter = source.planned.encounter
    distances = [distance_apart(made, encounter, data) for made, data in pairs]
    known = [distance for distance in distances if distance is not None]
    distance = max(known, default=None)
    if distance is not None and distance > MAX_DISTANCE_M:
        raise _differs(published, origin)
    return Regenerated(scenario, recorded, published.messages, entry.sha256, distance)


def _differs(published: "_Published", origin: str) -> ScenarioGenError:
    """Return the error for a scenario that differs from the published one."""
    recorded, current = published.summary.values, versions()
    changes = [
        f"{name} was {recorded[name]}, is {current[name]}"
        for name in current
        if recorded.get(name, current[name]) != current[name]
    ]
    reason = ", ".join(changes) or "the versions agree, so the bag was changed"
    index = published.entry.index
    return ScenarioGenError(f"{origin}: regenerated scenario {index} differs: {reason}")


@dataclass(frozen=True, eq=False)
class Replanned:
    """The source of the scenarios of a request: template on its road, request, parameters."""

    planned: GenerationResult
    request: Request
    sampling: SamplingConfig
    limits: Limits


def replanned(
    bag: Path, namespace: str | None = None, config: BagConfig = BagConfig()
) -> Replanned:
    """Return the source of the scenarios of a bag; of its first request, if it has several.

    Args:
        bag: folder of the bag.
        namespace: needed if several namespaces have scenarios.
        config: limits on the size of the bag.

    Raises:
        InputError: the bag or a required message is missing, or several namespaces have scenarios.
    """
    with naming_bag(bag):
        entries = _entries(bag, config)
        decisions = {where.name: entry.facts.decision for where, entry, _ in entries}
        names = sorted(decisions)
        if namespace is None and len(names) > 1:
            known = [f"{name} ({decisions[name]})" if decisions[name] else name for name in names]
            raise InputError(
                f"{bag}: {len(names)} namespaces hold scenarios; choose one: --namespace "
                f"{' or '.join(known)}"
            )
        matching = [entry for where, entry, _ in entries if namespace in (None, where.name)]
        if not matching:
            raise InputError(
                f"{bag}: no namespace {namespace!r}; there is {', '.join(map(repr, names))}"
            )
        first = matching[0]
        published = _find(bag, entries, first.index, namespace, first.request)
        source = _replan(published, f"{bag}: request {published.entry.request}", None)
        facts, planned = published.entry.status.values, source.planned
        road, placed = planned.road_and_fit()
        fit = published.namespace.fit[0]  # has decisions that a request's messages lack
        if fit is not None and not source.request.moves:
            placed = replace(fit, requested=placed.requested)
        encounter = replace(planned.encounter, name=facts.get("template", planned.encounter.name))
        planned = replace(
            planned,
            encounter=encounter,
            road=replace(road, name=facts.get("road", road.name)),
            fit=placed,
        )
        return replace(source, planned=planned)


def _replan(published: "_Published", origin: str, log: Path | None) -> Replanned:
    """Return the source of a scenario; `origin` names bag and request in messages."""
    values, seed = published.summary.values, published.entry.seed
    requested = Request(
        **{entry.name: values.get(entry.name, str(entry.default)) for entry in fields(Request)}
    )
    template = published.template(origin)
    sampling = read_parameters(SamplingConfig(), values, "sampling.", origin)
    limits = read_parameters(Limits(), values, "limits.", origin)
    planned = replace(template, seed=seed)
    if requested.moves or log is not None:  # the bag's fit may belong to another request
        encounter = template.encounter
        segmentation = template.segmentation
        road, _ = template.road_and_fit()
        if log is not None:
            encounter, segmentation = _from_log(log, encounter, published.summary, seed, origin)
        fitting = read_parameters(FittingConfig(), values, "fitting.", origin)
        planning = read_parameters(PlanningConfig(), values, "planning.", origin)
        situation = Situation.of(encounter)
        fit = fit_template(
            situation, segmentation, road, fitting, request=requested, limits=limits
        )
        routes = plan_routes(road, fit, planning, seed, limits)
        planned = GenerationResult(encounter, segmentation, road, fit, routes, seed=seed)
    return Replanned(planned, requested, sampling, limits)


def write_regenerated(regenerated: Regenerated, folder: Path, inputs: Sequence[Path] = ()) -> Path:
    """Write the scenario, its entry and its template to a new bag; return `folder`.

    Args:
        regenerated: the scenario.
        folder: folder of the bag; an earlier output of this function is replaced.
        inputs: the bag and the log from which it was generated.

    Raises:
        InputError: the folder has other contents or an input, or cannot be written.
    """
    with atomic_bag(folder, REGENERATED, inputs) as bag:
        for message in regenerated.messages:
            add_message(bag, message.topic, message.data, message.stamp_ns)
    return folder


@dataclass(frozen=True, eq=False)
class _Published:
    """A scenario in a bag: its entry, the summary of its request, and its messages."""

    namespace: Namespace
    entry: ScenarioEntry
    summary: RequestSummary
    messages: tuple[BagMessage, ...]

    def template(self, origin: str) -> GenerationResult:
        """Return the template; `origin` names bag and request in messages.

        Raises:
            InputError: a required message is damaged, or not in the bag.
        """
        newest = {
            message.topic.removeprefix(self.namespace.where("")): message.data
            for message in self.messages
        }
        missing = missing_topics(newest)
        if missing:
            raise InputError(
                f"{origin} cannot be regenerated: the bag has no {', '.join(missing)} with the "
                "scenario's stamp"
            )
        template = decode_template(newest)
        encounter = replace(template.encounter, source=self.summary.source)
        return replace(template, encounter=encounter)


_Entry = tuple[Namespace, ScenarioEntry, BagMessage]


def _entries(bag: Path, config: BagConfig) -> list[_Entry]:
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
            f"{bag}: no scenario has an entry on `{INFO}`; only scenarios from this suite can be "
            "regenerated"
        )
    return entries


def _find(
    bag: Path, entries: Iterable[_Entry], index: int, namespace: str | None, request: str | None
) -> _Published:
    """Find the only scenario with this index among the entries of a bag.

    Raises:
        InputError: there is none, there are several, or its request was not closed.
    """
    candidates = [
        (where, entry, message)
        for where, entry, message in entries
        if namespace in (None, where.name) and request in (None, entry.request)
    ]
    same = [candidate for candidate in candidates if candidate[1].index == index]
    if not same:
        known = sorted({entry.index for _, entry, _ in candidates})
        some = ", ".join(map(str, known[:20])) + (", …" if len(known) > 20 else "")
        raise InputError(
            f"{bag}: no scenario {index}; it has: {some or 'none in that namespace and request'}"
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
            f"{bag}: request {entry.request} was not closed on {where.where(INFO)}: its "
            "parameters are missing"
        )
    return _Published(where, entry, summary, where.messages_of(info, entry, summary))


def _templates(encounters: Sequence[Encounter], recorded: Encounter) -> Iterator[Encounter]:
    """Yield what may be the recorded template: encounters, decided, shortened and mirrored."""
    for encounter in encounters:
        template = encounter
        with suppress(RefusedError, InputError):  # of another encounter from the log
            if recorded.decision is not None:
                template = decided(encounter, recorded.decision)
            if template.ids == recorded.ids:
                offset = (recorded.start_ns - template.start_ns) * 1e-9
                template = cut(template, recorded.time[recorded.present] + offset)
        if template.start_ns == recorded.start_ns:
            yield template
            yield mirrored(template)


def _from_log(
    log: Path, recorded: Encounter, summary: RequestSummary, seed: int, origin: str
) -> tuple[Encounter, Segmentation]:
    """Return the template and its changepoints from the raw log.

    Raises:
        InputError: the bag was made from another log, or does not name its log.
    """
    known = read_log_hashes(summary.values)
    if not known:
        raise InputError(
            f"{origin}: the bag does not name its log (ROS nodes do not know it); omit --log"
        )
    sha256 = sha256_of(log) if log.exists() else ""
    if sha256 not in known.values():
        listed = ", ".join(f"{name} (sha256 {text})" for name, text in known.items())
        fault = "does not exist"
        if sha256:
            fault = f"has sha256 {sha256}: it is another file, or was changed"
        raise InputError(f"{log} {fault}; the bag is from {listed}")
    config = read_parameters(LogConfig(), summary.values, "log.", origin)
    for candidate in _templates(read_log(log, config).encounters, recorded):
        if same_tracks(candidate, recorded):
            values = summary.values
            parameters = read_parameters(SegmentationConfig(), values, "segmentation.", origin)
            return candidate, segment(candidate, parameters, seed)
    raise InputError(
        f"{log}: none of its encounters is on the bag's tracks, although the file is the same"
    )
