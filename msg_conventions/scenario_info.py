# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`scenarios/info` (std_msgs/String, documents.py): an entry per scenario, then a summary.

A message is one of the two; docs/interfaces.md explains their fields. Entries are joined with
their scenarios by the SHA-256 of the scenario's CDR bytes. QoS: reliable, transient_local, depth
1000.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from msg_conventions.cdr import stamp_of
from msg_conventions.documents import document_of, encode_document, json_of
from msg_conventions.scenarios import digest, encode_scenario, messages_of
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats
from scenario_gen.types import (
    BoundaryStates,
    Cause,
    Decided,
    Decision,
    EgoSlot,
    Facts,
    Note,
    ORDERS,
    Recorded,
    Scenario,
    ScenarioSet,
    token,
    Vehicle,
)

INFO = "scenarios/info"


@dataclass(frozen=True, eq=False)
class EgoEntry:
    """The vehicle that was left out.

    Attributes:
        id: its name in topics.
        start, goal: (4,) requested states: x [m], y [m], yaw [rad], speed [m/s].
        relaxed: (2, 2) by how much its start and end may differ from that [m, m/s].
        witness: SHA-256 of the message on `ego/witness`, in an entry.
    """

    id: str
    start: Floats
    goal: Floats
    relaxed: Floats = field(default_factory=lambda: np.zeros((2, 2)))
    witness: str = ""


@dataclass(frozen=True, eq=False)
class ScenarioEntry:
    """The entry of one scenario.

    Attributes:
        stamp: of the template [ns].
        inputs: hashes of `tracks` and `map`, where they are known.
        request: id of its request.
        index: its number in the request.
        seed: of the request.
        sha256: of the scenario's CDR bytes.
        messages: SHA-256 of each of its messages in order, if there are several.
        template, road: names, in process only.
        facts: what is known about it.
        requested: start and end states.
        achieved: (2, N, 4) first and last states.
        present: from when to when each vehicle is there [s], unless all are there throughout.
        sizes: (N, 2) length and width [m], if they are not those of the template.
        ego: the vehicle that was left out.
    """

    stamp: int
    inputs: Mapping[str, str]
    request: str
    index: int
    seed: int
    sha256: str
    messages: tuple[str, ...] = ()
    template: str = ""
    road: str = ""
    facts: Facts = field(default_factory=Facts)
    requested: BoundaryStates | None = None
    achieved: Floats = field(default_factory=lambda: np.zeros((2, 0, 4)))
    present: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    sizes: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    ego: EgoEntry | None = None

    @property
    def hashes(self) -> tuple[str, ...]:
        """SHA-256 of each of its messages, in order."""
        return self.messages or (self.sha256,)

    @property
    def witness(self) -> str:
        """SHA-256 of the message of its ego's witness; "" without one."""
        return self.ego.witness if self.ego is not None else ""

    @property
    def template_hash(self) -> str | None:
        """The hash of its `tracks`; None: not known."""
        return self.inputs.get("tracks")

    @property
    def map_hash(self) -> str | None:
        """The hash of its `map`; None: not known."""
        return self.inputs.get("map")

    def asked(self, *, witness: bool = False) -> BoundaryStates | None:
        """Return the requested start and end states; with `witness` the ego's in a last row."""
        if not witness or self.requested is None or self.ego is None:
            return None if witness else self.requested
        return BoundaryStates(
            np.vstack((self.requested.start, self.ego.start)),
            np.vstack((self.requested.end, self.ego.goal)),
            np.concatenate((self.requested.relaxed, self.ego.relaxed[None])),
        )

    def name(self) -> str:
        """Return what it is called in messages."""
        return f"scenario {self.index} of request {self.request}"

    def join_key(self) -> "ScenarioEntry":
        """Return the entry without what is not needed to join it, for there may be very many."""
        return replace(
            self, facts=Facts(), requested=None, achieved=np.zeros((2, 0, 4)), sizes=self.sizes[:0]
        )


