# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A recording read: what each namespace of a bag says of its template, road, scenarios and requests, decoded when asked for.

The one reader of the conventions' topics, whoever recorded them; who evaluates, validates or makes a scenario again asks it.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, pairwise
from pathlib import Path
import re

import numpy as np

from msg_conventions import fits
from msg_conventions.cdr import stamp_of
from msg_conventions.changepoints import decode_changepoints, decode_posterior, segment_descriptions
from msg_conventions.ego import WITNESS
from msg_conventions.hashes import decode_hashes, hash_of
from msg_conventions.roads import decode_map
from msg_conventions.scenario_info import decode_info, encode_info, INFO, Info, RequestSummary, ScenarioEntry
from msg_conventions.scenarios import decode_scenario, digest, messages_of
from msg_conventions.tracks import decode_tracks
from scenario_gen.bags.recordings.of_scenarios import decode_with_witness, joined_messages
from scenario_gen.bags.recordings.requests import RequestTracker
from scenario_gen.bags.recordings.template import anchor_index, decode_routes, lanes_beside, template_statuses
from scenario_gen.bags.storage.bag import BagMessage, read_messages, within
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError
from scenario_gen.types import Encounter, Fit, Road, Route, Scenario, ScenarioSet, Segmentation

__all__ = [
    "INFO",
    "NO_ENTRY",
    "SCENARIOS",
    "WITNESS",
    "Namespace",
    "Recording",
    "RequestSummary",
    "ScenarioEntry",
    "read_recording",
    "read_scenario_set",
]

SCENARIOS = "scenarios"
NO_ENTRY = f"{INFO} has no entry for them (lost with the end of a recording?)"
READ = re.compile(
    r"(?:(?P<namespace>.*?)/)?(?P<topic>tracks|changepoints|posterior|map|road/entries|road/exits|road/lanes|fit|fit/info|vehicle_\w+/route"
    r"|ego/(?:start|goal|track|witness)|scenarios|scenarios/info|diagnostics)",
    re.DOTALL,
)
TEMPLATE_TOPIC = re.compile(
    r"tracks|changepoints|map|fit|road/entries|road/exits|road/lanes|vehicle_\w+/route|ego/(?:start|goal|track)", re.DOTALL
)
Statuses = Mapping[str, Mapping[str, str]]  # key-values of diagnostics, by subject


@dataclass(frozen=True, eq=False)
class Recording:
    """A bag, read once: `namespaces` by name ("" is the root), sorted."""

    path: Path
    namespaces: Mapping[str, "Namespace"]

    @property
    def provenance(self) -> dict[str, str]:
        """How its scenarios were made: logs, seed, versions, parameters; several answers side by side."""
        found: dict[str, list[str]] = {}
        for namespace in self.namespaces.values():
            for summary in namespace.summaries:
                for key, value in summary.provenance.items():
                    found.setdefault(key, []).append(value)
        return {key: " | ".join(dict.fromkeys(values)) for key, values in found.items()}


