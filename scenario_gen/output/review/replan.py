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
from scenario_gen.bags.storage.messages import BagMessage
from scenario_gen.base.errors import InputError
from scenario_gen.base.provenance import read_parameters
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.fitting import FittingConfig
from scenario_gen.method.routing import PlanningConfig
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.validity import Limits
from scenario_gen.situation import Situation
from scenario_gen.types import Planned, Request


def recorded_scenarios(
    bag: Path, wanted: Iterable[tuple[str, int]]
) -> Iterator[tuple[tuple[BagMessage, ...], str]]:
    """Yield the messages of scenarios in a bag, and their SHA-256, by namespace and index.

    Raises:
        InputError: one is missing, or its request was not closed.
    """
    with naming_bag(bag):
        entries = {(each[0].name, each[1].index): each for each in _entries(bag)}
        for namespace, index in wanted:
            if (namespace, index) not in entries:
                known = [str(number) for name, number in sorted(entries) if name == namespace]
                raise InputError(
                    f"{bag}: no scenario {index}; it has: {', '.join(known) or 'none there'}"
                )
            where, entry, info = entries[namespace, index]
            yield where.messages_of(info, entry, _summary_of(where, entry)), entry.sha256


@dataclass(frozen=True, eq=False)
class Replanned:
    """The source of the scenarios of a request: template on its road, request, parameters."""

    planned: Planned
    request: Request
    sampling: SamplingConfig
    limits: Limits


def replanned(bag: Path, namespace: str | None = None) -> Replanned:
    """Return the source of the scenarios of a bag; of its first request, if it has several.

    Args:
        bag: folder of the bag.
        namespace: needed if several namespaces have scenarios.

    Raises:
        InputError: the bag or a required message is missing, or several namespaces have scenarios.
    """
    with naming_bag(bag):
        entries = _entries(bag)
        decisions = {where.name: entry.facts.decision for where, entry, _ in entries}
        names = sorted(decisions)
        if namespace is None and len(names) > 1:
            known = [f"{name} ({decisions[name]})" if decisions[name] else name for name in names]
            raise InputError(
                f"{bag}: {len(names)} namespaces hold scenarios; choose one: --namespace "
                f"{' or '.join(known)}"
            )
        for where, entry, info in entries:
            if namespace in (None, where.name):
                return _replan(where, entry, info, f"{bag}: request {entry.request}")
        raise InputError(
            f"{bag}: no namespace {namespace!r}; there is {', '.join(map(repr, names))}"
        )


def _replan(where: Namespace, entry: ScenarioEntry, info: BagMessage, origin: str) -> Replanned:
    """Return the source of a scenario; `origin` names bag and request in messages."""
    summary = _summary_of(where, entry)
    template = _template(where, where.messages_of(info, entry, summary), origin)
    name = entry.template or template.encounter.name
    encounter = replace(template.encounter, source=summary.source, name=name)
    road = replace(template.road, name=entry.road or template.road.name)
    template = replace(template, encounter=encounter, road=road, seed=entry.seed)
    values = dict(summary.provenance)
    if summary.ego is not None:
        values["ego"] = summary.ego.id
    requested = Request(
        **{field.name: values.get(field.name, str(field.default)) for field in fields(Request)}
    )
    sampling = read_parameters(SamplingConfig(), values, "sampling.", origin)
    limits = read_parameters(Limits(), values, "limits.", origin)
    if requested.moves:  # the bag's fit may belong to another request
        fitting = read_parameters(FittingConfig(), values, "fitting.", origin)
        planning = read_parameters(PlanningConfig(), values, "planning.", origin)
        config = PipelineConfig(fitting=fitting, planning=planning, limits=limits)
        situation = Situation.of(encounter)
        inputs = (situation, template.segmentation, road)
        template = Chain(*inputs, config, requested, seed=entry.seed).plan()
    return Replanned(template, requested, sampling, limits)


def _template(where: Namespace, messages: Iterable[BagMessage], origin: str) -> Planned:
    """Return the template in the messages of a scenario.

    Raises:
        InputError: a required message is damaged, or not in the bag.
    """
    newest = {message.topic.removeprefix(where.where("")): message.data for message in messages}
    if missing := [topic for topic in NEEDED if topic not in newest]:
        raise InputError(f"{origin}: the bag has no {', '.join(missing)} for this scenario")
    return decode_template(newest)


def _entries(bag: Path) -> list[tuple[Namespace, ScenarioEntry, BagMessage]]:
    """Return every scenario's entry with its namespace and message.

    Raises:
        InputError: there is none.
    """
    entries = []
    for namespace in read_recording(bag).namespaces.values():
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


def _summary_of(where: Namespace, entry: ScenarioEntry) -> RequestSummary:
    """Return the last summary of the request of a scenario.

    Raises:
        InputError: it was not closed.
    """
    for summary in reversed(where.summaries):
        if summary.request == entry.request:
            return summary
    raise InputError(
        f"request {entry.request} was not closed on {where.where(INFO)}: its parameters are "
        "missing"
    )
