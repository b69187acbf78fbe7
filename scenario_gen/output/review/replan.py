# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The source of published scenarios in a bag: template, road, routes, request and parameters."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path

from scenario_gen.bags.recordings.read import (
    INFO,
    Namespace,
    read_recording,
    RequestSummary,
    ScenarioEntry,
)
from scenario_gen.bags.recordings.template import decode_template, NEEDED
from scenario_gen.bags.storage.bag import naming_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.messages import BagMessage
from scenario_gen.base.errors import InputError
from scenario_gen.base.provenance import read_parameters
from scenario_gen.method.fitting import fit_template, FittingConfig
from scenario_gen.method.routing import plan_routes, PlanningConfig
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.validity import Limits
from scenario_gen.situation import Situation
from scenario_gen.types import Planned, Request


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


@dataclass(frozen=True, eq=False)
class Replanned:
    """The source of the scenarios of a request: template on its road, request, parameters."""

    planned: Planned
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
        source = _replan(published, f"{bag}: request {published.entry.request}")
        entry, planned = published.entry, source.planned
        encounter = planned.encounter
        encounter = replace(encounter, name=entry.template or encounter.name)
        planned = replace(
            planned,
            encounter=encounter,
            road=replace(planned.road, name=entry.road or planned.road.name),
        )
        return replace(source, planned=planned)


def _replan(published: "_Published", origin: str) -> Replanned:
    """Return the source of a scenario; `origin` names bag and request in messages."""
    values, seed = dict(published.summary.provenance), published.entry.seed
    if published.summary.ego is not None:
        values["ego"] = published.summary.ego.id
    requested = Request(
        **{entry.name: values.get(entry.name, str(entry.default)) for entry in fields(Request)}
    )
    template = published.template(origin)
    sampling = read_parameters(SamplingConfig(), values, "sampling.", origin)
    limits = read_parameters(Limits(), values, "limits.", origin)
    planned = replace(template, seed=seed)
    if requested.moves:  # the bag's fit may belong to another request
        encounter = template.encounter
        segmentation = template.segmentation
        road = template.road
        fitting = read_parameters(FittingConfig(), values, "fitting.", origin)
        planning = read_parameters(PlanningConfig(), values, "planning.", origin)
        situation = Situation.of(encounter)
        fit = fit_template(
            situation, segmentation, road, fitting, request=requested, limits=limits
        )
        routes = plan_routes(road, fit, planning, seed, limits)
        planned = Planned(encounter, segmentation, road, fit, routes, seed)
    return Replanned(planned, requested, sampling, limits)


@dataclass(frozen=True, eq=False)
class _Published:
    """A scenario in a bag: its entry, the summary of its request, and its messages."""

    namespace: Namespace
    entry: ScenarioEntry
    summary: RequestSummary
    messages: tuple[BagMessage, ...]

    def template(self, origin: str) -> Planned:
        """Return the template; `origin` names bag and request in messages.

        Raises:
            InputError: a required message is damaged, or not in the bag.
        """
        newest = {
            message.topic.removeprefix(self.namespace.where("")): message.data
            for message in self.messages
        }
        if missing := [topic for topic in NEEDED if topic not in newest]:
            raise InputError(f"{origin}: the bag has no {', '.join(missing)} for this scenario")
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
            for message, info in namespace.infos
            if isinstance(info, ScenarioEntry)
        ]
    if not entries:
        raise InputError(
            f"{bag}: no scenario has an entry on `{INFO}`; only scenarios from this suite have one"
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
