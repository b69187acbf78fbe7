# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The requests and scenarios in one namespace of a bag."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path

from msg_conventions.cdr import stamp_of
from msg_conventions.ego import WITNESS
from msg_conventions.scenario_info import (
    decode_info,
    INFO,
    Info,
    RequestSummary,
    ScenarioEntry,
)
from msg_conventions.scenarios import decode_scenario, digest
from scenario_gen.bags.recordings.request_tracker import MessagePool, RequestTracker
from scenario_gen.bags.storage.messages import BagMessage
from scenario_gen.base.errors import InputError
from scenario_gen.types import Road, Scenario, ScenarioSet

SCENARIOS = "scenarios"
Roads = dict[tuple[str, bytes | None, str], Road]
"""The roads of a bag by map hash, lanes and name: each is large, and decoded once."""


class RecordedScenarios:
    """The messages of one namespace of a bag, and the requests and scenarios among them."""

    def __init__(
        self, path: Path, name: str, messages: Mapping[str, Sequence[BagMessage]], roads: Roads
    ) -> None:
        """Use the messages of a namespace of the bag `path`, by topic; its roads are shared."""
        self._roads = roads
        self.path = path
        self.name = name
        self._recorded = messages

    @cached_property
    def messages(self) -> Mapping[str, Sequence[BagMessage]]:
        """The messages by topic; several messages of one scenario are joined."""
        if SCENARIOS not in self._recorded or INFO not in self._recorded:
            return self._recorded
        joined = joined_messages(self._recorded[SCENARIOS], self.entries)
        return {**self._recorded, SCENARIOS: joined}

    def data(self, topic: str) -> list[bytes]:
        """Return the messages of a topic, in order."""
        return [message.data for message in self.messages.get(topic, ())]

    def where(self, topic: str) -> str:
        """Return the topic's full name."""
        return f"{self.name}/{topic}"

    def newest(self, topic: str, stamp_ns: int) -> bytes | None:
        """Return the last message of a topic with the stamp, None if there is none.

        Raises:
            InputError: a message is damaged.
        """
        for data in reversed(self.data(topic)):
            if stamp_of(data, self.where(topic)) == stamp_ns:
                return data
        return None

    # Requests, by `scenarios/info`.

    @cached_property
    def infos(self) -> Sequence[tuple[BagMessage, Info]]:
        """The messages of `scenarios/info`, decoded; without damaged ones (see `check_infos`)."""
        return self._decoded_infos[0]

    @cached_property
    def _decoded_infos(self) -> tuple[list[tuple[BagMessage, Info]], InputError | None]:
        decoded = []
        damage = None
        for message in self._recorded.get(INFO, ()):
            try:
                decoded.append((message, decode_info(message.data, message.topic)))
            except InputError as error:
                damage = damage or error
        return decoded, damage

    def check_infos(self) -> None:
        """Check the messages of `scenarios/info`.

        Raises:
            InputError: one is damaged.
        """
        damage = self._decoded_infos[1]
        if damage is not None:
            raise damage

    @cached_property
    def entries(self) -> tuple[ScenarioEntry, ...]:
        """The entry of every scenario, in order."""
        return tuple(info for _, info in self.infos if isinstance(info, ScenarioEntry))

    @cached_property
    def summaries(self) -> tuple[RequestSummary, ...]:
        """The summaries of the requests, in order."""
        return tuple(info for _, info in self.infos if isinstance(info, RequestSummary))

    @cached_property
    def _requests(self) -> RequestTracker:
        """The requests with their scenarios."""
        messages = self._recorded.get(SCENARIOS, ())
        tracker = RequestTracker(max_unmatched=len(messages))
        for message in messages:
            tracker.add_scenario(digest(message.data))
        for _, info in self.infos:
            tracker.add_info(info)
        return tracker

    @cached_property
    def missing(self) -> tuple[str, ...]:
        """A sentence for each incomplete request."""
        return tuple(request.sentence() for request in self._requests.incomplete(closed=False))

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
        """Return stamp [ns] and scenario `k`, with its ego's witness.

        Raises:
            InputError: its message, or that of its witness, is damaged.
        """
        return self._decoded(self.messages[SCENARIOS][k].data, self.entry(k), k)

    def _decoded(self, data: bytes, entry: ScenarioEntry | None, k: int) -> tuple[int, Scenario]:
        message = self.witnesses.get(entry.witness) if entry else None
        witness = None if message is None else message.data
        place = f"{self.where(SCENARIOS)}, message {k}"
        return decode_with_witness(data, entry, k, witness, place, self.where(WITNESS))

    @cached_property
    def witnesses(self) -> Mapping[str, BagMessage]:
        """The messages of egos' witnesses by their SHA-256."""
        return {digest(message.data): message for message in self.messages.get(WITNESS, ())}

    def without_witness(self, entry: ScenarioEntry) -> bool:
        """Return whether the witness that an entry names is not in the bag."""
        return bool(entry.witness) and entry.witness not in self.witnesses

    @cached_property
    def strange_witnesses(self) -> bool:
        """Whether no entry names one of the witnesses."""
        return bool(self.witnesses.keys() - {entry.witness for entry in self.entries})

    @cached_property
    def unknown(self) -> dict[int, ScenarioEntry | None]:
        """Scenarios without an entry, if there are entries; with the entry in the same place.

        Such a scenario was altered if an entry between those of its neighbours names a scenario
        that is not in the bag. Otherwise its entry was lost, e.g. with the last chunk of a killed
        recorder, and the scenario may be valid.
        """
        if not self.entries:
            return {}
        keys = list(_numbered(self.hashes))
        entry_index = {
            key: k for k, key in enumerate(_numbered(entry.sha256 for entry in self.entries))
        }
        lost = [entry_index[key] for key in entry_index.keys() - set(keys)]
        lost.sort()
        matched = [(k, entry_index[key]) for k, key in enumerate(keys) if key in entry_index]
        matched = [(-1, -1), *matched, (len(keys), len(entry_index))]
        unknown: dict[int, ScenarioEntry | None] = {}
        for (scenario, entry), (next_scenario, next_entry) in pairwise(matched):
            between = (self.entries[k] for k in lost if entry < k < next_entry)
            for k in range(scenario + 1, next_scenario):
                if self.entry(k) is None:
                    unknown[k] = next(between, None)
        return unknown

    def scenario_set(self) -> ScenarioSet:
        """Return scenarios and counts of the last closed request.

        Index 0 may be missing, if its candidate was rejected, and indices do not always increase,
        since adapted candidates are counted separately.

        Raises:
            InputError: no request was closed, or a scenario is missing or damaged.
        """
        self.check_infos()
        if not self.summaries:
            raise InputError(f"{self.path}: no request was closed on {self.where(INFO)}")
        summary = self.summaries[-1]
        tracked = self._requests.open.get(summary.request)
        hashes = tracked.entries.values() if tracked else ()
        entries = [self._entry_by_hash[sha256] for sha256 in hashes]
        by_hash = dict(zip(self.hashes, self.data(SCENARIOS), strict=True))
        topic = self.where(SCENARIOS)
        for entry in entries:
            if entry.sha256 not in by_hash:
                raise InputError(
                    f"{self.path}: scenario {entry.index} of request {entry.request} is not on "
                    f"{topic}"
                )
        if len(entries) != summary.published:
            raise InputError(
                f"{self.path}: {summary.published} scenarios were published, {len(entries)} are "
                f"on {topic}"
            )
        scenarios = [self._decoded(by_hash[e.sha256], e, e.index)[1] for e in entries]
        return summary.result(tuple(scenarios))


