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

"""One run as messages and as a bag: the same bytes that the nodes publish, in an order and at stamps that need no clock."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from msg_conventions.belonging import encode_belonging, identity
from msg_conventions.changepoints import encode_changepoints, encode_posterior
from msg_conventions.diagnostics import (
    asked_values,
    count_in,
    decode_diagnostics,
    encode_diagnostics,
    fit_statuses,
    Level,
    read_request,
    request_status,
    scenario_status,
    Status,
    take_entry,
    text_in,
)
from msg_conventions.ego import ego_messages, ego_values
from msg_conventions.fits import anchor_stamps, encode_fit
from msg_conventions.names import tokens
from msg_conventions.paths import encode_route
from msg_conventions.pictures import encode_footprint, scenario_markers
from msg_conventions.roads import encode_map, encode_poses
from msg_conventions.scenarios import decode_scenario, digest, encode_scenario
from msg_conventions.topics import topic_entry, vehicle_topic
from msg_conventions.tracks import encode_tracks
from scenario_gen.bags.metadata import qos_yaml
from scenario_gen.bags.reader import read_messages, within
from scenario_gen.bags.writer import AtomicBag, BagWriter
from scenario_gen.encounter import Encounter
from scenario_gen.errors import InputError
from scenario_gen.scenario import Scenario, ScenarioSet

if TYPE_CHECKING:
    from scenario_gen.fitting.result import Fit
    from scenario_gen.planning.route import Route
    from scenario_gen.roads.road import Road
    from scenario_gen.segmentation.result import Segmentation

SCENARIO_STEP_NS = 100_000_000  # scenarios are logged this far apart, so that a player shows one after the other


@dataclass(frozen=True, eq=False)
class Run:
    """All that one request made of one template on one road.

    `namespace` stands before its topics, "" or e.g. "/case_a"; `provenance` is what is needed to make it again.
    """

    encounter: Encounter
    road: "Road"
    segmentation: "Segmentation"
    fit: "Fit"
    routes: tuple["Route", ...]
    result: ScenarioSet
    seed: int
    request: str = "1"
    namespace: str = ""
    provenance: Mapping[str, str] = field(default_factory=dict)


def run_messages(run: Run) -> Iterator[tuple[str, bytes, int]]:
    """Yield topic (without namespace), CDR bytes and log stamp [ns] of every message of the run, in order of the stamps."""
    encounter, road, stamp = run.encounter, run.road, run.encounter.start_ns
    template = {
        "tracks": encode_tracks(encounter),
        "map": encode_map(road, stamp),
        "road/entries": encode_poses(road.entries, road.frame_id, stamp),
        "road/exits": encode_poses(road.exits, road.frame_id, stamp),
    }
    hashes, belonging = identity(template), {"road/info": encode_belonging("road", template, stamp)}
    template["changepoints"] = encode_changepoints(encounter, run.segmentation)
    template["fit"] = encode_fit(encounter, run.fit, road.frame_id)
    anchors = anchor_stamps(encounter, run.segmentation.changepoints)
    names = tokens(vehicle.id for vehicle in encounter.vehicles)
    for name, route in zip(names, run.routes, strict=True):
        template[vehicle_topic(name, "route")] = encode_route(route, anchors, road.frame_id)
    belonging["fit/info"] = encode_belonging("fit", template, stamp)
    for topic, data in (*template.items(), *belonging.items()):
        yield topic, data, stamp
    yield "posterior", encode_posterior(encounter, run.segmentation), stamp
    for name, vehicle in zip(names, encounter.vehicles, strict=True):
        yield vehicle_topic(name, "footprint"), encode_footprint(vehicle, stamp, f"vehicle_{name}"), stamp
    statuses = (segmentation_status(run.segmentation), *fit_statuses(run.fit, "/planner", hashes))
    yield "diagnostics", encode_diagnostics(statuses, stamp), stamp
    for topic, data in () if run.result.ego is None else ego_messages(run.result.ego, stamp):
        yield topic, data, stamp
    ego = ego_values(run.result.ego)
    for k, scenario in enumerate(run.result.scenarios):
        logged = stamp + k * SCENARIO_STEP_NS
        data = encode_scenario(scenario, stamp)
        asked = asked_values(run.fit.asked, encounter.vehicles, scenario)
        more = {"template": encounter.name, "road": road.name, **hashes, **ego, **asked}
        status = scenario_status(scenario, data, run.request, "/gp_sampler", **more)
        yield "scenarios", data, logged
        yield "scenarios/info", encode_diagnostics([status], stamp), logged
        yield "markers", scenario_markers(scenario, stamp), logged
    closing = request_status(run.result, run.request, "/gp_sampler", run.seed, {**run.provenance, **hashes})
    yield "scenarios/info", encode_diagnostics([closing], stamp), stamp + len(run.result.scenarios) * SCENARIO_STEP_NS


def segmentation_status(segmentation: "Segmentation", node: str = "/segmenter") -> Status:
    """Return what the segmenter found, in words."""
    values = {f"segment.{k}": text for k, text in enumerate(segmentation.descriptions)}
    message = f"{len(segmentation.changepoints)} changepoints, {segmentation.n_primitives} primitives"
    return Status(f"{node}: segmentation", Level.OK, message, values)


def write_run(folder: Path, runs: Run | Sequence[Run]) -> Path:
    """Write one or several runs (of different namespaces) to the bag `folder`, whole or not at all; return `folder`.

    Same runs, same bytes. A bag that this function wrote there earlier is replaced.

    Raises:
        InputError: the folder is there and is something else, cannot be written, or two runs share a namespace.
    """
    runs = (runs,) if isinstance(runs, Run) else tuple(runs)
    if len({run.namespace for run in runs}) != len(runs):
        raise InputError(f"{folder}: two runs share a namespace; give each its own")
    with AtomicBag(folder) as bag:
        add_runs(bag, runs)
    return folder


def add_runs(bag: BagWriter, runs: Sequence[Run]) -> None:
    """Write all messages of the runs to a bag."""
    for run in runs:
        for topic, data, stamp_ns in run_messages(run):
            kind, quality = topic_entry(topic)
            name = f"{run.namespace}/{topic}"
            bag.add_topic(name, kind, qos_yaml(quality))
            bag.write(name, data, stamp_ns)


def read_scenario_set(folder: Path, namespace: str = "") -> ScenarioSet:
    """Return the last request's scenarios and its account from a bag, whoever recorded it.

    A request that a killed sampler began and, started again, published once more counts once (`take_entry`).

    Raises:
        InputError: the bag cannot be read, no request was closed in it, or a scenario of the request is missing.
    """
    with within(folder):
        return _read_scenario_set(folder, namespace)


def _read_scenario_set(folder: Path, namespace: str) -> ScenarioSet:
    wanted = (f"{namespace}/scenarios", f"{namespace}/scenarios/info")
    by_digest: dict[str, bytes] = {}
    entries: list[Status] = []
    for message in read_messages(folder, lambda topic: topic in wanted):
        if message.topic == wanted[0]:
            by_digest[digest(message.data)] = message.data
        else:
            entries += decode_diagnostics(message.data, wanted[1])[1]
    what = f"{folder}: {wanted[1]}"
    closing = next((entry for entry in reversed(entries) if "published" in entry.values), None)
    if closing is None:
        raise InputError(f"{folder}: no request was closed on {wanted[1]}")
    own: dict[str, Mapping[str, str]] = {}
    for entry in entries:
        if "sha256" in entry.values and entry.values.get("request") == closing.values.get("request"):
            take_entry(own, {key: text_in(entry.values, key, what) for key in ("request", "index", "seed", "sha256")})
    scenarios: list[Scenario] = []
    for values in own.values():
        if values["sha256"] not in by_digest:
            raise InputError(f"{folder}: scenario {values['index']} of request {values['request']} is not on {wanted[0]}")
        data = by_digest[values["sha256"]]
        scenarios.append(decode_scenario(data, seed=count_in(values, "seed", what), index=count_in(values, "index", what))[1])
    if len(scenarios) != count_in(closing.values, "published", what):
        raise InputError(f"{folder}: {closing.values['published']} scenarios were published, {len(scenarios)} are on {wanted[0]}")
    return read_request(closing, tuple(scenarios))
