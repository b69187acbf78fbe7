# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The requests and scenarios of one namespace of a bag, and what of them is missing."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import islice, pairwise
from pathlib import Path

from msg_conventions.cdr import stamp_of
from msg_conventions.ego import WITNESS
from msg_conventions.scenario_info import (
    decode_info,
    INFO,
    Info,
    MESSAGES,
    RequestSummary,
    ScenarioEntry,
)
from msg_conventions.scenarios import decode_scenario, digest
from scenario_gen.bags.recordings.requests import RequestTracker
from scenario_gen.bags.storage.bag import BagMessage
from scenario_gen.base.errors import InputError
from scenario_gen.types import Scenario, ScenarioSet

SCENARIOS = "scenarios"


class RecordedScenarios:
    """The messages of one namespace of a bag, and the requests and scenarios among them."""

    def __init__(
        self, path: Path, name: str, messages: Mapping[str, Sequence[BagMessage]]
    ) -> None:
        """Take the bag's path, the namespace's name and its messages by topic."""
        self.path, self.name, self._recorded = path, name, messages

    @cached_property
    def messages(self) -> Mapping[str, Sequence[BagMessage]]:
        """The messages by topic; those of one scenario are joined, so that there is one for each scenario."""
        if not (SCENARIOS in self._recorded and INFO in self._recorded):
            return self._recorded
        return {
            **self._recorded,
            SCENARIOS: joined_messages(self._recorded[SCENARIOS], self.entries),
        }

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
        return next(
            (
                data
                for data in reversed(self.data(topic))
                if stamp_of(data, self.where(topic)) == stamp_ns
            ),
            None,
        )

    # Requests, by `scenarios/info`.

    @cached_property
    def infos(self) -> Sequence[tuple[BagMessage, tuple[Info, ...]]]:
        """The messages of `scenarios/info`, each with what it holds; damaged ones are left out (see `check_infos`)."""
        return self._decoded_infos[0]

    @cached_property
    def _decoded_infos(
        self,
    ) -> tuple[list[tuple[BagMessage, tuple[Info, ...]]], InputError | None]:
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
        return tuple(
            info for _, infos in self.infos for info in infos if isinstance(info, ScenarioEntry)
        )

    @cached_property
    def summaries(self) -> tuple[RequestSummary, ...]:
        """The summaries of the requests, in order."""
        return tuple(
            info for _, infos in self.infos for info in infos if isinstance(info, RequestSummary)
        )

    @cached_property
    def missing(self) -> tuple[str, ...]:
        """One sentence for each request that is not complete."""
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
        """Return stamp [ns] and scenario `k` with its ego's witness, numbered by its entry or, without one, by its place.

        Raises:
            InputError: its message, or that of its witness, is damaged.
        """
        return self._decoded(self.messages[SCENARIOS][k].data, self.entry(k), k)

    def _decoded(self, data: bytes, entry: ScenarioEntry | None, k: int) -> tuple[int, Scenario]:
        message = self.witnesses.get(entry.witness) if entry else None
        witness = None if message is None else message.data
        return decode_with_witness(
            data, entry, k, witness, f"{self.where(SCENARIOS)}, message {k}", self.where(WITNESS)
        )

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

        Such a scenario was altered if an entry between those of its neighbours names a scenario that is not in the bag. Otherwise
        its entry was lost, e.g. with the last chunk of a recording that was killed, and the scenario may be sound.
        """
        if not self.entries:
            return {}
        entries = list(_numbered(entry.sha256 for entry in self.entries))
        place = {key: k for k, key in enumerate(entries)}
        seen = list(_numbered(self.hashes))
        there = set(seen)
        lost = [k for k, key in enumerate(entries) if key not in there]
        known = [
            (-1, -1),
            *((k, place[key]) for k, key in enumerate(seen) if key in place),
            (len(seen), len(entries)),
        ]
        found: dict[int, ScenarioEntry | None] = {}
        for (first, after), (last, before) in pairwise(known):
            between = iter([self.entries[k] for k in lost if after < k < before])
            found |= {
                k: next(between, None) for k in range(first + 1, last) if self.entry(k) is None
            }
        return found

    def scenario_set(self) -> ScenarioSet:
        """Return the scenarios and counts of the last request that was closed.

        A sampler that was killed and started again counts its requests from 1 again, so a repeated index, or another seed, begins
        the request anew. Index 0 may be missing, for its candidate may have been refused, and indices do not always ascend, for
        adapted candidates are counted apart.

        Raises:
            InputError: no request was closed, or a scenario of it is missing or damaged.
        """
        self.check_infos()
        if not self.summaries:
            raise InputError(f"{self.path}: no request was closed on {self.where(INFO)}")
        summary, own = self.summaries[-1], dict[int, ScenarioEntry]()
        for entry in self.entries:
            if entry.request == summary.request:
                if entry.index in own or any(
                    entry.seed != other.seed for other in islice(own.values(), 1)
                ):
                    own.clear()
                own[entry.index] = entry
        by_hash = dict(zip(self.hashes, self.data(SCENARIOS), strict=True))
        what = self.where(SCENARIOS)
        for entry in own.values():
            if entry.sha256 not in by_hash:
                raise InputError(
                    f"{self.path}: scenario {entry.index} of request {entry.request} is not on {what}"
                )
        if len(own) != summary.published:
            raise InputError(
                f"{self.path}: {summary.published} scenarios were published, {len(own)} are on {what}"
            )
        return summary.result(
            tuple(self._decoded(by_hash[e.sha256], e, e.index)[1] for e in own.values())
        )


def decode_with_witness(
    data: bytes, entry: ScenarioEntry | None, k: int, witness: bytes | None, what: str, where: str
) -> tuple[int, Scenario]:
    """Return stamp [ns] and scenario, numbered by its entry or, without one, by its place.

    Args:
        data: of the scenario's messages.
        entry: its own on `scenarios/info`, if it has one.
        k: its place.
        witness: the message of its ego's witness, if it has one.
        what: names the scenario in messages.
        where: names the topic of the witness.

    Raises:
        InputError: a message is damaged, or the witness is not of another vehicle on the same road.
    """
    seed, index = (entry.seed, entry.index) if entry else (0, k)
    late = bool(entry and entry.ego)  # the ego that was left out may have been the first vehicle
    stamp, scenario = decode_scenario(
        data, seed=seed, index=index, source=what, may_start_late=late
    )
    if entry is not None:
        scenario = replace(scenario, facts=entry.facts)
    if witness is None:
        return stamp, scenario
    of, own = decode_scenario(
        witness,
        seed=seed,
        index=index,
        source=f"{where}, of scenario {index}",
        may_start_late=True,
    )
    known = {vehicle.id for vehicle in scenario.vehicles}
    if (
        (of, own.frame_id) != (stamp, scenario.frame_id)
        or len(own.vehicles) != 1
        or own.vehicles[0].id in known
    ):
        raise InputError(
            f"{where}, of scenario {index}: it is not one other vehicle with the scenario's stamp and frame"
        )
    return stamp, replace(scenario, reference_drive=own)


def joined_messages(
    messages: Sequence[BagMessage], entries: Iterable[ScenarioEntry]
) -> Sequence[BagMessage]:
    """Return one message per scenario: vehicles that come or go are in messages of their own, which an entry names.

    A scenario of which a message is missing is not joined: its entry then has no scenario, which `missing` reports.
    """
    several = [entry for entry in entries if MESSAGES in entry.status.values]
    if not several:
        return messages
    places: dict[str, list[int]] = {}
    for k, message in enumerate(messages):
        places.setdefault(digest(message.data), []).append(k)
    joined = dict(enumerate(messages))
    for entry in several:
        try:
            own = [places[sha256].pop(0) for sha256 in entry.messages if places.get(sha256)]
            whole = len(own) == len(entry.messages)
        except InputError:
            continue
        if not whole:
            continue
        data = b"".join(messages[k].data for k in own)
        for k in own:
            joined.pop(k)
        joined[own[0]] = replace(messages[own[0]], data=data)
    return [joined[k] for k in sorted(joined)]


def _numbered(texts: Iterable[str]) -> Iterable[tuple[str, int]]:
    """Number equal texts: a set that was published twice has entries for both."""
    count: Counter[str] = Counter()
    for text in texts:
        count[text] += 1
        yield text, count[text]
