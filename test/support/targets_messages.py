# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The decoders of messages as targets, one per type; and what is made of their texts."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from rosbags.typesys import get_typestore, Stores

from msg_conventions import (
    diagnostics,
    ego,
    frames,
    odometry,
    paths,
    roads,
    streams,
    tracks,
    trajectory,
)
from msg_conventions.changepoints import (
    decode_changepoints,
    decode_posterior,
    encode_changepoints,
    encode_posterior,
    POSTERIOR_TYPE,
)
from msg_conventions.fits import decode_fit
from msg_conventions.hashes import decode_hashes, hash_of
from msg_conventions.scenario_info import decode_info, ScenarioEntry
from msg_conventions.scenarios import decode_scenario, encode_scenario
from msg_conventions.topics import FIX_TYPE, TWIST_TYPE
from scenario_gen.bags.recordings.template import decode_template
from scenario_gen.bags.recordings.write import result_messages
from scenario_gen.types import Vehicle
from scenario_gen.types.scenario import EgoSlot
from support.bag_examples import hand_made_run
from support.harness import Target
from support.message_examples import encounter, route, scenario, segmentation
from support.mutators import BYTES, fields

STORE = get_typestore(Stores.ROS2_JAZZY)
TEMPLATE = encounter(3)
STAMPS = [TEMPLATE.start_ns + k * TEMPLATE.dt_ns for k in (0, 12, 13, 14, 39)]


def seeds(kind: str, examples: Callable[[], Sequence[bytes]], _folder: Path) -> list[bytes]:
    """Our bytes, and those of rosbags' serialisation of the same messages."""
    own = list(examples())
    return own + [
        bytes(STORE.serialize_cdr(STORE.deserialize_cdr(data, kind), kind)) for data in own
    ]


def of_run(*topics: str) -> list[bytes]:
    """The messages of some topics of a run."""
    return [data for topic, data, _ in result_messages(hand_made_run()) if topic in topics]


def ends() -> list[bytes]:
    """The messages of the ego slot."""
    return [
        data
        for _, data in ego.ego_messages(
            EgoSlot(Vehicle("5"), np.zeros(4), np.ones(4)), "map", 7_000_000_000
        )
    ]


def reports(data: bytes) -> None:
    """Decode diagnostics, and all that is read from their texts."""
    diagnostics.decode_diagnostics(data)
    for info in decode_info(data):
        if isinstance(info, ScenarioEntry):
            info.asked()
        else:
            info.sentence()
            info.result()


def template(messages: dict[str, bytes], topic: str, data: bytes) -> None:
    """Read a template of whose messages one is damaged."""
    decode_template(messages | {topic: data})


def decoder(
    name: str,
    kind: str,
    examples: Callable[[], Sequence[bytes]],
    decode: Callable[[bytes], object],
) -> Target:
    """Return the target of a decoder."""
    return Target(
        name,
        partial(seeds, kind, examples),
        lambda data, _folder: decode(data),
        (*BYTES, *[fields(kind)] * 5),
    )


def template_targets() -> tuple[Target, ...]:
    """Return one target per message of a template."""
    messages = {topic: data for topic, data, _ in result_messages(hand_made_run())}
    kinds = {
        "tracks": trajectory.TYPE,
        "changepoints": trajectory.TYPE,
        "fit": trajectory.TYPE,
        "map": roads.MAP_TYPE,
    }
    kinds |= {"vehicle_1/route": paths.TYPE, "road/entries": roads.POSES_TYPE}
    return tuple(
        decoder(
            f"template_{topic.replace('/', '_')}",
            kind,
            partial(of_run, topic),
            partial(template, messages, topic),
        )
        for topic, kind in kinds.items()
    )


TARGETS = (
    decoder(
        "message_tracks",
        trajectory.TYPE,
        lambda: [tracks.encode_tracks(encounter(1))],
        tracks.decode_tracks,
    ),
    decoder(
        "message_changepoints",
        trajectory.TYPE,
        lambda: [encode_changepoints(TEMPLATE, segmentation(k)) for k in (1, 2)],
        lambda data: decode_changepoints(data, TEMPLATE),
    ),
    decoder(
        "message_posterior",
        POSTERIOR_TYPE,
        lambda: [encode_posterior(TEMPLATE, segmentation(1))],
        decode_posterior,
    ),
    decoder(
        "message_scenarios",
        trajectory.TYPE,
        lambda: [encode_scenario(scenario(k), 5) for k in (1, 2)],
        decode_scenario,
    ),
    decoder(
        "message_diagnostics",
        diagnostics.TYPE,
        lambda: of_run("diagnostics", "scenarios/info"),
        reports,
    ),
    decoder(
        "message_route",
        paths.TYPE,
        lambda: [paths.encode_route(route(k), STAMPS, "map") for k in (1, 2)],
        lambda data: (paths.decode_path(data), paths.decode_route(data, STAMPS)),
    ),
    decoder(
        "message_belonging",
        diagnostics.TYPE,
        lambda: of_run("road/info", "fit/info"),
        lambda d: decode_hashes(d, "info"),
    ),
    decoder("message_map_hash", roads.MAP_TYPE, lambda: of_run("map"), partial(hash_of, "map")),
    decoder("message_map", roads.MAP_TYPE, lambda: of_run("map"), roads.decode_map),
    decoder(
        "message_poses",
        roads.POSES_TYPE,
        lambda: of_run("road/entries", "road/exits"),
        roads.decode_poses,
    ),
    decoder("message_odometry", odometry.TYPE, ends, ego.decode_state),
    decoder("message_fit", trajectory.TYPE, lambda: of_run("fit"), decode_fit),
    decoder(
        "message_fix",
        FIX_TYPE,
        lambda: [streams.encode_fix(48.1, 11.2, 5, "vehicle_1")],
        streams.decode_fix,
    ),
    decoder(
        "message_frames",
        frames.TYPE,
        lambda: [
            frames.encode_frames(
                np.array([[1.0, 2.0, 0.5]] * k), [f"vehicle_{n}" for n in range(k)], "map", 5
            )
            for k in (1, 3)
        ],
        frames.decode_frames,
    ),
    decoder(
        "message_speed",
        TWIST_TYPE,
        lambda: [streams.encode_speed(8.5, 5, "vehicle_1")],
        streams.decode_speed,
    ),
    *template_targets(),
)
