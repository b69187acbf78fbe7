# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Writes recordings: a result as messages and as a bag, with the bytes that the nodes publish."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from msg_conventions.changepoints import encode_changepoints, encode_posterior, segmentation_status
from msg_conventions.diagnostics import encode_diagnostics
from msg_conventions.documents import hash_of
from msg_conventions.ego import ego_messages
from msg_conventions.fits import fit_statuses, plan_messages
from msg_conventions.pictures import road_markers, scenario_markers
from msg_conventions.request_messages import footprint_messages, RequestMessages
from msg_conventions.roads import road_messages
from msg_conventions.scenario_info import encode_info, INFO, request_summary
from msg_conventions.scenarios import digest, encode_scenario
from msg_conventions.topics import topic_entry
from msg_conventions.tracks import encode_tracks
from scenario_gen.bags.storage.writer import atomic_bag, BagWriter
from scenario_gen.types import Decided, Encounter, GenerationResult, Scenario


def result_messages(
    result: GenerationResult, request: str = "1"
) -> Iterator[tuple[str, bytes, int]]:
    """Yield topic (without namespace), CDR bytes and log stamp [ns] of a result's messages.

    Args:
        result: result of one request, for one template on one road.
        request: id.

    Raises:
        InputError: its road or its fit is not known.
    """
    road, fit = result.road_and_fit()
    encounter, stamp = result.encounter, result.encounter.start_ns
    template = {"tracks": encode_tracks(encounter)} | road_messages(road, stamp)
    template["changepoints"] = encode_changepoints(encounter, result.segmentation)
    template |= plan_messages(
        encounter, result.segmentation, fit, result.routes, road.frame_id, template
    )
    for topic, data in template.items():
        yield topic, data, stamp
    yield "road/markings", road_markers(road.lanes, road.frame_id, stamp), stamp
    if isinstance(encounter.source, Decided) and encounter.source.recorded is not None:
        yield "tracks/recorded", encode_tracks(encounter.source.recorded), stamp
    yield "posterior", encode_posterior(encounter, result.segmentation), stamp
    for topic, data in footprint_messages(encounter):
        yield topic, data, stamp
    statuses = (
        segmentation_status(result.segmentation, "/segmenter", result.encounter.duration),
        *fit_statuses(fit, "/planner", result.routes),
    )
    yield "diagnostics", encode_diagnostics(statuses, stamp), stamp
    ego = result.generated.ego
    for topic, data in () if ego is None else ego_messages(ego, road.frame_id, stamp):
        yield topic, data, stamp
    inputs = {topic: hash_of(topic, template[topic]) for topic in ("tracks", "map")}
    names = (encounter.recording, road.name)
    messages = RequestMessages(encounter, request, inputs, names)
    logged = stamp
    for scenario in result.generated.scenarios:
        for topic, data in messages.of_scenario(scenario, fit.requested, ego):
            yield topic, data, logged
        yield "markers", scenario_markers(scenario, stamp), logged
        logged += 100_000_000  # players show one scenario after the other
    summary = request_summary(
        result.generated,
        request,
        result.seed,
        stamp,
        inputs=inputs,
        provenance=result.provenance,
        source=encounter.source,
        reactions=result.reacting,
    )
    yield INFO, encode_info(summary), logged


def write_recording(
    folder: Path, results: GenerationResult | Mapping[str, GenerationResult]
) -> Path:
    """Write one result, or several by namespace ("" or e.g. "/case_a"), to a bag; return it.

    The bag appears complete or not at all, and replaces an earlier one of this function. The same
    results give the same bytes.

    Raises:
        InputError: the folder has other content or cannot be written, or a road or fit is unknown.
    """
    with atomic_bag(folder) as bag:
        add_results(bag, {"": results} if isinstance(results, GenerationResult) else results)
    return folder


def add_results(bag: BagWriter, results: Mapping[str, GenerationResult]) -> None:
    """Write all messages of the results, by namespace, to a bag."""
    for namespace, result in results.items():
        for topic, data, stamp_ns in result_messages(result):
            add_message(bag, f"{namespace}/{topic}", data, stamp_ns)


def add_message(bag: BagWriter, name: str, data: bytes, stamp_ns: int) -> None:
    """Write a message of one of the suite's topics, by its full name, to a bag."""
    kind, quality = topic_entry(
        name.lstrip("/")
    )  # in our bags the diagnostics are a latched topic of the namespace
    bag.add_topic(name, kind, quality)
    bag.write(name, data, stamp_ns)


def scenario_bytes(scenario: Scenario, encounter: Encounter) -> tuple[bytes, str]:
    """Return the CDR bytes of a scenario of that template, and their SHA-256."""
    data = encode_scenario(scenario, encounter.start_ns)
    return data, digest(data)