@dataclass(frozen=True, eq=False)
class RequestSummary:
    """The summary of a closed request.

    Attributes:
        stamp: of the template [ns].
        inputs: hashes of `tracks` and `map`, where they are known.
        request: its id.
        seed: of the request.
        requested, published, candidates: numbers of scenarios.
        refused: numbers of refused candidates by cause.
        cancelled: whether it was ended early.
        adaptations: notes on how scenarios were drawn.
        reactions: who reacts to whom in the template, each as `Reaction.document` with `kept`.
        cut: those that closed a circle.
        target: share of natural candidates that are valid and in the range, …
        decided: name of the encounter and decision of such a template.
        ego: the vehicle that was left out.
        provenance: parameters, versions, logs: what makes it again with the seed.
    """

    stamp: int
    inputs: Mapping[str, str]
    request: str
    seed: int
    requested: int
    published: int
    candidates: int
    refused: Mapping[str, int] = field(default_factory=dict)
    cancelled: bool = False
    adaptations: tuple[Note, ...] = ()
    reactions: tuple[Mapping[str, Any], ...] = ()
    cut: tuple[Mapping[str, Any], ...] = ()
    target: Mapping[str, str] = field(default_factory=dict)
    decided: tuple[str, Decision] | None = None
    ego: EgoEntry | None = None
    provenance: Mapping[str, str] = field(default_factory=dict)

    @property
    def source(self) -> Recorded | Decided:
        """Whether the vehicles of the template were recorded together, as they drive here."""
        return Recorded() if self.decided is None else Decided(*self.decided)

    @property
    def is_full(self) -> bool:
        """Whether all requested scenarios were published."""
        return self.published == self.requested

    def result(self, scenarios: tuple[Scenario, ...] = ()) -> ScenarioSet:
        """Return the counts as a set of these scenarios.

        Raises:
            InputError: a cause is unknown.
        """
        try:
            refused = {Cause(cause): count for cause, count in self.refused.items()}
        except ValueError as error:
            raise InputError(
                f"{INFO}: request {self.request} ({error}) is of another version: generate its "
                "scenarios anew"
            ) from None
        return ScenarioSet(
            requested=self.requested,
            scenarios=scenarios,
            candidates=self.candidates,
            refused=Counter(refused),
            adaptations=self.adaptations,
        )

    def message(self) -> str:
        """Return the result in short."""
        return f"{self.published} of {self.requested} scenarios from {self.candidates} candidates"

    def sentence(self) -> str:
        """Return a sentence on the result of the request."""
        text = (
            f"by its own summary request {self.request} published {self.published} of "
            f"{self.requested} from {self.candidates} candidates"
        )
        refused = [f"{cause} {n}" for cause, n in self.refused.items() if n]
        return f"{text}, refused: {', '.join(refused).replace('_', ' ')}" if refused else text

    def of_one_scenario(self) -> "RequestSummary":
        """Return the summary for a bag of one of its scenarios."""
        return replace(self, published=1, requested=1)


Info = ScenarioEntry | RequestSummary


def encode_info(info: Info) -> bytes:
    """Return an entry or a summary as CDR bytes."""
    return encode_document(info)


def decode_info(data: bytes, source: str = INFO) -> Info:
    """Return the entry or the summary in a message.

    Raises:
        InputError: naming `source`, the message is damaged.
    """
    values = json_of(data, source)
    if "published" in values:
        summary: RequestSummary = document_of(RequestSummary, values, source)
        counts = (summary.requested, summary.published, summary.candidates, summary.seed)
        if min(*counts, *summary.refused.values()) < 0:
            raise InputError(f"{source}: a count of request {summary.request} is negative")
        return summary
    entry: ScenarioEntry = document_of(ScenarioEntry, values, source)
    _check(entry, f"{source}: {entry.name()}")
    return entry


def _check(entry: ScenarioEntry, where: str) -> None:
    """Raise InputError naming `where` if a state has another shape, or a number is impossible."""
    if min(entry.index, entry.seed) < 0:
        raise InputError(f"{where}: its index or seed is negative")
    if entry.facts.order not in ORDERS:
        raise InputError(
            f"{where}: order is {entry.facts.order!r}; choose one of {', '.join(ORDERS)}"
        )
    shapes: list[tuple[Floats, tuple[int, ...]]] = []
    relaxed: list[tuple[Floats, tuple[int, ...]]] = []
    if entry.requested is not None:
        asked = entry.requested
        shapes += [(asked.start, (len(asked.start), 4))]
        shapes += [(asked.end, asked.start.shape)]
        relaxed = [(asked.relaxed, (len(asked.start), 2, 2))]
    if entry.ego is not None:
        shapes += [(state, (4,)) for state in (entry.ego.start, entry.ego.goal)]
        relaxed += [(entry.ego.relaxed, (2, 2))]
    if any(state.shape != shape or np.isnan(state).any() for state, shape in shapes):
        raise InputError(f"{where}: its requested states are no rows of four finite numbers")
    if any(each.shape != shape or not (each >= 0.0).all() for each, shape in relaxed):
        raise InputError(f"{where}: relaxed is not metres and m/s of each vehicle")


