# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`scenarios` (conventions: trajectory.py): one message per scenario, several where vehicles arrive late or leave early.

Frame: the road's. Stamp: the template's, so that the bytes depend on the request alone; a scenario's SHA-256 joins it with its
`scenarios/info`, which also holds seed and index. QoS: reliable, transient_local, depth 1000.

A vehicle is in a message from its first point to its last, and never while it is absent. So vehicles that are there
from and to the same instants share a message (neighbours in the scenario's order: it is kept), and a scenario in which all are
there throughout is one. `time_from_start` counts from the scenario's start in each, so a consumer that takes every message for
itself sees each vehicle where and when it is. The messages of a scenario follow each other, then its entry of `scenarios/info`,
whose `messages` are their SHA-256 and whose `sha256` is that of all their bytes in order. In this package a scenario's data is
those bytes, of one message or of several; `messages_of` separates them.
"""

from collections.abc import Iterator, Sequence
import hashlib
from itertools import pairwise

import numpy as np

from msg_conventions import trajectory
from msg_conventions.cdr import HEADER, NANOSECONDS
from msg_conventions.trajectory import Trajectory
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Ints
from scenario_gen.types import Scenario


def encode_scenario(scenario: Scenario, stamp_ns: int) -> bytes:
    """Return the scenario as CDR bytes: those of its messages, one after the other."""
    return b"".join(trajectory.encode(part) for part in _parts(scenario, stamp_ns))


def _parts(scenario: Scenario, stamp_ns: int) -> Iterator[Trajectory]:
    """Yield the content of each message: neighbouring vehicles that come and go together."""
    time_ns = np.rint(scenario.time * NANOSECONDS).astype(np.int64)
    edges = [
        0,
        *(1 + np.flatnonzero((np.diff(scenario.present, axis=0) != 0).any(axis=1))).tolist(),
        len(scenario.vehicles),
    ]
    for begin, end in pairwise(edges):
        first, last = scenario.present[begin].tolist()
        rows, at = slice(begin, end), slice(first, last + 1)
        heading, speed, acceleration = (
            each[rows, at] for each in (scenario.heading, scenario.speed, scenario.acceleration)
        )
        states = (scenario.position[rows, at], heading, speed, acceleration)
        yield Trajectory(
            stamp_ns, scenario.frame_id, scenario.vehicles[rows], time_ns[at], *states
        )


def messages_of(data: bytes, what: str = "scenarios") -> tuple[bytes, ...]:
    """Return the messages of a scenario's data.

    Raises:
        InputError: it is damaged.
    """
    return tuple(message for _, message in _read(data, what))


def _read(data: bytes, what: str) -> Iterator[tuple[Trajectory, bytes]]:
    place = 0
    while not place or len(data) - place >= len(
        HEADER
    ):  # a message may be filled up to four bytes
        found, size = trajectory.decode_first(data[place:] if place else data, what)
        yield found, data[place : place + size]
        place += size


def decode_scenario(
    data: bytes, *, seed: int = 0, index: int = 0, what: str = "scenarios", late: bool = False
) -> tuple[int, Scenario]:
    """Return the stamp [ns] and the scenario; seed and index are in its `scenarios/info`.

    Args:
        data: of one message, or of all the scenario's.
        seed: of its request.
        index: its number in it.
        what: names it in messages.
        late: it may begin later than at 0, as the track of one who arrives late.

    Raises:
        InputError: a message is damaged, its times do not increase from 0, or messages are not of one scenario.
    """
    parts = [part for part, _ in _read(data, what)]
    for part in parts:
        if len(part.time_ns) < 2:
            raise InputError(f"{what}: {len(part.time_ns)} point(s); at least 2 are needed")
        if (np.diff(part.time_ns) <= 0).any():
            raise InputError(
                f"{what}: a point is not later than the one before; time_from_start must increase from 0"
            )
    time_ns = np.unique(np.concatenate([part.time_ns for part in parts]))
    if late and time_ns[0] > 0:
        time_ns = np.concatenate((np.zeros(1, dtype=np.int64), time_ns))
    if time_ns[0] != 0:
        raise InputError(
            f"{what}: it begins at {time_ns[0] * 1e-9:g} s; time_from_start must increase from 0 (who arrives late is in a "
            "message of its own: the scenario's others are needed too)"
        )
    if time_ns[-1] > trajectory.LONGEST_NS:
        raise InputError(
            f"{what}: it lasts {time_ns[-1] * 1e-9:g} s; at most {trajectory.LONGEST_NS * 1e-9:g} s are read"
        )
    return parts[0].stamp_ns, _joined(parts, time_ns, seed, index, what)


def _joined(
    parts: Sequence[Trajectory], time_ns: Ints, seed: int, index: int, what: str
) -> Scenario:
    """Return the scenario of its messages, which have the instants (T,) [ns] between them."""
    head = parts[0]
    ids = [vehicle.id for part in parts for vehicle in part.vehicles]
    if any(
        (part.stamp_ns, part.frame_id) != (head.stamp_ns, head.frame_id) for part in parts
    ) or len(set(ids)) < len(ids):
        raise InputError(
            f"{what}: messages with other stamps or frames, or with the same vehicle, are not one scenario"
        )
    present, arrays = [], []
    for part in parts:
        first = int(np.searchsorted(time_ns, part.time_ns[0]))
        last = first + len(part.time_ns) - 1
        if last >= len(time_ns) or (time_ns[first : last + 1] != part.time_ns).any():
            raise InputError(
                f"{what}: vehicle {part.vehicles[0].id} has other instants than who is there with it"
            )
        present += [(first, last)] * len(part.vehicles)
        widths = (first, len(time_ns) - 1 - last)
        values = (
            part.position[..., 0],
            part.position[..., 1],
            part.heading,
            part.speed,
            part.acceleration,
        )
        arrays.append(np.stack([np.pad(value, ((0, 0), widths), mode="edge") for value in values]))
    x, y, heading, speed, acceleration = np.concatenate(arrays, axis=1)
    vehicles = tuple(vehicle for part in parts for vehicle in part.vehicles)
    states = (np.stack((x, y), axis=-1), heading, speed, acceleration)
    return Scenario(
        vehicles,
        time_ns / NANOSECONDS,
        *states,
        seed,
        index,
        head.frame_id,
        present=np.array(present, dtype=np.int64),
    )


def digest(data: bytes) -> str:
    """Return the SHA-256 of a scenario's or a message's CDR bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()
