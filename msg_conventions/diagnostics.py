# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Reports ⇄ diagnostic_msgs/DiagnosticArray: key-values with full node names, one status per subject.

Used for `scenarios/info` (one per scenario, then one per request), `report` and `/diagnostics`. `header.stamp` is the template's,
but on /diagnostics the time of the message: there what is said of a template bears its stamp as the value `template_stamp`.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from itertools import islice
import json
from typing import TYPE_CHECKING

import numpy as np

from msg_conventions.cdr import CdrReader, CdrWriter
from msg_conventions.ego import ego_values
from msg_conventions.scenarios import digest
from scenario_gen.arrays import Floats
from scenario_gen.encounter import Vehicle
from scenario_gen.errors import InputError
from scenario_gen.guard import guarded
from scenario_gen.scenario import BoundaryStates, Cause, Scenario, ScenarioSet

if TYPE_CHECKING:
    from scenario_gen.fitting.result import Fit

TYPE = "diagnostic_msgs/msg/DiagnosticArray"
TEMPLATE = "template_stamp"


class Level(IntEnum):
    """diagnostic_msgs/DiagnosticStatus levels."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Status:
    """One diagnostic_msgs/DiagnosticStatus."""

    name: str
    level: Level
    message: str
    values: Mapping[str, str] = field(default_factory=dict)


def encode_diagnostics(statuses: Sequence[Status], stamp_ns: int) -> bytes:
    """Return the statuses as CDR bytes."""
    writer = CdrWriter().header(stamp_ns, "").pack("I", len(statuses))
    for status in statuses:
        writer.pack("B", status.level).string(status.name).string(status.message).string("").pack("I", len(status.values))
        for key, value in status.values.items():
            writer.string(key).string(value)
    return writer.finish()


def decode_diagnostics(data: bytes, what: str = "diagnostics") -> tuple[int, tuple[Status, ...]]:
    """Return stamp [ns] and statuses.

    Raises:
        InputError: the message is damaged.
    """
    reader = CdrReader(data, what)
    stamp_ns, _ = reader.header()
    statuses = []
    for _ in range(reader.count()):
        level, name, message = reader.one("B"), reader.string(), reader.string()
        reader.string()  # hardware id
        values = {}
        for _ in range(reader.count()):
            key = reader.string()
            values[key] = reader.string()
        statuses.append(Status(name, Level(min(level, Level.STALE)), message, values))
    return stamp_ns, tuple(statuses)


def written(stamp_ns: int) -> str:
    """Return a stamp as seconds and nine digits behind the point."""
    return f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"


def of_template(status: Status, stamp_ns: int) -> Status:
    """Return a status that says as the value `template_stamp` which template it is about."""
    return replace(status, values={**status.values, TEMPLATE: written(stamp_ns)})


def template_of(status: Status, stamp_ns: int) -> int:
    """Return the stamp [ns] of the template that a status is about; `stamp_ns`, its message's, where it does not say."""
    seconds, point, rest = status.values.get(TEMPLATE, "").partition(".")
    told = point and len(rest) == 9 and (seconds + rest).isascii() and (seconds + rest).isdecimal() and len(seconds) < 20
    return int(seconds + rest) if told else stamp_ns


def states_text(scenario: Scenario, at: int) -> str:
    """Return the vehicles' x, y, yaw, speed at sample `at` as a JSON list, exact to the bit."""
    rows = zip(scenario.position[:, at], scenario.heading[:, at], scenario.speed[:, at], strict=True)
    return json.dumps([[*map(float, position), float(heading), float(speed)] for position, heading, speed in rows])