def scenario_entry(
    scenario: Scenario,
    data: bytes,
    request: str,
    *,
    template: Sequence[Vehicle],
    asked: BoundaryStates,
    ego: EgoSlot | None = None,
    inputs: Mapping[str, str] | None = None,
    names: tuple[str, str] = ("", ""),
) -> ScenarioEntry:
    """Return the entry of a scenario.

    Args:
        scenario: the scenario.
        data: its CDR bytes, of all its messages.
        request: the request's id.
        template: the template's vehicles, of which the scenario may have fewer.
        asked: their states.
        ego: the vehicle that was left out.
        inputs: hashes of `tracks` and `map`.
        names: of the template and the road.
    """
    ids = [vehicle.id for vehicle in template]
    rows = [ids.index(vehicle.id) for vehicle in scenario.vehicles]
    stamp = stamp_of(data, INFO) if data else 0
    sizes = np.array([(vehicle.length, vehicle.width) for vehicle in scenario.vehicles])
    usual = np.array([(template[n].length, template[n].width) for n in rows])
    states = np.stack(
        (*np.moveaxis(scenario.position, -1, 0), scenario.heading, scenario.speed), axis=-1
    )
    messages: tuple[bytes, ...] = ()
    if not scenario.all_present:
        messages = messages_of(data)
    left_out = None
    if ego is not None:
        relaxed = asked.relaxed[ids.index(ego.vehicle.id)]
        left_out = replace(_ego(ego), relaxed=relaxed)
        if scenario.reference_drive is not None:
            witness = encode_scenario(scenario.reference_drive, stamp)
            left_out = replace(left_out, witness=digest(witness))
    return ScenarioEntry(
        stamp,
        inputs or {},
        request,
        scenario.index,
        scenario.seed,
        digest(data),
        tuple(map(digest, messages)) if len(messages) > 1 else (),
        *names,
        facts=_rounded(scenario.facts),
        requested=BoundaryStates(asked.start[rows], asked.end[rows], asked.relaxed[rows]),
        achieved=np.moveaxis(states[:, [0, -1]], 1, 0),
        present=np.zeros((0, 2)) if not messages else scenario.time[scenario.present],
        sizes=np.zeros((0, 2)) if np.array_equal(sizes, usual) else sizes,
        ego=left_out,
    )


def _rounded(facts: Facts) -> Facts:
    """Return facts whose figures do not depend on the processor."""
    figures = (facts.closest_approach_m, facts.pet_s, facts.rarity)
    gap, pet, rarity = (None if each is None else round(each, 3) for each in figures)
    targets = {label: float(f"{value:.6g}") for label, value in facts.targets.items()}
    return replace(facts, closest_approach_m=gap, pet_s=pet, rarity=rarity, targets=targets)


def _ego(slot: EgoSlot) -> EgoEntry:
    return EgoEntry(token(slot.vehicle.id), slot.start, slot.goal)


def request_summary(
    result: ScenarioSet,
    request: str,
    seed: int,
    stamp_ns: int,
    *,
    inputs: Mapping[str, str] | None = None,
    provenance: Mapping[str, str] | None = None,
    source: Recorded | Decided = Recorded(),
    cancelled: bool = False,
    reactions: Mapping[str, Any] | None = None,
) -> RequestSummary:
    """Return the summary of a request.

    Args:
        result: its scenarios and counts.
        request: its id.
        seed: of the request.
        stamp_ns: of the template.
        inputs: hashes of `tracks` and `map`.
        provenance: the values that regenerate it.
        source: of the template.
        cancelled: whether it was ended early.
        reactions: who reacts to whom in the template, `ReactionGraph.document` with the kept ones
            marked.
    """
    edges, cut = (tuple((reactions or {}).get(key, ())) for key in ("edges", "cut"))
    return RequestSummary(
        stamp_ns,
        inputs or {},
        request,
        seed,
        result.requested,
        len(result.scenarios),
        result.candidates,
        {cause.value: count for cause, count in sorted(result.refused.items())},
        cancelled,
        tuple(result.adaptations),
        edges,
        cut,
        {} if result.reached is None else result.reached.figures(),
        (source.encounter, source.decision) if isinstance(source, Decided) else None,
        None if result.ego is None else _ego(result.ego),
        provenance or {},
    )
