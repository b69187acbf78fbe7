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

"""What a bag tells of its template beside the tracks, for people to look at: posterior, sentences, fit and routes.

Nothing of it is needed for a figure; what is missing, damaged or of another template is left out.
"""

from collections.abc import Mapping, Sequence
import json
import math
from pathlib import Path

import numpy as np

from msg_conventions.belonging import MAP_HASH, TEMPLATE_HASH
from msg_conventions.cdr import CdrReader
from msg_conventions.changepoints import decode_changepoints, decode_posterior
from msg_conventions.diagnostics import decode_diagnostics, TEMPLATE, template_of
from msg_conventions.fits import anchor_stamps, decode_fit
from msg_conventions.names import tokens
from msg_conventions.paths import decode_route
from msg_conventions.topics import vehicle_topic
from scenario_gen.arrays import Floats
from scenario_gen.bags.reader import DEFAULT, read_messages
from scenario_gen.encounter import Encounter
from scenario_gen.errors import InputError
from scenario_gen.fitting.result import Fit, FittedVehicle
from scenario_gen.guard import guarded
from scenario_gen.planning.route import Route
from scenario_gen.segmentation import Segmentation
from scenario_gen.storage import BagConfig

Values = Mapping[str, str]
OUTCOME = ("request", "requested", "published", "candidates")
IDENTITY = (MAP_HASH, TEMPLATE_HASH)
REFUSED = "refused."


def told_values(messages: Sequence[bytes], stamp_ns: int, nodes: str = "/") -> dict[str, Values]:
    """Return the key-values of diagnostics about one template, by subject ("/planner: fit" is "fit"); the last word counts.

    Args:
        messages: of /diagnostics or `scenarios/info`.
        stamp_ns: the template's stamp.
        nodes: what the full names of the nodes begin with.
    """
    found: dict[str, Values] = {}
    for data in messages:
        try:
            stamp, statuses = decode_diagnostics(data)
        except InputError:
            continue
        for status in statuses:
            if template_of(status, stamp) == stamp_ns and status.name.startswith(nodes):
                values = {key: value for key, value in status.values.items() if key != TEMPLATE}
                found[status.name.partition(": ")[2]] = values
    return found


def told_requests(messages: Sequence[bytes]) -> tuple[Values, ...]:
    """Return the closing accounts of requests on `scenarios/info`, in the order of the bag."""
    found: list[Values] = []
    for data in messages:
        try:
            found += [status.values for status in decode_diagnostics(data)[1] if "published" in status.values]
        except InputError:
            continue
    return tuple(found)


def told_numbers(messages: Sequence[bytes]) -> dict[str, tuple[int, int]]:
    """Return seed and index of the scenarios that `scenarios/info` numbers, by SHA-256."""
    found: dict[str, tuple[int, int]] = {}
    for data in messages:
        try:
            entries = [status.values for status in decode_diagnostics(data)[1] if "sha256" in status.values]
            found |= {entry["sha256"]: (int(entry["seed"]), int(entry["index"])) for entry in entries}
        except (InputError, KeyError, ValueError):
            continue
    return found


def request_sentence(account: Values) -> str:
    """Return in words what a request came to, by its own account."""
    refused = [f"{key[len(REFUSED) :]} {value}" for key, value in account.items() if key.startswith(REFUSED) and value != "0"]
    words = (account.get(key, "?") for key in ("request", "published", "requested", "candidates"))
    told = "by its own account request {} published {} of {} from {} candidates".format(*words)
    return f"{told}, refused: {', '.join(refused).replace('_', ' ')}" if refused else told


def told_provenance(bag: Path, config: BagConfig = DEFAULT) -> dict[str, str]:
    """Return what the bag says of how its scenarios were made: logs, seed, versions, parameters; several answers side by side.

    Raises:
        InputError: the bag cannot be read.
    """
    found: dict[str, list[str]] = {}
    for message in read_messages(bag, lambda topic: f"/{topic}".endswith("/scenarios/info"), config):
        for account in told_requests([message.data]):
            for key, value in account.items():
                if key not in (*OUTCOME, *IDENTITY) and not key.startswith((REFUSED, "adaptation.", "ego")):
                    found.setdefault(key, []).append(value)
    return {key: " | ".join(dict.fromkeys(values)) for key, values in found.items()}