def states_of(text: str, what: str) -> Floats:
    """Return the (N, 4) x, y, yaw, speed that such a list says.

    Raises:
        InputError: naming `what`, it is no list of rows of four finite numbers.
    """
    with guarded(f"{what}: no rows of numbers"):
        rows = np.array(json.loads(text), dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != 4 or not np.isfinite(rows).all():
        raise InputError(f"{what}: {len(text)} characters that are no rows of four finite numbers")
    return rows


def count_in(values: Mapping[str, str], key: str, what: str) -> int:
    """Return a whole number of an account.

    Raises:
        InputError: naming `what`, there is none, or one of more than 63 bits.
    """
    text = values.get(key, "")
    if not (text.isascii() and text.isdecimal() and len(text) < 20 and int(text) < 2**63):
        raise InputError(f"{what}: {key} is {text!r}; a whole number is needed")
    return int(text)


def text_in(values: Mapping[str, str], key: str, what: str) -> str:
    """Return a text of an account.

    Raises:
        InputError: naming `what`, it is missing.
    """
    if key not in values:
        raise InputError(f"{what}: {key} is missing")
    return values[key]


def asked_values(asked: BoundaryStates, template: Sequence[Vehicle], scenario: Scenario) -> dict[str, str]:
    """Return what `scenarios/info` says of the states asked of a scenario's vehicles; `asked` is in the template's order."""
    ids = [vehicle.id for vehicle in template]
    rows = [ids.index(vehicle.id) for vehicle in scenario.vehicles]
    return {"asked_start": json.dumps(asked.start[rows].tolist()), "asked_end": json.dumps(asked.end[rows].tolist())}


def scenario_status(scenario: Scenario, data: bytes, request: str, node: str, **more: str) -> Status:
    """Return the `scenarios/info` entry of one scenario whose CDR bytes are `data`.

    Args:
        scenario: the scenario.
        data: its CDR bytes.
        request: the request's id.
        node: full name of the publishing node.
        more: what else a reader wants to know (template, road, asked states, ego).
    """
    values = {
        "request": request,
        "index": str(scenario.index),
        "seed": str(scenario.seed),
        "sha256": digest(data),
        "achieved_start": states_text(scenario, 0),
        "achieved_end": states_text(scenario, -1),
        **more,
    }
    return Status(f"{node}: scenario", Level.OK, f"scenario {scenario.index} of request {request}", values)


def take_entry(entries: dict[str, Mapping[str, str]], entry: Mapping[str, str]) -> None:
    """Add a scenario's entry to those of its request, by index; an index that is there already, or another seed, begins it anew.

    A sampler that was killed and started again counts its requests from 1 again. Index 0 may be missing, for its candidate may
    have been refused, and indices do not always ascend, for adapted candidates are counted apart.
    """
    if entry["index"] in entries or any(entry["seed"] != known["seed"] for known in islice(entries.values(), 1)):
        entries.clear()
    entries[entry["index"]] = entry


def request_status(
    result: ScenarioSet, request: str, node: str, seed: int, provenance: Mapping[str, str] | None = None
) -> Status:
    """Return the closing `scenarios/info` entry of a request; `provenance` is what is needed to do it again."""
    complete = len(result.scenarios) == result.requested
    values = {
        **(provenance or {}),
        **ego_values(result.ego),
        "request": request,
        "seed": str(seed),
        "requested": str(result.requested),
        "published": str(len(result.scenarios)),
        "candidates": str(result.candidates),
        **{f"refused.{cause.value}": str(count) for cause, count in sorted(result.refused.items())},
        **{f"adaptation.{k}": text for k, text in enumerate(result.adaptations)},
    }
    message = f"{len(result.scenarios)} of {result.requested} scenarios from {result.candidates} candidates"
    return Status(f"{node}: request", Level.OK if complete else Level.WARN, message, values)


def read_request(status: Status, scenarios: tuple[Scenario, ...] = ()) -> ScenarioSet:
    """Return the account of a request from its closing entry; `scenarios` are those of its digests.

    Raises:
        InputError: an entry is missing or no number.
    """
    values = status.values
    what = f"scenarios/info: {status.name!r} is no account of a request"
    try:
        prefix = "refused."
        causes = {key: Cause(key[len(prefix) :]) for key in values if key.startswith(prefix)}
        refused = {cause: count_in(values, key, what) for key, cause in causes.items()}
        return ScenarioSet(
            requested=count_in(values, "requested", what),
            scenarios=scenarios,
            candidates=count_in(values, "candidates", what),
            refused=Counter(refused),
            adaptations=tuple(text for key, text in values.items() if key.startswith("adaptation.")),
        )
    except ValueError as error:
        raise InputError(f"{what} ({error})") from None


def fit_statuses(fit: "Fit", node: str, more: Mapping[str, str] | None = None) -> tuple[Status, ...]:
    """Return what the fitting decided: one status per vehicle, one for the notes; each with what `more` says of it."""
    per_vehicle = tuple(
        Status(
            f"{node}: fit of {vehicle.id}",
            Level.OK if float(fitted.moved.max()) < 1.0 else Level.WARN,
            f"{fitted.manoeuvre}, scale {fitted.scale:.3f}, moved by at most {float(fitted.moved.max()):.2f} m",
            {
                "manoeuvre": fitted.manoeuvre,
                "scale": repr(fitted.scale),
                "moved_m": json.dumps(fitted.moved.tolist()),
                "stands": json.dumps([bool(value) for value in fitted.stands]),
                **(more or {}),
            },
        )
        for vehicle, fitted in zip(fit.vehicles, fit.fitted, strict=True)
    )
    notes = {f"note.{k}": note for k, note in enumerate(fit.notes)}
    return (*per_vehicle, Status(f"{node}: fit", Level.OK, "template fitted to the road", notes | dict(more or {})))
