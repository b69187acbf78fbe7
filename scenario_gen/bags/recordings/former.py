# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags of drafts before the documents: read in the present layout; remove after the next release.

Their `road/info` and `fit/info` list the hashes of the messages that belong together, lanes are
JSON in the text of a marker, and the decisions of the fitting are on /diagnostics.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
import json
import math
from typing import Any

import numpy as np

from msg_conventions import diagnostics, documents
from msg_conventions.cdr import decode
from msg_conventions.changepoints import decode_changepoints
from msg_conventions.documents import encode_document, hash_of, LANES, PLAN, short_hash, typed
from msg_conventions.fits import anchor_stamps, decode_fit, INPUTS, Plan
from msg_conventions.layouts import MARKER
from msg_conventions.paths import decode_route
from msg_conventions.pictures import Action
from msg_conventions.roads import decode_map, decode_poses, RoadDescription
from msg_conventions.scenario_info import INFO
from msg_conventions.topics import vehicle_topic
from msg_conventions.tracks import decode_tracks
from scenario_gen.bags.recordings.former_info import upgraded_info
from scenario_gen.bags.storage.messages import BagMessage
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.types import FittedVehicle, LaneNetwork, Loss, Note, NoteKind, Route, tokens

_INFOS = ("road/info", PLAN)
Messages = Mapping[str, Sequence[BagMessage]]
"""Messages by topic."""
Statuses = Callable[[int], Mapping[str, Mapping[str, str]]]
"""Returns the key-values of the diagnostics about the template with a stamp, by subject."""


def upgraded(messages: Messages, statuses: Statuses) -> Messages:
    """Return messages with `road/lanes`, `fit/info` and `scenarios/info` in the present layout."""
    entries = [_upgraded_info(message) for message in messages.get(INFO, ())]
    messages = {**messages, INFO: entries} if entries else messages
    infos = [
        (topic, message)
        for topic in _INFOS
        for message in messages.get(topic, ())
        if message.type == diagnostics.TYPE
    ]
    if not infos:
        return messages
    documents_by_topic: dict[str, list[BagMessage]] = {LANES: [], PLAN: []}
    for topic, info in infos:
        with suppress(InputError):  # what a damaged message says is missing
            _, (status, *_) = diagnostics.decode_diagnostics(info.data, topic)
            named = _named(messages, status.values)
            data = {LANES: _description(named, status.values["map"])}
            if topic == PLAN and {"fit", "tracks", "changepoints"} <= named.keys():
                data[PLAN] = _plan(named, statuses, data[LANES])
            for name, document in data.items():
                place = f"{info.topic.removesuffix(topic)}{name}"
                upgrade = info._replace(topic=place, type=documents.TYPE, data=document)
                documents_by_topic[name].append(upgrade)
    return {**messages, **documents_by_topic}


def _upgraded_info(message: BagMessage) -> BagMessage:
    """Return a message of `scenarios/info`; a damaged one as it is."""
    if message.type == diagnostics.TYPE:
        with suppress(InputError):
            data = upgraded_info(message.data)
            return message._replace(type=documents.TYPE, data=data)
    return message


def _named(messages: Messages, hashes: Mapping[str, str]) -> dict[str, bytes]:
    """Return the messages with these hashes by topic."""
    named = {}
    for topic, wanted in hashes.items():
        for message in messages.get(topic, ()):
            data = message.data
            if topic == LANES:  # without DDS's padding
                data = data[: len(data) - (len(data) - 1) % 4]
            digest = short_hash(data) if topic == LANES else hash_of(topic, data)
            if digest == wanted:
                named[topic] = message.data
    return named


def _description(named: Mapping[str, bytes], map_hash: str) -> bytes:
    """Return the present `road/lanes`."""
    if "map" not in named:
        raise InputError("the map is missing")
    stamp_ns, road = decode_map(named["map"])
    entries, exits = (
        decode_poses(named[topic], topic)[2] if topic in named else np.zeros((0, 3))
        for topic in ("road/entries", "road/exits")
    )
    lanes = _lanes(named[LANES]) if LANES in named else None
    return encode_document(
        RoadDescription(stamp_ns, road.frame_id, {"map": map_hash}, entries, exits, lanes)
    )


