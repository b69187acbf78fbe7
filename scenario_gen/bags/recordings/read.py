# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings read: template, road, scenarios and requests of each namespace of a bag, decoded when they are needed.

The one reader of the conventions' topics, whoever recorded them: evaluation, validation and regeneration use it.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
import re

import numpy as np

from msg_conventions import fits
from msg_conventions.cdr import stamp_of
from msg_conventions.changepoints import (
    decode_changepoints,
    decode_posterior,
    segment_descriptions,
)
from msg_conventions.ego import WITNESS
from msg_conventions.hashes import decode_hashes, hash_of
from msg_conventions.roads import decode_map
from msg_conventions.scenario_info import encode_info, INFO, RequestSummary, ScenarioEntry
from msg_conventions.scenarios import messages_of
from msg_conventions.tracks import decode_tracks
from scenario_gen.bags.recordings.scenarios import RecordedScenarios, SCENARIOS
from scenario_gen.bags.recordings.template import (
    anchor_index,
    decode_routes,
    lanes_beside,
    template_statuses,
)
from scenario_gen.bags.storage.bag import BagMessage, naming_bag, read_messages
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError
from scenario_gen.types import (
    Encounter,
    Fit,
    GenerationResult,
    Note,
    NoteKind,
    Road,
    Route,
    ScenarioSet,
    Segmentation,
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
    "load",
    "read_recording",
    "read_scenario_set",
]

NO_ENTRY = f"{INFO} has no entry for them (lost with the end of a recording?)"
TEMPLATE_TOPICS = r"tracks|changepoints|map|fit|road/entries|road/exits|road/lanes|vehicle_\w+/route|ego/(?:start|goal)"
TEMPLATE = re.compile(TEMPLATE_TOPICS, re.DOTALL)
READ = re.compile(
    rf"(?:(?P<namespace>.*?)/)?(?P<topic>{TEMPLATE_TOPICS}|posterior|fit/info|ego/witness|scenarios|scenarios/info|diagnostics)",
    re.DOTALL,
)
Statuses = Mapping[str, Mapping[str, str]]  # key-values of diagnostics, by subject


@dataclass(frozen=True, eq=False)
class Recording:
    """A bag, read once: `namespaces` by name ("" is the root), sorted."""

    path: Path
    namespaces: Mapping[str, "Namespace"]

    @property
    def results(self) -> tuple[str, ...]:
        """The namespaces that hold a template with scenarios."""
        return tuple(
            name
            for name, one in self.namespaces.items()
            if {"tracks", SCENARIOS} <= one.messages.keys()
        )

    @property
    def provenance(self) -> dict[str, str]:
        """How its scenarios were generated: logs, seed, versions, parameters; different values side by side."""
        found: dict[str, list[str]] = {}
        for namespace in self.namespaces.values():
            for summary in namespace.summaries:
                for key, value in summary.provenance.items():
                    found.setdefault(key, []).append(value)
        return {key: " | ".join(dict.fromkeys(values)) for key, values in found.items()}


def read_recording(
    path: Path, config: BagConfig = BagConfig(), topics: Collection[str] = ()
) -> Recording:
    """Read the messages of a bag.

    Args:
        path: of the bag.
        config: what is read at most.
        topics: names without namespace; none: all topics of the conventions. With scenarios come their witnesses.

    Raises:
        InputError: the bag is missing or damaged, or larger than `config` allows.
    """
    wanted = {*topics, *((WITNESS,) if SCENARIOS in topics else ())}

    def known(name: str) -> re.Match[str] | None:
        match = READ.fullmatch(name)
        return match if match and (not topics or match["topic"] in wanted) else None

    found: dict[str, dict[str, list[BagMessage]]] = {}
    for message in read_messages(path, lambda name: known(name) is not None, config):
        if match := known(message.topic):
            found.setdefault(match["namespace"] or "", {}).setdefault(match["topic"], []).append(
                message
            )
    shared = [
        message.data for message in found.get("", {}).get("diagnostics", ())
    ]  # one topic for the nodes of all namespaces
    roads: Roads = {}
    return Recording(
        path,
        {
            name: Namespace(path, name, messages, shared, roads)
            for name, messages in sorted(found.items())
        },
    )


