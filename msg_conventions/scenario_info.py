# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`scenarios/info`: an entry for each scenario, then a summary of its request.

The type is diagnostic_msgs/DiagnosticArray.

All keys of both are in this file; docs/interfaces.md lists them. Stamp: the template's. Entries
are joined with their scenarios by the SHA-256 of the scenario's CDR bytes. QoS: reliable,
transient_local, depth 1000.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
import json
from typing import Any

import numpy as np

from msg_conventions.cdr import stamp_of
from msg_conventions.diagnostics import decode_diagnostics, encode_diagnostics, Level, Status
from msg_conventions.ego import ego_values
from msg_conventions.hashes import MAP_HASH, TEMPLATE_HASH
from msg_conventions.scenario_facts import decode_decision, decode_facts, fact_values
from msg_conventions.scenarios import digest, encode_scenario, messages_of
from scenario_gen.base.documents import parse_json
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.numerics import Floats
from scenario_gen.types import (
    BoundaryStates,
    Cause,
    Decided,
    EgoSlot,
    Facts,
    note_kinds,
    Recorded,
    recorded_notes,
    Scenario,
    ScenarioSet,
    Vehicle,
)

INFO = "scenarios/info"
REFUSED, ADAPTATION, TARGET = "refused.", "adaptation.", "target."
DECIDED = ("decided.encounter", "decided.decision")  # recording, and the decision as JSON
KINDS = f"{ADAPTATION}kinds"  # of the adaptations, in their order
REACTION, CUT = (
    "reaction.",
    "reaction.cut.",
)  # who reacts to whom in the template, JSON; those cut because they closed a circle
MESSAGES, PRESENT = "messages", "present"  # of a scenario in which not all are there throughout
SIZES = "sizes"  # length and width of its vehicles [m], where they are not those of the template
FREED = "freed"  # allowed deviation [m, m/s] of each vehicle from its requested states
EGO_FREED = "ego_freed"  # likewise of the vehicle that was left out
EGO_WITNESS = "ego_witness"  # of one with an ego slot
Values = Mapping[str, str]


def _value(key: str, default: str | None = "") -> Any:
    """Return a property: one of the entry's values."""
    return property(lambda entry: entry.status.values.get(key, default))


@dataclass(frozen=True)
class ScenarioEntry:
    """The entry of one scenario.

    Attributes:
        request: id of its request.
        index: its number in the request.
        seed: of the request.
        sha256: of the scenario's CDR bytes.
        status: with all values: `asked_start`, `asked_end`, `achieved_start`, `achieved_end`,
            `template`, `road`, `ego…`, hashes.
        messages: SHA-256 of each of the scenario's messages, in order; one, `sha256`, where all
            are there throughout.
    """

    request: str
    index: int
    seed: int
    sha256: str
    status: Status
    messages: tuple[str, ...]

    road = _value("road")  # name of the road; "" as in entries of the nodes
    ego = _value("ego")  # token of the vehicle that was left out; "" if none was
    witness = _value(
        EGO_WITNESS
    )  # SHA-256 of the message of its ego's witness; "" where it has none
    template_hash = _value(
        TEMPLATE_HASH, None
    )  # of its template, the `tracks` (hashes.py); None: not known
    map_hash = _value(MAP_HASH, None)

    @property
    def facts(self) -> Facts:
        """What is known about the scenario.

        Raises:
            InputError: a value is damaged.
        """
        return decode_facts(self.status.values, f"{INFO}: {self.status.message}")

    def asked(self, source: str = INFO, *, witness: bool = False) -> BoundaryStates | None:
        """Return the requested start and end states (N, 4), None where they are not there.

        Args:
            source: names the topic in messages.
            witness: add those of the ego in a last row.

        Raises:
            InputError: naming `source`, they are damaged.
        """
        keys = (("asked_start", "ego_start"), ("asked_end", "ego_goal"))
        values, where = self.status.values, f"{source}: the asked states of {self.status.message}"
        if any(key not in values for pair in keys for key in pair[: 1 + witness]):
            return None
        start, end = (_states(values[key], where) for key, _ in keys)
        if witness:
            ego_start, ego_end = (_states(f"[{values[key]}]", where) for _, key in keys)
            start = np.concatenate((start, ego_start))
            end = np.concatenate((end, ego_end))
        return BoundaryStates(start, end, self._relaxed(len(start), where, witness=witness))

    def _relaxed(self, count: int, where: str, *, witness: bool) -> Floats:
        """Return by how much each of `count` vehicles may miss its states (count, 2, 2) [m, m/s].

        0 where it is not there.
        """
        relaxed = np.zeros((count, 2, 2))
        vehicles = self._relaxed_of(FREED, count - witness, where)
        relaxed[: len(vehicles)] = vehicles
        ego = self._relaxed_of(EGO_FREED, 1, where)
        if witness and len(ego):
            relaxed[count - 1] = ego[0]
        return relaxed

    def _relaxed_of(self, key: str, max_count: int, where: str) -> Floats:
        """Return the deviations (M, 2, 2) [m, m/s] of a key, M at most `max_count`."""
        with guarded(where):
            values = json.loads(self.status.values.get(key, "[]"))
            relaxed = np.array(values, dtype=np.float64).reshape(-1, 2, 2)
        if len(relaxed) > max_count or not np.isfinite(relaxed).all() or (relaxed < 0.0).any():
            raise InputError(
                f"{where}: {key} is not metres and m/s of at most {max_count} vehicles"
            )
        return relaxed


