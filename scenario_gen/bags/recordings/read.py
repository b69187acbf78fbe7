# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Reads recordings: template, road, scenarios and requests of each namespace of a bag.

This is the only reader of the conventions' topics: evaluation, validation and search use it.
Messages are decoded when they are needed.
"""

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
import re

import numpy as np

from msg_conventions import documents
from msg_conventions.cdr import stamp_of
from msg_conventions.changepoints import decode_changepoints, decode_posterior
from msg_conventions.documents import DOCUMENTS, hash_of, head_of, LANES, PLAN
from msg_conventions.ego import WITNESS
from msg_conventions.fits import decode_plan
from msg_conventions.roads import decode_map
from msg_conventions.scenario_info import encode_info, INFO, RequestSummary, ScenarioEntry
from msg_conventions.scenarios import messages_of
from msg_conventions.tracks import decode_tracks
from scenario_gen.bags.recordings.scenarios import RecordedScenarios, Roads, SCENARIOS
from scenario_gen.bags.storage.bag import naming_bag, read_messages
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.bags.storage.messages import BagMessage
from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.types import (
    Decided,
    Encounter,
    Fit,
    GenerationResult,
    Road,
    Route,
    Scenario,
    Segmentation,
    token,
)

__all__ = [
    "INFO",
    "NO_ENTRY",
    "SCENARIOS",
    "WITNESS",
    "Namespace",
    "Recording",
    "RequestSummary",
    "ScenarioEntry",
    "ego_of",
    "load",
    "named_vehicle",
    "read_recording",
]

NO_ENTRY = f"{INFO} has no entry for them (lost with the end of a recording?)"

_TEMPLATE_TOPICS = (
    r"tracks|changepoints|map|fit(?:/info)?|road/(?:entries|exits|lanes)|vehicle_\w+/route"
    r"|ego/(?:start|goal)"
)
_OTHER_TOPICS = "posterior|ego/witness|scenarios|scenarios/info"
_TEMPLATE_TOPIC = re.compile(_TEMPLATE_TOPICS, re.DOTALL)
_TOPIC = re.compile(
    rf"(?:(?P<namespace>.*?)/)?(?P<topic>{_TEMPLATE_TOPICS}|{_OTHER_TOPICS})", re.DOTALL
)


@dataclass(frozen=True, eq=False)
class Recording:
    """A bag in memory; its namespaces by name ("" is the root), sorted."""

    path: Path
    namespaces: Mapping[str, "Namespace"]

    @property
    def results(self) -> tuple[str, ...]:
        """The namespaces with a template and scenarios."""
        return tuple(
            name
            for name, namespace in self.namespaces.items()
            if {"tracks", SCENARIOS} <= namespace.messages.keys()
        )

    @property
    def provenance(self) -> dict[str, str]:
        """Logs, seed, versions and parameters of the generation; different values joined by |."""
        values: dict[str, list[str]] = {}
        for namespace in self.namespaces.values():
            for summary in namespace.summaries:
                facts = {**summary.provenance, "seed": str(summary.seed)}
                for key, value in facts.items():
                    values.setdefault(key, []).append(value)
        return {key: " | ".join(dict.fromkeys(texts)) for key, texts in values.items()}


def read_recording(
    path: Path, config: BagConfig = BagConfig(), topics: Collection[str] = ()
) -> Recording:
    """Read the messages of a bag.

    Args:
        path: the bag.
        config: bounds of reading it.
        topics: names without namespace; none: all topics of the conventions. Scenarios include
            their witnesses.

    Raises:
        InputError: the bag does not exist, is damaged, or larger than `config` allows.
    """
    wanted = {*topics, WITNESS} if SCENARIOS in topics else set(topics)

    def parsed(name: str) -> re.Match[str] | None:
        match = _TOPIC.fullmatch(name)
        return match if match and (not topics or match["topic"] in wanted) else None

    messages: dict[str, dict[str, list[BagMessage]]] = {}
    for message in read_messages(path, lambda name: parsed(name) is not None, config):
        match = parsed(message.topic)
        if match:
            _refuse_draft(path, match["topic"], message.type)
            by_topic = messages.setdefault(match["namespace"] or "", {})
            by_topic.setdefault(match["topic"], []).append(message)
    roads: Roads = {}
    namespaces = {
        name: Namespace(path, name, by_topic, roads) for name, by_topic in sorted(messages.items())
    }
    return Recording(path, namespaces)


def _refuse_draft(path: Path, topic: str, kind: str) -> None:
    """Raise InputError if a message has the type that drafts of the conventions gave its topic."""
    if topic in (*DOCUMENTS, INFO) and kind != documents.TYPE:
        raise InputError(
            f"{path}: written by a draft of scenario_gen: {topic} is a {kind}; generate it again "
            f"from its tracks: `scenario-gen generate {path}`"
        )


class Namespace(RecordedScenarios):
    """The messages of one namespace of a bag.

    Properties for display (`segmentation`, `fit`, `entries`, …) omit missing and
    damaged messages; functions for checking or generating scenarios raise an error instead.
    """

    # The template and the road of one scenario.

    def tracks_of(self, entry: ScenarioEntry | None, stamp_ns: int) -> Encounter | None:
        """Return the tracks that an entry names, else the newest with the stamp, or None.

        Raises:
            InputError: a message is damaged.
        """
        wanted = entry.template_hash if entry else None
        named = [data for data in self.data("tracks") if wanted == hash_of("tracks", data)]
        data = named[0] if named else self.newest("tracks", stamp_ns)
        if not data:
            return None
        encounter = decode_tracks(data, self.where("tracks"))
        decision = entry.facts.decision if entry else None
        if decision is not None:
            encounter = replace(encounter, source=Decided(encounter.name, decision))
        return encounter

    def road_of(self, entry: ScenarioEntry | None, stamp_ns: int) -> Road | None:
        """Return the road that an entry names, else the newest with the stamp, or of all.

        Raises:
            InputError: a message is damaged.
        """
        maps = self.data("map")
        if entry is None or not entry.map_hash:
            data = self.newest("map", stamp_ns) or (maps[-1] if maps else None)
            return self._decode_road(data) if data else None
        for data in maps:
            if hash_of("map", data) == entry.map_hash:
                return self._decode_road(data)
        for data in maps:
            decode_map(data, name=self.where("map"))  # raises if it is damaged
        return None

    def _decode_road(self, data: bytes) -> Road:
        map_hash = hash_of("map", data)
        described = (
            each
            for each in reversed(self.data(LANES))
            if head_of(each, LANES).inputs.get("map") == map_hash
        )
        description = next(described, None)
        key = (map_hash, description, self.road_name)
        if key not in self._roads:
            _, road = decode_map(data, description, self.where("map"))
            self._roads[key] = replace(road, name=self.road_name)
        return self._roads[key]

    @cached_property
    def roads_differ(self) -> bool:
        """Whether a scenario without an entry may belong to any of several maps."""
        return (
            any(e.map_hash for e in self.entries)
            and len({hash_of("map", data) for data in self.data("map")}) > 1
        )

    def segmentation_of(self, encounter: Encounter) -> Segmentation | None:
        """Return the segmentation by the newest changepoints of an encounter, or None.

        Raises:
            InputError: a message is damaged.
        """
        data = self.newest("changepoints", encounter.start_ns)
        return decode_changepoints(data, encounter, self.where("changepoints")) if data else None

    def template_messages(self, entry: ScenarioEntry, stamp_ns: int) -> dict[str, BagMessage]:
        """Return the inputs of a scenario by topic: template, road, fit, routes, ego.

        For each topic, this is the message that `fit/info` names together with the scenario's map
        and template; if it names none, the newest message with the stamp (or the newest map).

        Raises:
            InputError: a message is damaged.
        """
        hashes = self._fit_hashes(entry)

        def is_input(topic: str, message: BagMessage) -> bool:
            if topic in hashes:
                return hash_of(topic, message.data) == hashes[topic]
            return topic not in DOCUMENTS and stamp_of(message.data, message.topic) == stamp_ns

        inputs_by_topic: dict[str, BagMessage] = {}
        for topic in filter(_TEMPLATE_TOPIC.fullmatch, self.messages):
            messages = self.messages[topic]
            chosen = [message for message in messages if is_input(topic, message)]
            if chosen or topic == "map":
                inputs_by_topic[topic] = (chosen or messages)[-1]
        return inputs_by_topic

    def _fit_hashes(self, entry: ScenarioEntry) -> dict[str, str]:
        """Return the hashes by topic in the last `fit/info` of an entry's inputs, with its own."""
        hashes: dict[str, str] = {}
        for data in self.data(PLAN):
            named = dict(head_of(data, PLAN).inputs)
            if (named.get("map"), named.get("tracks")) == (entry.map_hash, entry.template_hash):
                hashes = named | {PLAN: hash_of(PLAN, data)}
        return hashes

    def messages_of(
        self, info: BagMessage, entry: ScenarioEntry, summary: RequestSummary
    ) -> tuple[BagMessage, ...]:
        """Return the messages for a bag of one scenario: inputs, scenario, entry and summary.

        Args:
            info: the message of the entry.
            entry: the scenario's.
            summary: of its request.

        Raises:
            InputError: a message is damaged, or the scenario or its witness is missing.
        """
        messages = dict(zip(self.hashes, self.messages.get(SCENARIOS, ()), strict=True))
        if entry.sha256 not in messages:
            raise InputError(
                f"{self.path}: the scenario with SHA-256 {entry.sha256} is not on "
                f"{self.where(SCENARIOS)}"
            )
        if self.without_witness(entry):
            raise InputError(
                f"{self.path}: the reference drive with SHA-256 {entry.witness} is not on "
                f"{self.where(WITNESS)}"
            )
        message = messages[entry.sha256]
        parts = [message]
        if entry.messages:
            parts = [message._replace(data=data) for data in messages_of(message.data)]
        witness = [self.witnesses[entry.witness]] if entry.witness else []
        closing = info._replace(data=encode_info(summary.of_one_scenario()))
        inputs = self.template_messages(entry, entry.stamp).values()
        return (*inputs, *witness, *parts, info, closing)

    # To look at: the newest template.

    @cached_property
    def encounter(self) -> Encounter:
        """The newest tracks."""
        names = [entry.template for entry in self.entries if entry.template]
        name = names[-1] if names else f"{self.path.stem}{self.name}"
        encounter = decode_tracks(self.data("tracks")[-1], name)
        return (
            replace(encounter, source=self.summaries[-1].source) if self.summaries else encounter
        )

    @cached_property
    def road_name(self) -> str:
        """Name of the road by the last entry, else the map's topic."""
        names = [entry.road for entry in self.entries if entry.road]
        return names[-1] if names else self.where("map")

    @cached_property
    def road(self) -> Road | None:
        """The newest map."""
        maps = self.data("map")
        return self._decode_road(maps[-1]) if maps else None

    @cached_property
    def segmentation(self) -> Segmentation:
        """The newest segmentation, with labels and probabilities if recorded.

        Raises:
            InputError: the changepoints are damaged or of another template.
        """
        changepoints = self.data("changepoints")
        if not changepoints:
            steps = len(self.encounter.time)
            none = np.zeros(0, dtype=np.int64)
            return Segmentation(
                np.zeros(steps, dtype=np.int64), none, np.zeros(steps), ("the whole encounter",)
            )
        known = decode_changepoints(changepoints[-1], self.encounter, self.where("changepoints"))
        for data in reversed(self.data("posterior")):
            with suppress(InputError):
                whole = decode_posterior(data, known.descriptions)
                if len(whole.labels) == len(known.labels) and np.array_equal(
                    whole.changepoints, known.changepoints
                ):
                    return whole
        return known

    @cached_property
    def fit(self) -> tuple[Fit | None, tuple[Route, ...]]:
        """Fit and routes of the newest template; None and no routes without a valid `fit/info`."""
        for data in reversed(self.data(PLAN)):
            with suppress(InputError):
                plan = decode_plan(data)
                if plan.stamp == self.encounter.start_ns and np.array_equal(
                    plan.anchors[1:-1], self.segmentation.changepoints
                ):
                    return plan.fit(self.encounter), plan.routes
        return None, ()