def told_segmentation(
    encounter: Encounter, changepoints: Sequence[bytes], posterior: Sequence[bytes], told: Mapping[str, Values], what: str
) -> Segmentation:
    """Return the segmentation of the changepoints, with shared labels, probabilities and sentences where the bag has them.

    Raises:
        InputError: the changepoints are damaged or of another template.
    """
    if not changepoints:
        steps = len(encounter.time)
        none = np.zeros(0, dtype=np.int64)
        return Segmentation(np.zeros(steps, dtype=np.int64), none, np.zeros(steps), ("the whole encounter",))
    known = decode_changepoints(changepoints[-1], encounter, what)
    texts = tuple(value for key, value in told.get("segmentation", {}).items() if key.startswith("segment."))
    if len(texts) != len(known.descriptions):
        texts = known.descriptions
    for data in reversed(posterior):
        try:
            whole = decode_posterior(data, texts)
        except InputError:
            continue
        if len(whole.labels) == len(known.labels) and np.array_equal(whole.changepoints, known.changepoints):
            return whole
    return Segmentation(known.labels, known.changepoints, known.changepoint_probability, texts)


def told_fit(
    bag: Path,
    namespace: str,
    encounter: Encounter,
    segmentation: Segmentation,
    fits: Sequence[bytes],
    told: Mapping[str, Values],
    config: BagConfig = DEFAULT,
) -> tuple[Fit | None, tuple[Route, ...]]:
    """Return fit and routes, or None and nothing where the bag does not have both with all that the fitting decided.

    Raises:
        InputError: the bag cannot be read.
    """
    try:
        data = next(data for data in reversed(fits) if CdrReader(data, "fit").stamp() == encounter.start_ns)
        _, _, asked, anchors = decode_fit(data)
        decided = [told[f"fit of {vehicle.id}"] for vehicle in encounter.vehicles]
        fitted = tuple(_fitted(poses, values) for poses, values in zip(anchors, decided, strict=True))
        stamps = anchor_stamps(encounter, segmentation.changepoints)
        routes = _routes(bag, namespace, encounter, stamps, config)
    except (StopIteration, KeyError, ValueError, InputError):
        return None, ()
    if any(len(vehicle.anchors) != len(stamps) or len(vehicle.moved) != len(stamps) for vehicle in fitted):
        return None, ()
    index = np.array([0, *segmentation.changepoints, len(encounter.time) - 1])
    notes = tuple(text for key, text in told.get("fit", {}).items() if key.startswith("note."))
    return Fit(encounter.vehicles, fitted, index, asked, notes), routes


def _fitted(poses: Floats, values: Values) -> FittedVehicle:
    """Return what the fitting decided of a vehicle.

    Raises:
        KeyError, ValueError, InputError: it is not told, or damaged.
    """
    with guarded("fit"):
        moved = np.array(json.loads(values["moved_m"]), dtype=np.float64)
        stands = np.array(json.loads(values["stands"]), dtype=np.bool_)
    scale = float(values["scale"])
    if moved.ndim != 1 or stands.ndim != 1 or not np.isfinite(moved).all() or not 0.0 < scale < math.inf:
        raise InputError("fit: damaged")
    return FittedVehicle(anchors=poses, moved=moved, stands=stands, scale=scale, manoeuvre=values["manoeuvre"])


def _routes(bag: Path, namespace: str, encounter: Encounter, stamps: Sequence[int], config: BagConfig) -> tuple[Route, ...]:
    """Return the last route of this template of every vehicle.

    Raises:
        KeyError: a vehicle has none.
        InputError: the bag or a route is damaged.
    """
    names = tokens(vehicle.id for vehicle in encounter.vehicles)
    topics = [f"{namespace}/{vehicle_topic(name, 'route')}" for name in names]
    last: dict[str, bytes] = {}
    for message in read_messages(bag, lambda topic: topic in topics, config):
        if CdrReader(message.data, message.topic).stamp() == encounter.start_ns:
            last[message.topic] = message.data
    return tuple(decode_route(last[topic], stamps, topic)[1] for topic in topics)
