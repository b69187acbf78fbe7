# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A template from its messages: tracks, changepoints, road, fit, routes and diagnostics."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from msg_conventions.changepoints import decode_changepoints
from msg_conventions.diagnostics import decode_diagnostics, TEMPLATE, template_of
from msg_conventions.fits import anchor_stamps, decode_fit
from msg_conventions.hashes import decode_hashes, hash_of
from msg_conventions.lanes import TOPIC as LANES
from msg_conventions.paths import decode_route
from msg_conventions.roads import decode_map
from msg_conventions.topics import vehicle_topic
from msg_conventions.tracks import decode_tracks
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Ints
from scenario_gen.types import Encounter, Fit, GenerationResult, Route, tokens


def missing_topics(messages: Mapping[str, bytes]) -> list[str]:
    """Return the topics that `decode_template` needs and the messages lack.

    Raises:
        InputError: `tracks` is damaged.
    """
    needed = ["tracks", "changepoints", "map", "fit"]
    if "tracks" in messages:
        names = tokens(decode_tracks(messages["tracks"]).ids)
        needed += [vehicle_topic(name, "route") for name in names]
    return [topic for topic in needed if topic not in messages]


def decode_template(messages: Mapping[str, bytes]) -> GenerationResult:
    """Return the fitted template in messages by topic; entries, exits and lanes are optional.

    Its fit has the requested states, but not the decisions for each vehicle, which the messages
    lack.

    Raises:
        InputError: a message is damaged, in another frame than the map, or missing.
    """
    encounter = decode_tracks(messages["tracks"])
    segmentation = decode_changepoints(messages["changepoints"], encounter)
    _, road = decode_map(
        messages["map"],
        messages.get("road/entries"),
        messages.get("road/exits"),
        messages.get(LANES),
    )
    _, frame, requested, poses = decode_fit(messages["fit"])
    anchors = anchor_stamps(encounter, segmentation.changepoints)
    if poses.shape[:2] != (len(encounter.vehicles), len(anchors)):
        raise InputError(
            f"fit: {poses.shape[0]} vehicles at {poses.shape[1]} points, but tracks and "
            f"changepoints have {len(encounter.vehicles)} at {len(anchors)}"
        )
    routes = decode_routes(messages, encounter, anchors)
    for topic, other, _ in routes:
        if {frame, other} != {road.frame_id}:
            raise InputError(
                f"{topic}: frame {other!r}, fit {frame!r} and map {road.frame_id!r} must agree"
            )
    fit = Fit(
        encounter.vehicles, (), anchor_index(encounter, segmentation.changepoints), requested, ()
    )
    return GenerationResult(
        encounter, segmentation, road, fit, tuple(route for _, _, route in routes)
    )


def decode_routes(
    messages: Mapping[str, bytes], encounter: Encounter, anchors_ns: Sequence[int]
) -> list[tuple[str, str, Route]]:
    """Return topic, frame and route of every vehicle.

    Args:
        messages: by topic.
        encounter: names the vehicles.
        anchors_ns: (K + 2,) stamps of the template.

    Raises:
        InputError: a route is missing or damaged.
    """
    routes = []
    for name in tokens(encounter.ids):
        topic = vehicle_topic(name, "route")
        if topic not in messages:
            raise InputError(f"{topic} is missing, but tracks has a vehicle {name!r}")
        routes.append((topic, *decode_route(messages[topic], anchors_ns, topic)))
    return routes


def lanes_beside(
    grid: bytes, maps: Iterable[bytes], lanes: Sequence[bytes], infos: Iterable[bytes]
) -> bytes | None:
    """Return the lanes that a `fit/info` names with a map, or those of a bag with one map.

    Args:
        grid: message of the map.
        maps: all maps of the bag.
        lanes: all messages on `road/lanes`.
        infos: all messages on `fit/info`.

    Raises:
        InputError: one of `infos` is damaged.
    """
    if not lanes:
        return None
    map_hash = hash_of("map", grid)
    for info in infos:
        hashes = decode_hashes(info, "fit/info")
        if hashes.get("map") == map_hash:
            named = (data for data in lanes if hash_of(LANES, data) == hashes.get(LANES))
            return next(named, None)
    has_one_map = len({hash_of("map", data) for data in maps}) == 1
    return lanes[-1] if has_one_map else None


def anchor_index(encounter: Encounter, changepoints: Ints) -> Ints:
    """Return the samples (K + 2,) of start, changepoints and end."""
    return np.array([0, *changepoints, encounter.speed.shape[1] - 1])


def template_statuses(
    messages: Iterable[bytes], stamp_ns: int, nodes: str = "/"
) -> dict[str, Mapping[str, str]]:
    """Return the key-values of diagnostics about one template, by subject; the last ones count.

    The subject of "/planner: fit" is "fit".

    Args:
        messages: those of /diagnostics.
        stamp_ns: stamp of the template.
        nodes: prefix of the full names of the nodes.
    """
    by_subject: dict[str, Mapping[str, str]] = {}
    for data in messages:
        try:
            stamp, statuses = decode_diagnostics(data)
        except InputError:
            continue
        for status in statuses:
            if template_of(status, stamp) == stamp_ns and status.name.startswith(nodes):
                values = {key: value for key, value in status.values.items() if key != TEMPLATE}
                by_subject[status.name.partition(": ")[2]] = values
    return by_subject