Roads = dict[tuple[str, bytes | None, str], Road]
"""Those of a bag, by their map's hash, lanes and name: what is derived from a road is large, and derived once."""


class Namespace(RecordedScenarios):
    """What a bag holds in one namespace.

    Properties for people to look at (`statuses`, `segmentation`, `fit`, `entries`, …) leave out what is missing or damaged; what
    a scenario is checked against or generated from raises an error then.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        messages: Mapping[str, Sequence[BagMessage]],
        shared: Sequence[bytes],
        roads: "Roads",
    ) -> None:
        """Take the bag's path, the namespace's name, its messages by topic, and /diagnostics and roads of all namespaces."""
        super().__init__(path, name, messages)
        self._shared, self._roads = shared, roads

    # The template and the road of one scenario.

    def tracks_of(self, entry: ScenarioEntry | None, stamp_ns: int) -> Encounter | None:
        """Return the tracks that an entry names, else the newest ones of the stamp; None if there are none.

        Raises:
            InputError: a message is damaged.
        """
        own = entry.template_hash if entry else None
        data = next(
            (data for data in self.data("tracks") if own and hash_of("tracks", data) == own), None
        )
        data = data or self.newest("tracks", stamp_ns)
        return decode_tracks(data, self.where("tracks")) if data else None

    def road_of(self, entry: ScenarioEntry | None, stamp_ns: int) -> Road | None:
        """Return the road whose map an entry names; where it names none, the newest one of the stamp, or of all.

        Raises:
            InputError: a message is damaged.
        """
        maps, what = self.data("map"), self.where("map")
        if entry is not None and entry.map_hash:
            data = next((data for data in maps if hash_of("map", data) == entry.map_hash), None)
            for other in maps if data is None else ():
                decode_map(other, name=what)  # it may be the one that is damaged
        else:
            data = self.newest("map", stamp_ns) or (maps[-1] if maps else None)
        return self._decode_road(data) if data else None

    def _decode_road(self, data: bytes) -> Road:
        lanes = lanes_beside(
            data, self.data("map"), self.data("road/lanes"), self.data("fit/info")
        )
        key = (hash_of("map", data), lanes, self.road_name)
        if key not in self._roads:
            self._roads[key] = replace(
                decode_map(data, lanes=lanes, name=self.where("map"))[1], name=self.road_name
            )
        return self._roads[key]

    @cached_property
    def roads_differ(self) -> bool:
        """Whether a scenario without an entry may belong to any of several maps, while entries name theirs."""
        return (
            any(e.map_hash for e in self.entries)
            and len({hash_of("map", data) for data in self.data("map")}) > 1
        )

    def segmentation_of(self, encounter: Encounter) -> Segmentation | None:
        """Return the segmentation of the newest changepoints of an encounter, None if there are none.

        Raises:
            InputError: a message is damaged.
        """
        data = self.newest("changepoints", encounter.start_ns)
        return decode_changepoints(data, encounter, self.where("changepoints")) if data else None

    def template_messages(self, entry: ScenarioEntry, stamp_ns: int) -> dict[str, BagMessage]:
        """Return what a scenario was generated from, by topic: template, road, fit, routes, ego.

        Of each topic this is the message that `fit/info` names beside the scenario's map and template; where it names none, the
        newest message of the stamp (of maps without that stamp: the newest).

        Raises:
            InputError: a message is damaged.
        """
        together: dict[str, str] = {}
        for message in self.messages.get("fit/info", ()):
            hashes = decode_hashes(message.data, message.topic)
            if hashes.get("map") == entry.map_hash and hashes.get("tracks") == entry.template_hash:
                together = hashes
        found: dict[str, BagMessage] = {}
        for topic, messages in self.messages.items():
            if not TEMPLATE.fullmatch(topic):
                continue
            own = [
                m
                for m in messages
                if topic not in together or hash_of(topic, m.data) == together[topic]
            ]
            of_stamp = [m for m in own if stamp_of(m.data, m.topic) == stamp_ns]
            if of_stamp or (own and topic == "map"):
                found[topic] = (of_stamp or own)[-1]
        return found

    def published(self, entry: ScenarioEntry) -> tuple[bytes, bytes]:
        """Return the bytes of a scenario and of its witness, empty if there is none."""
        pairs = zip(self.messages.get(SCENARIOS, ()), self.hashes, strict=True)
        data = next((message.data for message, sha256 in pairs if sha256 == entry.sha256), b"")
        return data, self.witnesses[entry.witness].data if entry.witness else b""

    def messages_of(
        self, info: BagMessage, entry: ScenarioEntry, summary: RequestSummary
    ) -> tuple[BagMessage, ...]:
        """Return the messages for a bag of one scenario: its template, the scenario, its entry, and a summary of it alone.

        Args:
            info: the message of the entry.
            entry: the scenario's.
            summary: of its request.

        Raises:
            InputError: a message is damaged, or the scenario itself or its witness is not in the bag.
        """
        stamp = stamp_of(info.data, info.topic)
        same = [
            m
            for m, sha256 in zip(self.messages.get(SCENARIOS, ()), self.hashes, strict=True)
            if sha256 == entry.sha256
        ]
        if not same:
            raise InputError(
                f"{self.path}: the scenario with SHA-256 {entry.sha256} is not on {self.where(SCENARIOS)}"
            )
        closing = replace(info, data=encode_info(summary.of_one_scenario(), stamp))
        own = (
            [replace(same[-1], data=data) for data in messages_of(same[-1].data)]
            if len(entry.messages) > 1
            else same[-1:]
        )
        if self.without_witness(entry):
            raise InputError(
                f"{self.path}: the reference drive with SHA-256 {entry.witness} is not on {self.where(WITNESS)}"
            )
        witness = (self.witnesses[entry.witness],) if entry.witness else ()
        return (*self.template_messages(entry, stamp).values(), *witness, *own, info, closing)

    # To look at: the newest template and the diagnostics about it.

    @cached_property
    def encounter(self) -> Encounter:
        """The newest tracks."""
        encounter = decode_tracks(self.data("tracks")[-1], f"{self.path.stem}{self.name}")
        return (
            replace(encounter, source=self.summaries[-1].source) if self.summaries else encounter
        )

    @cached_property
    def statuses(self) -> Statuses:
        """The diagnostics about the newest template; the last value counts."""
        stamp = self.encounter.start_ns
        return template_statuses(self._shared, stamp, f"{self.name}/") | template_statuses(
            self.data("diagnostics"), stamp
        )

    @cached_property
    def road_name(self) -> str:
        """Name of the road, by the entries; else the map's topic."""
        return next(
            (entry.road for entry in reversed(self.entries) if entry.road), self.where("map")
        )

    @cached_property
    def road(self) -> Road | None:
        """The newest map."""
        maps = self.data("map")
        return self._decode_road(maps[-1]) if maps else None

    @cached_property
    def segmentation(self) -> Segmentation:
        """The newest segmentation, with shared labels, probabilities and sentences where the bag has them.

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
        texts = segment_descriptions(self.statuses)
        if len(texts) != len(known.descriptions):
            texts = known.descriptions
        for data in reversed(self.data("posterior")):
            try:
                whole = decode_posterior(data, texts)
            except InputError:
                continue
            if len(whole.labels) == len(known.labels) and np.array_equal(
                whole.changepoints, known.changepoints
            ):
                return whole
        return Segmentation(known.labels, known.changepoints, known.changepoint_probability, texts)

    @cached_property
    def fit(self) -> tuple[Fit | None, tuple[Route, ...]]:
        """Fit and routes of the newest template; None and no routes unless both are there with all that the fitting decided."""
        encounter, changepoints = self.encounter, self.segmentation.changepoints
        stamps = fits.anchor_stamps(encounter, changepoints)
        try:
            topics = [topic for topic in self.messages if topic.endswith(("fit", "/route"))]
            messages = {
                topic: data for topic in topics if (data := self.newest(topic, encounter.start_ns))
            }
            if "fit" not in messages:
                return None, ()
            _, _, requested, anchors = fits.decode_fit(messages["fit"])
            if anchors.shape[:2] != (len(encounter.vehicles), len(stamps)):
                return None, ()
            fitted = tuple(
                fits.decode_fitted(poses, self.statuses, vehicle.id)
                for poses, vehicle in zip(anchors, encounter.vehicles, strict=True)
            )
            routes = tuple(
                fits.with_figures(route, self.statuses, vehicle.id)
                for vehicle, (_, _, route) in zip(
                    encounter.vehicles, decode_routes(messages, encounter, stamps), strict=True
                )
            )
            lost = fits.decode_losses(self.statuses.get("fit", {}))
        except InputError:
            return None, ()
        remarks = {
            text
            for vehicle, route in zip(encounter.vehicles, routes, strict=True)
            for text in route.remarks(vehicle.id)
        }
        noted = tuple(
            text for key, text in self.statuses.get("fit", {}).items() if key.startswith("note.")
        )
        notes = tuple(
            Note(NoteKind.TEXT, recorded=text) for text in noted if text not in remarks
        )  # the remarks come from the routes themselves
        return Fit(
            encounter.vehicles,
            fitted,
            anchor_index(encounter, changepoints),
            requested,
            notes,
            lost,
        ), routes


def read_scenario_set(
    path: Path, namespace: str = "", config: BagConfig = BagConfig()
) -> ScenarioSet:
    """Return the last request's scenarios and counts from a bag, whoever recorded it.

    Raises:
        InputError: the bag cannot be read, no request was closed in it, or a scenario of the request is missing.
    """
    found = read_recording(path, config, (SCENARIOS, INFO)).namespaces.get(namespace)
    if found is None:
        raise InputError(f"{path}: no request was closed on {namespace}/{INFO}")
    with naming_bag(path):
        return found.scenario_set()


def load(
    path: Path | str, namespace: str = "", config: BagConfig = BagConfig()
) -> GenerationResult:
    """Return a result that a bag holds: its template and the scenarios of its last request, not evaluated.

    Args:
        path: of the bag, as `GenerationResult.save` or `scenario-gen generate` wrote it.
        namespace: "" or e.g. "/case_2".
        config: what is read at most.

    Raises:
        InputError: the bag cannot be read, the namespace is not there, or a scenario of the request is missing.
    """
    return result_in(read_recording(Path(path), config), namespace)


def result_in(recording: Recording, namespace: str = "") -> GenerationResult:
    """Return a result of a recording, as `load` does.

    Raises:
        InputError: the namespace is not among its `results`, or a scenario of the request is missing.
    """
    if namespace not in recording.results:
        names = " or ".join(map(repr, recording.results))
        remedy = (
            f"choose one: namespace={names}" if names else "no namespace has any; is it a log?"
        )
        raise InputError(
            f"{recording.path}: namespace {namespace!r} holds no recording with scenarios; {remedy}"
        )
    found = recording.namespaces[namespace]
    with naming_bag(recording.path):
        fit, routes = found.fit
        generated = found.scenario_set()
        seed = next((scenario.seed for scenario in generated), 0)
        return GenerationResult(
            found.encounter,
            found.segmentation,
            found.road,
            fit,
            routes,
            generated,
            seed,
            provenance=recording.provenance,
        )