@dataclass(frozen=True)
class RequestSummary:
    """The summary of a closed request.

    Attributes:
        request: its id.
        published: how many scenarios of it were published.
        status: all of it: counts, adaptations, `ego…`, and source is needed to make it again
            (parameters, versions, logs).
    """

    request: str
    published: int
    status: Status

    @property
    def values(self) -> Values:
        """All key-values."""
        return self.status.values

    @property
    def cancelled(self) -> bool:
        """Whether it was ended early."""
        return "cancelled" in self.values

    @property
    def provenance(self) -> dict[str, str]:
        """The values that regenerate it, and its seed.

        All that are neither its identity nor its outcome.
        """
        known = {
            "request",
            "requested",
            "published",
            "candidates",
            MAP_HASH,
            TEMPLATE_HASH,
        }
        return {
            key: value
            for key, value in self.values.items()
            if key not in known
            and key not in DECIDED
            and not key.startswith((REFUSED, ADAPTATION, TARGET, REACTION, "ego"))
        }

    @property
    def source(self) -> Recorded | Decided:
        """Whether the vehicles of the template were recorded together, as they drive here."""
        decided = [self.values[key] for key in DECIDED if key in self.values]
        if len(decided) == len(DECIDED):
            return Decided(decided[0], decode_decision(decided[1], INFO))
        return Recorded()

    def result(self, scenarios: tuple[Scenario, ...] = ()) -> ScenarioSet:
        """Return the counts as a set of these scenarios.

        Raises:
            InputError: a count is missing or no number.
        """
        source = f"{INFO}: {self.status.name!r} is no summary of a request"
        causes = [key.removeprefix(REFUSED) for key in self.values if key.startswith(REFUSED)]
        try:
            refused = {
                Cause(cause): _count(self.values, REFUSED + cause, source) for cause in causes
            }
        except ValueError as error:
            raise InputError(
                f"{source} ({error}); it is of another version: generate its scenarios anew"
            ) from None
        return ScenarioSet(
            requested=_count(self.values, "requested", source),
            scenarios=scenarios,
            candidates=_count(self.values, "candidates", source),
            refused=Counter(refused),
            adaptations=recorded_notes(
                (
                    text
                    for key, text in self.values.items()
                    if key.startswith(ADAPTATION) and key != KINDS
                ),
                self.values.get(KINDS, ""),
            ),
        )

    @property
    def reactions(self) -> tuple[dict[str, Any], ...]:
        """The reactions in the template, each as `Reaction.document` with `kept`.

        Reactions that were cut have no `kept`.

        Raises:
            InputError: they are damaged.
        """
        source = f"{INFO}: {REACTION} of {self.status.message}"
        reactions = []
        for key, text in self.values.items():
            if key.startswith(REACTION):
                reactions.append(
                    parse_json(
                        text,
                        source,
                        {"type": "object", "required": ["words", "lag", "confidence"]},
                    )
                )
        return tuple(reactions)

    def sentence(self) -> str:
        """Return a sentence on the result of the request."""
        words = (
            self.values.get(key, "?")
            for key in ("request", "published", "requested", "candidates")
        )
        text = "by its own summary request {} published {} of {} from {} candidates".format(*words)
        refused = [
            f"{key.removeprefix(REFUSED)} {n}"
            for key, n in self.values.items()
            if key.startswith(REFUSED) and n != "0"
        ]
        return f"{text}, refused: {', '.join(refused).replace('_', ' ')}" if refused else text

    def of_one_scenario(self) -> "RequestSummary":
        """Return the summary for a bag of one of its scenarios."""
        values = {**self.values, "published": "1", "requested": "1"}
        return replace(self, published=1, status=replace(self.status, values=values))