def load(path: Path | str, namespace: str = "") -> GenerationResult:
    """Return a result from a bag: template and scenarios of its last request, not evaluated.

    Args:
        path: the bag of `GenerationResult.save` or `scenario-gen generate`.
        namespace: "" or e.g. "/case_2".

    Raises:
        InputError: the bag cannot be read, or the namespace or a scenario is missing.
    """
    return result_in(read_recording(Path(path)), namespace)


def result_in(recording: Recording, namespace: str = "") -> GenerationResult:
    """Return a result of a recording, as `load` does.

    Raises:
        InputError: the namespace is not among its `results`, or a scenario is missing.
    """
    if namespace not in recording.results:
        names = " or ".join(map(repr, recording.results))
        remedy = "no namespace has; is it a log?"
        if names:
            remedy = f"choose one: namespace={names}"
        raise InputError(
            f"{recording.path}: namespace {namespace!r} has no template with scenarios; {remedy}"
        )
    recorded = recording.namespaces[namespace]
    with naming_bag(recording.path):
        fit, routes = recorded.fit
        generated = recorded.scenario_set()
        seed = next((scenario.seed for scenario in generated), 0)
        return GenerationResult(
            recorded.encounter,
            recorded.segmentation,
            recorded.road,
            fit,
            routes,
            generated,
            seed,
            provenance=recording.provenance,
        )


