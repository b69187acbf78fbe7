# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Messages that say nothing usable are refused by the name of what is wrong."""

import numpy as np
import pytest
from support.message_decoders import decode_state

from msg_conventions import trajectory
from msg_conventions.driving import decode_timed_path
from msg_conventions.ego import encode_state
from msg_conventions.paths import encode_path
from msg_conventions.roads import decode_map, encode_map
from msg_conventions.scenarios import decode_scenario
from msg_conventions.tracks import decode_tracks
from msg_conventions.trajectory import Trajectory
from scenario_gen.base.errors import InputError
from scenario_gen.roads import build_road
from scenario_gen.types import Vehicle

UNTURNED = np.array([0.0, 0.0, 0.0, 1.0]).tobytes()


def _tracks(vehicles: int, samples: int, frame: str = "local_enu") -> bytes:
    flat = np.zeros((vehicles, samples))
    named = tuple(Vehicle(str(k)) for k in range(vehicles))
    time = np.arange(samples) * 100_000_000
    return trajectory.encode(
        Trajectory(7, frame, named, time, np.zeros((vehicles, samples, 2)), flat, flat, flat)
    )


@pytest.mark.parametrize(
    ("vehicles", "samples", "words"),
    [
        (0, 0, r"tracks: joint_names is empty; at least one vehicle is needed"),
        (0, 5, r"tracks: joint_names is empty"),
        (2, 0, r"tracks: 0 sample\(s\); at least 2 are needed"),
        (2, 1, r"tracks: 1 sample\(s\); at least 2 are needed"),
        (1, 5, r"1 vehicle\(s\) and 5 sample\(s\); at least 2 of each"),
    ],
)
def test_empty_tracks_are_refused(vehicles, samples, words):
    with pytest.raises(InputError, match=words):
        decode_tracks(_tracks(vehicles, samples))


@pytest.mark.parametrize(
    ("time_ns", "words"),
    [
        ((5, 6, 7), "begins at 5e-09 s"),
        ((0, 5, 5), "a point is not later than the previous one"),
        ((0,), r"1 point\(s\); at least 2"),
    ],
)
def test_broken_rule_of_time_is_named(time_ns, words):
    flat = np.zeros((1, len(time_ns)))
    sent = Trajectory(
        7,
        "map",
        (Vehicle("1"),),
        np.array(time_ns),
        np.zeros((1, len(time_ns), 2)),
        flat,
        flat,
        flat,
    )
    with pytest.raises(InputError, match=f"scenarios: .*{words}"):
        decode_scenario(trajectory.encode(sent))


def _messages(frame: str) -> dict[str, tuple[object, bytes]]:
    """A decoder and a message of each kind with poses; every heading is 0."""
    pose = np.zeros((2, 3))
    road = build_road("straight", None)
    object.__setattr__(road, "frame_id", frame)
    return {
        "tracks": (decode_tracks, _tracks(2, 3, frame)),
        "path": (decode_timed_path, encode_path(pose, np.array([7, 8]), frame, 7)),
        "state": (decode_state, encode_state(np.zeros(4), "vehicle_a", frame, 7)),
        "map": (decode_map, encode_map(road, 7)),
    }


@pytest.mark.parametrize("kind", ["tracks", "path", "state", "map"])
def test_quaternions_of_zeros(kind):
    decode, data = _messages("map")[kind]
    decode(data)
    assert UNTURNED in data
    with pytest.raises(
        InputError, match=rf"{kind}.*: quaternion 0 is \(0, 0, 0, 0\), which is no rotation"
    ):
        decode(data.replace(UNTURNED, bytes(32)))


@pytest.mark.parametrize("kind", ["tracks", "map"])
def test_empty_frames(kind):
    decode, data = _messages("")[kind]
    with pytest.raises(InputError, match=rf"{kind}: header\.frame_id is empty; name the frame"):
        decode(data)