Info = ScenarioEntry | RequestSummary


def source_values(source: Recorded | Decided) -> dict[str, str]:
    """Return the values of a summary that name the encounters a template was made from."""
    if isinstance(source, Recorded):
        return {}
    decision = json.dumps(source.decision.document())
    return dict(zip(DECIDED, (source.encounter, decision), strict=True))


def encode_info(info: Info, stamp_ns: int) -> bytes:
    """Return an entry or a summary as CDR bytes."""
    return encode_diagnostics([info.status], stamp_ns)


def decode_info(data: bytes, source: str = INFO) -> tuple[Info, ...]:
    """Return the entries and summaries of a message; statuses that are neither are left out.

    Raises:
        InputError: naming `source`, the message is damaged, or a key that every entry or summary
            has is missing.
    """
    infos: list[Info] = []
    for status in decode_diagnostics(data, source)[1]:
        values, where = status.values, f"{source}: {status.name!r}"
        if not {"published", "sha256"} & values.keys():
            continue
        if "request" not in values:
            raise InputError(f"{where}: request is missing")
        if "published" in values:
            count = _count(values, "published", where)
            infos.append(RequestSummary(values["request"], count, status))
        else:
            infos.append(_entry(status, where))
    return tuple(infos)


def _entry(status: Status, where: str) -> ScenarioEntry:
    """Return the entry of a status."""
    values = status.values
    index, seed = (_count(values, key, where) for key in ("index", "seed"))
    with guarded(f"{where}: {MESSAGES} of {status.message}"):
        messages = json.loads(values.get(MESSAGES, "null")) or [values["sha256"]]
    if not (isinstance(messages, list) and all(isinstance(sha256, str) for sha256 in messages)):
        raise InputError(f"{where}: {MESSAGES} of {status.message} is no list of SHA-256")
    return ScenarioEntry(values["request"], index, seed, values["sha256"], status, tuple(messages))


def scenario_entry(
    scenario: Scenario,
    data: bytes,
    request: str,
    node: str,
    *,
    template: Sequence[Vehicle],
    asked: BoundaryStates,
    ego: EgoSlot | None = None,
    about: Values | None = None,
) -> ScenarioEntry:
    """Return the entry of a scenario.

    Args:
        scenario: the scenario.
        data: its CDR bytes, of all its messages.
        request: the request's id.
        node: full name of the publishing node.
        template: the template's vehicles, of which the scenario may have fewer.
        asked: their states.
        ego: the vehicle that was left out.
        about: further values for all scenarios of the request (names of template and road,
            hashes).
    """
    ids = [vehicle.id for vehicle in template]
    rows = [ids.index(vehicle.id) for vehicle in scenario.vehicles]
    values = {
        "request": request,
        "index": str(scenario.index),
        "seed": str(scenario.seed),
        "sha256": digest(data),
        "achieved_start": _states_text(scenario, 0),
        "achieved_end": _states_text(scenario, -1),
        **_presence_values(scenario, data),
        **(about or {}),
        **fact_values(scenario.facts),
        **ego_values(ego),
        "asked_start": json.dumps(asked.start[rows].tolist()),
        "asked_end": json.dumps(asked.end[rows].tolist()),
    }
    sizes = [[vehicle.length, vehicle.width] for vehicle in scenario.vehicles]
    if sizes != [[template[n].length, template[n].width] for n in rows]:
        values[SIZES] = json.dumps(sizes)
    if scenario.reference_drive is not None:
        witness = encode_scenario(scenario.reference_drive, stamp_of(data, INFO))
        values[EGO_WITNESS] = digest(witness)
    ego_rows = [] if ego is None else [ids.index(ego.vehicle.id)]
    for key, relaxed in ((FREED, asked.relaxed[rows]), (EGO_FREED, asked.relaxed[ego_rows])):
        if relaxed.any():
            values[key] = json.dumps(relaxed.tolist())
    message = f"scenario {scenario.index} of request {request}"
    return _entry(Status(f"{node}: scenario", Level.OK, message, values), INFO)