def _lanes(data: bytes) -> LaneNetwork | None:
    """Return the lanes of a marker: borders in its points, all else in its text."""
    marker = decode(MARKER, data, LANES)
    if marker.action == Action.DELETE:
        return None
    with guarded(f"{LANES}: damaged"):
        document = json.loads(marker.text)
        start = 0
        for lane in document["lanes"]:
            count = 2 * (lane["points"] - 1)
            borders = marker.points[start : start + 2 * count, :2].reshape(2, count, 2)
            lane["left"], lane["right"] = (
                np.concatenate((border[:1], border[1::2])).tolist() for border in borders
            )
            lane["neighbours"] = lane["beside"]
            start += 2 * count
        kinds = document.get("note_kinds", "").split(";")
        document["notes"] = list(zip(kinds, document["notes"], strict=False))
        network: LaneNetwork = typed(LaneNetwork, document)
        return network


def _plan(named: Mapping[str, bytes], statuses: Statuses, description: bytes) -> bytes:
    """Return the present `fit/info`."""
    encounter = decode_tracks(named["tracks"])
    segmentation = decode_changepoints(named["changepoints"], encounter)
    stamps = anchor_stamps(encounter, segmentation.changepoints)
    _, frame_id, requested, poses = decode_fit(named["fit"])
    about = statuses(encounter.start_ns)
    with guarded("fit: damaged, or not there"):
        fitted = tuple(
            _fitted(anchors, about[f"fit of {name}"])
            for anchors, name in zip(poses, encounter.ids, strict=True)
        )
        topics = [vehicle_topic(name, "route") for name in tokens(encounter.ids)]
        routes = tuple(
            _with_figures(decode_route(named[topic], stamps, topic)[1], about[f"fit of {name}"])
            for topic, name in zip(topics, encounter.ids, strict=True)
        )
        losses = tuple(
            typed(Loss, dict(zip(("kind", "vehicles", "message"), json.loads(text), strict=True)))
            for key, text in about["fit"].items()
            if key.startswith("lost.")
        )
    pairs = zip(routes, encounter.ids, strict=True)
    remarks = {remark for route, name in pairs for remark in route.remarks(name)}
    texts = [text for key, text in about["fit"].items() if key.startswith("note.")]
    notes = tuple(Note(NoteKind.TEXT, recorded=text) for text in texts if text not in remarks)
    anchors = np.array([(stamp - stamps[0]) // encounter.dt_ns for stamp in stamps])
    inputs = {topic: hash_of(topic, named[topic]) for topic in INPUTS[:-1] if topic in named}
    inputs[LANES] = hash_of(LANES, description)
    return encode_document(
        Plan(
            encounter.start_ns, frame_id, inputs, anchors, requested, fitted, routes, notes, losses
        )
    )


def _fitted(anchors: Any, values: Mapping[str, str]) -> FittedVehicle:
    """Return the decisions of the fitting in a status."""
    turned = json.loads(values.get("turned_rad", "null")) or (math.nan, math.nan)
    moved, stands = (np.array(json.loads(values[key])) for key in ("moved_m", "stands"))
    scale, manoeuvre = float(values["scale"]), values["manoeuvre"]
    return FittedVehicle(anchors, moved, stands, scale, manoeuvre, (turned[0], turned[1]))


def _with_figures(route: Route, values: Mapping[str, str]) -> Route:
    """Return a route with the figures in a status."""
    if "legs_joined" not in values:
        return route
    keys = ("legs_joined", "legs_searched", "anchors_left_out", "farthest_from_fit_m")
    joined, searched, left_out, farthest = (json.loads(values[key]) for key in keys)
    return replace(
        route,
        joined=joined,
        searched=searched,
        left_out=tuple(left_out),
        farthest=math.nan if farthest is None else farthest,
    )