def named_vehicle(ids: Sequence[str], name: str) -> str:
    """Return the first id that equals a name or has it as its token; "" if there is none."""
    return next((id_ for id_ in ids if name in (id_, token(id_))), "")


def ego_of(scenario: Scenario, entry: ScenarioEntry | None, asked: str, place: str) -> str:
    """Return the id of the vehicle that an ego replaces.

    Args:
        scenario: the scenario, with its reference drive if it has one.
        entry: its entry on `scenarios/info`, if known.
        asked: id or token of the vehicle; "": that of the ego slot, or the first.
        place: place of the scenario, for messages.

    Raises:
        InputError: there is no such vehicle, the scenario was made for another ego, or the
            reference drive is missing.
    """
    if scenario.reference_drive is not None:
        ego = scenario.reference_drive.vehicles[0].id
        if asked and not named_vehicle([ego], asked):
            raise InputError(
                f"{place}: it was made for ego {ego!r}; leave --ego out, or use --ego {ego}"
            )
        return ego
    ids = scenario.ids
    slot = entry.ego.id if entry and entry.ego else ""
    if slot and asked in ("", slot):
        raise InputError(
            f"{place}: it was made for ego {slot!r}, whose reference drive is not in the bag "
            f"(recorded before 0.6, or without `{WITNESS}`): generate it again, or name another "
            f"vehicle with --ego; it has {', '.join(ids)}"
        )
    ego = named_vehicle(ids, asked or ids[0])
    if not ego:
        raise InputError(
            f"{place}: no vehicle {asked!r} to be the ego; "
            f"it has {', '.join(ids)}{did_you_mean(asked, ids)}"
        )
    return ego
