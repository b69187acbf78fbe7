# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounter ⇄ `tracks`: a whole template in one message (conventions: trajectory.py).

Frame `local_enu`: metres east and north of the log's origin. QoS: reliable, transient_local, depth
1. An absent vehicle is far below the ground (trajectory.py). Accelerations are the central
differences of the speeds; `decode_tracks` ignores them. The encounter's name and geodetic origin
are not in the message: nothing is computed from them.
"""

import numpy as np

from msg_conventions import trajectory
from msg_conventions.trajectory import Trajectory
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Ints, NS_PER_S, runs
from scenario_gen.types import ALWAYS, Encounter, Vehicle

FRAME = "local_enu"


def encode_tracks(encounter: Encounter) -> bytes:
    """Return the encounter as CDR bytes."""
    return encode_samples(encounter, np.arange(encounter.speed.shape[1]))


def encode_samples(encounter: Encounter, at: Ints) -> bytes:
    """Return the states at samples `at` (K,) of the encounter as CDR bytes."""
    acceleration = np.gradient(encounter.speed, encounter.dt, axis=1)
    states = (
        encounter.position[:, at],
        encounter.heading[:, at],
        encounter.speed[:, at],
        acceleration[:, at],
    )
    present = None if encounter.all_present else encounter.is_present[:, at]
    return trajectory.encode(
        Trajectory(
            encounter.start_ns,
            FRAME,
            encounter.vehicles,
            at * encounter.dt_ns,
            *states,
            present=present,
            lights=encounter.lights,
        )
    )


def decode_tracks(data: bytes, name: str = "tracks") -> Encounter:
    """Return the encounter.

    Raises:
        InputError: the message is damaged, its times are not evenly spaced from 0, or it is no
            encounter (one vehicle, …).
    """
    message = trajectory.decode(data, name)
    if len(message.time_ns) < 2:
        raise InputError(
            f"{name}: {len(message.time_ns)} sample(s); at least 2 are needed to say how anybody "
            "drives"
        )
    steps = np.diff(message.time_ns)
    if message.time_ns[0] != 0:
        raise InputError(
            f"{name}: the first sample is at {message.time_ns[0] * 1e-9:g} s; time_from_start "
            "must count from 0"
        )
    if (uneven := (steps <= 0) | (steps != steps[0])).any():
        at = int(np.argmax(uneven))
        raise InputError(
            f"{name}: sample {at + 1} comes {steps[at] * 1e-9:g} s after the previous one, sample "
            f"1 {steps[0] * 1e-9:g} s; "
            "time_from_start must count in even steps; resample the tracks (10 Hz is usual)"
        )
    if (
        not 1_000_000 <= steps[0] <= 10 * NS_PER_S
        or message.time_ns[-1] > trajectory.MAX_DURATION_NS
    ):
        raise InputError(
            f"{name}: {len(steps)} steps of {steps[0] * 1e-9:g} s; steps of 0.001 to 10 s and at "
            "most "
            f"{trajectory.MAX_DURATION_NS * 1e-9:g} s in all are read"
        )
    states = (message.position, message.heading, message.speed)
    present = (
        ALWAYS if message.present is None else _spans(message.present, message.vehicles, name)
    )
    return Encounter.sampled(
        message.vehicles,
        int(steps[0]) * 1e-9,
        *states,
        name=name,
        start_ns=message.stamp_ns,
        present=present,
        lights=message.lights,
    )


def _spans(present: Bools, vehicles: tuple[Vehicle, ...], name: str) -> Ints:
    """Return the first and last sample (N, 2) at which each vehicle is present, from flags (N, T).

    Raises:
        InputError: a vehicle is never present, or returns.
    """
    spans = []
    for vehicle, row in zip(vehicles, present, strict=True):
        intervals = runs(row)
        if len(intervals) != 1:
            raise InputError(
                f"{name}: vehicle {vehicle.id} is present {len(intervals)} times (by its z); it "
                "must arrive and leave once"
            )
        begin, end = intervals[0]
        spans.append((begin, end - 1))
    return np.array(spans, dtype=np.int64)