def _presence_values(scenario: Scenario, data: bytes) -> dict[str, str]:
    """Return the times of presence and the messages' hashes, unless all are present throughout."""
    if scenario.all_present:
        return {}
    spans = scenario.time[scenario.present].tolist()
    messages = messages_of(data)
    values = {PRESENT: json.dumps(spans)}
    if len(messages) > 1:
        values[MESSAGES] = json.dumps([digest(message) for message in messages])
    return values


def request_summary(
    result: ScenarioSet,
    request: str,
    node: str,
    seed: int,
    provenance: Values | None = None,
    *,
    cancelled: bool = False,
    reactions: Mapping[str, Any] | None = None,
) -> RequestSummary:
    """Return the summary of a request.

    Args:
        result: its scenarios and counts.
        request: its id.
        node: full name of the publishing node.
        seed: of the request.
        provenance: the values that regenerate it.
        cancelled: whether it was ended early.
        reactions: who reacts to whom in the template, `ReactionGraph.document` with the kept ones
            marked.
    """
    edges = {REACTION: (reactions or {}).get("edges", ()), CUT: (reactions or {}).get("cut", ())}
    values = {
        **(provenance or {}),
        **({"cancelled": "true"} if cancelled else {}),
        **ego_values(result.ego),
        "request": request,
        "seed": str(seed),
        "requested": str(result.requested),
        "published": str(len(result.scenarios)),
        "candidates": str(result.candidates),
        **{
            f"{REFUSED}{cause.value}": str(count)
            for cause, count in sorted(result.refused.items())
        },
        **{f"{ADAPTATION}{k}": str(note) for k, note in enumerate(result.adaptations)},
        **({KINDS: note_kinds(result.adaptations)} if result.adaptations else {}),
        **{
            f"{key}{k}": json.dumps(edge)
            for key, listed in edges.items()
            for k, edge in enumerate(listed)
        },
        **(
            {}
            if result.reached is None
            else {f"{TARGET}{key}": text for key, text in result.reached.figures().items()}
        ),
    }
    level = Level.OK if len(result.scenarios) == result.requested else Level.WARN
    message = (
        f"{len(result.scenarios)} of {result.requested} scenarios "
        f"from {result.candidates} candidates"
    )
    return RequestSummary(
        request, len(result.scenarios), Status(f"{node}: request", level, message, values)
    )


def _states_text(scenario: Scenario, at: int) -> str:
    """Return the vehicles' x, y, yaw, speed at sample `at` as a JSON list, exact to the bit."""
    rows = zip(
        scenario.position[:, at], scenario.heading[:, at], scenario.speed[:, at], strict=True
    )
    return json.dumps(
        [
            [*map(float, position), float(heading), float(speed)]
            for position, heading, speed in rows
        ]
    )


def _states(text: str, source: str) -> Floats:
    """Return the (N, 4) x, y, yaw, speed of such a list."""
    with guarded(f"{source}: no rows of numbers"):
        rows = np.array(json.loads(text), dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != 4 or not np.isfinite(rows).all():
        raise InputError(
            f"{source}: {len(text)} characters that are no rows of four finite numbers"
        )
    return rows


def _count(values: Values, key: str, source: str) -> int:
    """Return a whole number of at most 63 bits."""
    text = values.get(key, "")
    if not (text.isascii() and text.isdecimal() and len(text) < 20 and int(text) < 2**63):
        raise InputError(f"{source}: {key} is {text!r}; a whole number is needed")
    return int(text)