def read_recording(path: Path, config: BagConfig = BagConfig(), topics: Collection[str] = ()) -> Recording:
    """Read the messages of a bag.

    Args:
        path: of the bag.
        config: what is read at most.
        topics: names without namespace, if not all that the conventions know are needed; with scenarios come their witnesses.

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
            found.setdefault(match["namespace"] or "", {}).setdefault(match["topic"], []).append(message)
    shared = [message.data for message in found.get("", {}).get("diagnostics", ())]  # nodes speak on one topic for all
    return Recording(path, {name: Namespace(path, name, messages, shared) for name, messages in sorted(found.items())})


class Namespace:
    """What a bag holds in one namespace.

    What is for people to look at (`statuses`, `segmentation`, `fit`, `entries`, …) leaves out what is missing or damaged; what
    a scenario is checked against or made of is an error then.
    """

    def __init__(self, path: Path, name: str, messages: Mapping[str, Sequence[BagMessage]], shared: Sequence[bytes]) -> None:
        """Take the bag's path, the namespace's name, its messages by topic, and /diagnostics of all namespaces."""
        self.path, self.name, self._recorded, self._shared = path, name, messages, shared

    @cached_property
    def messages(self) -> Mapping[str, Sequence[BagMessage]]:
        """The messages by topic; those of one scenario are joined, so that there is one for each scenario."""
        if not (SCENARIOS in self._recorded and INFO in self._recorded):
            return self._recorded
        return {**self._recorded, SCENARIOS: joined_messages(self._recorded[SCENARIOS], self.entries)}

    def data(self, topic: str) -> list[bytes]:
        """Return the messages of a topic, in order."""
        return [message.data for message in self.messages.get(topic, ())]

    def where(self, topic: str) -> str:
        """Return the topic's full name."""
        return f"{self.name}/{topic}"

    def newest(self, topic: str, stamp_ns: int) -> bytes | None:
        """Return the last message of a topic that bears the stamp.

        Raises:
            InputError: a message is damaged.
        """
        return next((data for data in reversed(self.data(topic)) if stamp_of(data, self.where(topic)) == stamp_ns), None)

    # Requests: what `scenarios/info` says.

    @cached_property
    def infos(self) -> Sequence[tuple[BagMessage, tuple[Info, ...]]]:
        """The messages of `scenarios/info` and what each says; damaged ones are left out (see `check_infos`)."""
        return self._decoded_infos[0]

    @cached_property
    def _decoded_infos(self) -> tuple[list[tuple[BagMessage, tuple[Info, ...]]], InputError | None]:
        found, damage = [], None
        for message in self._recorded.get(INFO, ()):
            try:
                found.append((message, decode_info(message.data, message.topic)))
            except InputError as error:
                damage = damage or error
        return found, damage

    def check_infos(self) -> None:
        """Refuse a damaged message of `scenarios/info`.

        Raises:
            InputError: one is damaged.
        """
        damage = self._decoded_infos[1]
        if damage is not None:
            raise damage

    @cached_property
    def entries(self) -> tuple[ScenarioEntry, ...]:
        """The entry of every scenario, in order."""
        return tuple(info for _, infos in self.infos for info in infos if isinstance(info, ScenarioEntry))

    @cached_property
    def summaries(self) -> tuple[RequestSummary, ...]:
        """The summaries of the requests, in order."""
        return tuple(info for _, infos in self.infos for info in infos if isinstance(info, RequestSummary))

    @cached_property
    def missing(self) -> tuple[str, ...]:
        """Sentences that say which requests are not there whole."""
        tracker = RequestTracker(most_unmatched=len(self.hashes))
        for sha256 in self.hashes:
            tracker.add_scenario(sha256)
        for _, infos in self.infos:
            for info in infos:
                tracker.add_info(info)
        return tuple(request.sentence() for request in tracker.incomplete(closed=False))

    # Scenarios.

    @cached_property
    def hashes(self) -> tuple[str, ...]:
        """SHA-256 of every scenario, in order."""
        return tuple(map(digest, self.data(SCENARIOS)))

    @cached_property
    def _entry_by_hash(self) -> dict[str, ScenarioEntry]:
        return {entry.sha256: entry for entry in self.entries}

    def entry(self, k: int) -> ScenarioEntry | None:
        """Return the entry of scenario `k`, None if it has none."""
        return self._entry_by_hash.get(self.hashes[k])

    def scenario(self, k: int) -> tuple[int, Scenario]:
        """Return stamp [ns] and scenario `k`, numbered as its entry says; without one, by its place. With its ego's witness.

        Raises:
            InputError: its message, or that of its witness, is damaged.
        """
        return self._decoded(self.messages[SCENARIOS][k].data, self.entry(k), k)

    def _decoded(self, data: bytes, entry: ScenarioEntry | None, k: int) -> tuple[int, Scenario]:
        message = self.witnesses.get(entry.witness) if entry else None
        witness = None if message is None else message.data
        return decode_with_witness(data, entry, k, witness, f"{self.where(SCENARIOS)}, message {k}", self.where(WITNESS))

    @cached_property
    def witnesses(self) -> Mapping[str, BagMessage]:
        """The messages of egos' witnesses by their SHA-256."""
        return {digest(message.data): message for message in self.messages.get(WITNESS, ())}

    def without_witness(self, entry: ScenarioEntry) -> bool:
        """Whether the witness that an entry names is not in the bag."""
        return bool(entry.witness) and entry.witness not in self.witnesses

    @cached_property
    def strange_witnesses(self) -> bool:
        """Whether there is a witness that no entry names, though entries are there."""
        return bool(self.witnesses.keys() - {entry.witness for entry in self.entries})

    @cached_property
    def unknown(self) -> dict[int, ScenarioEntry | None]:
        """Places of the scenarios without an entry, where there are entries; each with the entry that stands in its place.

        Such a scenario was altered if there is an entry, between those of its neighbours, whose own scenario is not in the bag.
        Else its entry was lost, e.g. with the last chunk of a recording that was killed: that says nothing against it.
        """
        if not self.entries:
            return {}
        entries = list(_numbered(entry.sha256 for entry in self.entries))
        place = {key: k for k, key in enumerate(entries)}
        seen = list(_numbered(self.hashes))
        there = set(seen)
        lost = [k for k, key in enumerate(entries) if key not in there]
        known = [(-1, -1), *((k, place[key]) for k, key in enumerate(seen) if key in place), (len(seen), len(entries))]
        found: dict[int, ScenarioEntry | None] = {}
        for (first, after), (last, before) in pairwise(known):
            between = iter([self.entries[k] for k in lost if after < k < before])
            found |= {k: next(between, None) for k in range(first + 1, last) if self.entry(k) is None}
        return found

    def scenario_set(self) -> ScenarioSet:
        """Return the scenarios and counts of the last request that was closed.

        A sampler that was killed and started again counts its requests from 1 again, so an index that is there already, or
        another seed, begins the request anew. Index 0 may be missing, for its candidate may have been refused, and indices do
        not always ascend, for adapted candidates are counted apart.

        Raises:
            InputError: no request was closed, or a scenario of it is missing or damaged.
        """
        self.check_infos()
        if not self.summaries:
            raise InputError(f"{self.path}: no request was closed on {self.where(INFO)}")
        summary, own = self.summaries[-1], dict[int, ScenarioEntry]()
        for entry in self.entries:
            if entry.request == summary.request:
                if entry.index in own or any(entry.seed != other.seed for other in islice(own.values(), 1)):
                    own.clear()
                own[entry.index] = entry
        by_hash = dict(zip(self.hashes, self.data(SCENARIOS), strict=True))
        what = self.where(SCENARIOS)
        for entry in own.values():
            if entry.sha256 not in by_hash:
                raise InputError(f"{self.path}: scenario {entry.index} of request {entry.request} is not on {what}")
        if len(own) != summary.published:
            raise InputError(f"{self.path}: {summary.published} scenarios were published, {len(own)} are on {what}")
        return summary.result(tuple(self._decoded(by_hash[e.sha256], e, e.index)[1] for e in own.values()))

    # The template and the road that one scenario was made for.

    def tracks_of(self, entry: ScenarioEntry | None, stamp_ns: int) -> Encounter | None:
        """Return the tracks that an entry names, else the newest ones of the stamp; None if there are none.

        Raises:
            InputError: a message is damaged.
        """
        own = entry.template_hash if entry else None
        data = next((data for data in self.data("tracks") if own and hash_of("tracks", data) == own), None)
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
        lanes = lanes_beside(data, self.data("map"), self.data("road/lanes"), self.data("fit/info"))
        return replace(decode_map(data, lanes=lanes, name=self.where("map"))[1], name=self.road_name)

    @cached_property
    def roads_differ(self) -> bool:
        """Whether it is not known which of several maps a scenario without an entry is of, while entries know theirs."""
        return any(e.map_hash for e in self.entries) and len({hash_of("map", data) for data in self.data("map")}) > 1

    def segmentation_of(self, encounter: Encounter) -> Segmentation | None:
        """Return the segmentation of the newest changepoints of an encounter, None if there are none.

        Raises:
            InputError: a message is damaged.
        """
        data = self.newest("changepoints", encounter.start_ns)
        return decode_changepoints(data, encounter, self.where("changepoints")) if data else None

    def template_messages(self, entry: ScenarioEntry, stamp_ns: int) -> dict[str, BagMessage]:
        """Return what a scenario was made of, by topic: template, road, fit, routes, ego.

        Of each topic that is the newest message of the stamp (of the map: or of all), or, where `fit/info` names what belongs
        to the scenario's map and template, that one.

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
            if not TEMPLATE_TOPIC.fullmatch(topic):
                continue
            own = [m for m in messages if topic not in together or hash_of(topic, m.data) == together[topic]]
            of_stamp = [m for m in own if stamp_of(m.data, m.topic) == stamp_ns]
            if of_stamp or (own and topic == "map"):
                found[topic] = (of_stamp or own)[-1]
        return found

    def messages_of(self, info: BagMessage, entry: ScenarioEntry, summary: RequestSummary) -> tuple[BagMessage, ...]:
        """Return what a bag of one scenario holds: what it was made of, the scenario, its entry, and the summary of it alone.

        Args:
            info: the message of the entry.
            entry: the scenario's.
            summary: of its request.

        Raises:
            InputError: a message is damaged, or the scenario itself or its witness is not in the bag.
        """
        stamp = stamp_of(info.data, info.topic)
        same = [m for m, sha256 in zip(self.messages.get(SCENARIOS, ()), self.hashes, strict=True) if sha256 == entry.sha256]
        if not same:
            raise InputError(f"{self.path}: the scenario with SHA-256 {entry.sha256} is not on {self.where(SCENARIOS)}")
        closing = replace(info, data=encode_info(summary.of_one_scenario(), stamp))
        own = [replace(same[-1], data=data) for data in messages_of(same[-1].data)] if len(entry.messages) > 1 else same[-1:]
        if self.without_witness(entry):
            raise InputError(f"{self.path}: the witness with SHA-256 {entry.witness} is not on {self.where(WITNESS)}")
        witness = (self.witnesses[entry.witness],) if entry.witness else ()
        return (*self.template_messages(entry, stamp).values(), *witness, *own, info, closing)

    # To look at: the newest template and what the nodes said of it.

    @cached_property
    def encounter(self) -> Encounter:
        """The newest tracks."""
        return decode_tracks(self.data("tracks")[-1], f"{self.path.stem}{self.name}")

    @cached_property
    def statuses(self) -> Statuses:
        """What the diagnostics say of the newest template; the last word counts."""
        stamp = self.encounter.start_ns
        return template_statuses(self._shared, stamp, f"{self.name}/") | template_statuses(self.data("diagnostics"), stamp)

    @cached_property
    def ego_track(self) -> Scenario | None:
        """The newest track of an ego, of a bag of a version before 0.6."""
        tracks = self.data("ego/track")
        return decode_scenario(tracks[-1], what=self.where("ego/track"), late=True)[1] if tracks else None

    @cached_property
    def road_name(self) -> str:
        """Name of the road, by the entries; else the map's topic."""
        return next((entry.road for entry in reversed(self.entries) if entry.road), self.where("map"))

    @cached_property
    def road(self) -> Road | None:
        """The newest map."""
        maps = self.data("map")
        return self._decode_road(maps[-1]) if maps else None

    @cached_property
    def segmentation(self) -> Segmentation:
        """The newest changepoints, with shared labels, probabilities and sentences where the bag has them.

        Raises:
            InputError: the changepoints are damaged or of another template.
        """
        changepoints = self.data("changepoints")
        if not changepoints:
            steps = len(self.encounter.time)
            none = np.zeros(0, dtype=np.int64)
            return Segmentation(np.zeros(steps, dtype=np.int64), none, np.zeros(steps), ("the whole encounter",))
        known = decode_changepoints(changepoints[-1], self.encounter, self.where("changepoints"))
        texts = segment_descriptions(self.statuses)
        if len(texts) != len(known.descriptions):
            texts = known.descriptions
        for data in reversed(self.data("posterior")):
            try:
                whole = decode_posterior(data, texts)
            except InputError:
                continue
            if len(whole.labels) == len(known.labels) and np.array_equal(whole.changepoints, known.changepoints):
                return whole
        return Segmentation(known.labels, known.changepoints, known.changepoint_probability, texts)

    @cached_property
    def fit(self) -> tuple[Fit | None, tuple[Route, ...]]:
        """Fit and routes of the newest template; None and nothing where not both are there with all that the fitting decided."""
        encounter, changepoints = self.encounter, self.segmentation.changepoints
        stamps = fits.anchor_stamps(encounter, changepoints)
        try:
            topics = [topic for topic in self.messages if topic.endswith(("fit", "/route"))]
            messages = {topic: data for topic in topics if (data := self.newest(topic, encounter.start_ns))}
            if "fit" not in messages:
                return None, ()
            _, _, asked, anchors = fits.decode_fit(messages["fit"])
            if anchors.shape[:2] != (len(encounter.vehicles), len(stamps)):
                return None, ()
            fitted = tuple(
                fits.decode_fitted(poses, self.statuses, vehicle.id)
                for poses, vehicle in zip(anchors, encounter.vehicles, strict=True)
            )
            routes = tuple(
                fits.with_figures(route, self.statuses, vehicle.id)
                for vehicle, (_, _, route) in zip(encounter.vehicles, decode_routes(messages, encounter, stamps), strict=True)
            )
            lost = fits.decode_losses(self.statuses.get("fit", {}))
        except InputError:
            return None, ()
        remarks = {said for vehicle, route in zip(encounter.vehicles, routes, strict=True) for said in route.remarks(vehicle.id)}
        noted = tuple(text for key, text in self.statuses.get("fit", {}).items() if key.startswith("note."))
        notes = tuple(text for text in noted if text not in remarks)  # which the routes say themselves
        return Fit(encounter.vehicles, fitted, anchor_index(encounter, changepoints), asked, notes, lost), routes


def read_scenario_set(path: Path, namespace: str = "", config: BagConfig = BagConfig()) -> ScenarioSet:
    """Return the last request's scenarios and counts from a bag, whoever recorded it.

    Raises:
        InputError: the bag cannot be read, no request was closed in it, or a scenario of the request is missing.
    """
    found = read_recording(path, config, (SCENARIOS, INFO)).namespaces.get(namespace)
    if found is None:
        raise InputError(f"{path}: no request was closed on {namespace}/{INFO}")
    with within(path):
        return found.scenario_set()


def _numbered(texts: Iterable[str]) -> Iterable[tuple[str, int]]:
    """Number equal texts: a set that was published twice has entries for both."""
    count: Counter[str] = Counter()
    for text in texts:
        count[text] += 1
        yield text, count[text]