def decode_with_witness(
    data: bytes,
    entry: ScenarioEntry | None,
    k: int,
    witness: bytes | None,
    place: str,
    witness_topic: str,
) -> tuple[int, Scenario]:
    """Return stamp [ns] and scenario, with seed and index of its entry.

    Args:
        data: messages of the scenario.
        entry: its entry on `scenarios/info`, or None.
        k: its index without an entry.
        witness: message of its ego's witness, or None.
        place: names the scenario in messages.
        witness_topic: names the topic of the witness in messages.

    Raises:
        InputError: a message is damaged, or the witness does not belong to the scenario.
    """
    seed, index = (entry.seed, entry.index) if entry else (0, k)
    may_start_late = bool(entry and entry.ego)  # the omitted ego may have been the first vehicle
    stamp_ns, scenario = decode_scenario(
        data, seed=seed, index=index, source=place, may_start_late=may_start_late
    )
    if entry is not None:
        scenario = replace(scenario, facts=entry.facts)
    if witness is None:
        return stamp_ns, scenario
    source = f"{witness_topic}, of scenario {index}"
    witness_ns, drive = decode_scenario(
        witness, seed=seed, index=index, source=source, may_start_late=True
    )
    is_same_frame = (witness_ns, drive.frame_id) == (stamp_ns, scenario.frame_id)
    others = set(scenario.ids)
    if not is_same_frame or len(drive.vehicles) != 1 or drive.vehicles[0].id in others:
        raise InputError(
            f"{source}: it is not one other vehicle with the scenario's stamp and frame"
        )
    return stamp_ns, replace(scenario, reference_drive=drive)


def joined_messages(
    messages: Sequence[BagMessage], entries: Iterable[ScenarioEntry]
) -> Sequence[BagMessage]:
    """Return one message per scenario: vehicles that arrive or leave have separate messages.

    A scenario with a missing message is not joined: its entry then has no scenario, which
    `missing` reports.
    """
    several = [entry for entry in entries if entry.messages]
    if not several:
        return messages
    pool = MessagePool[int](len(messages))
    for k in reversed(range(len(messages))):  # of equal ones the first is taken
        pool.add(digest(messages[k].data), k)
    joined = dict(enumerate(messages))
    for entry in several:
        parts = pool.pop_all(entry.messages)
        if parts:
            data = b"".join(messages[k].data for k in parts)
            for k in parts:
                joined.pop(k)
            joined[parts[0]] = messages[parts[0]]._replace(data=data)
    return [joined[k] for k in sorted(joined)]


def _numbered(texts: Iterable[str]) -> Iterable[tuple[str, int]]:
    """Number equal texts: a set that was published twice has entries for both."""
    count: Counter[str] = Counter()
    for text in texts:
        count[text] += 1
        yield text, count[text]
