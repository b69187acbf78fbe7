# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`scenarios` (conventions: trajectory.py): one message per scenario, or several.

There are several if vehicles arrive late or leave early.

Frame: the road's. Stamp: the template's, so that the bytes depend on the request alone. A
scenario's SHA-256 joins it with its `scenarios/info`, which also has seed and index. QoS:
reliable, transient_local, depth 1000.

A vehicle is present from the first to the last point of its message. So neighbouring vehicles with
the same presence share a message, and a scenario in which all are present throughout is one
message. `time_from_start` counts from the scenario's start in each, so a consumer that processes
each message alone sees every vehicle at the right time. The messages of a scenario follow each
other. Then comes its entry in `scenarios/info`, whose `messages` are their SHA-256, and whose
`sha256` is that of all their bytes in order. In this package a scenario's data are these bytes;
`messages_of` separates the messages.
"""

from collections.abc import Iterator, Sequence
import hashlib
from itertools import pairwise

import numpy as np

from msg_conventions import trajectory
from msg_conventions.cdr import HEADER
from msg_conventions.trajectory import Trajectory
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Ints, NS_PER_S
from scenario_gen.types import Scenario


def encode_scenario(scenario: Scenario, stamp_ns: int) -> bytes:
    """Return the scenario as the CDR bytes of its messages, one after the other."""
    return b"".join(trajectory.encode(part) for part in _parts(scenario, stamp_ns))


def _parts(scenario: Scenario, stamp_ns: int) -> Iterator[Trajectory]:
    """Yield the content of each message: neighbouring vehicles with the same presence."""
    time_ns = np.rint(scenario.time * NS_PER_S).astype(np.int64)
    changes = (np.diff(scenario.present, axis=0) != 0).any(axis=1)
    edges = [0, *(1 + np.flatnonzero(changes)).tolist(), len(scenario.vehicles)]
    for begin, end in pairwise(edges):
        first, last = scenario.present[begin].tolist()
        rows = slice(begin, end)
        steps = slice(first, last + 1)
        yield Trajectory(
            stamp_ns=stamp_ns,
            frame_id=scenario.frame_id,
            vehicles=scenario.vehicles[rows],
            time_ns=time_ns[steps],
            position=scenario.position[rows, steps],
            heading=scenario.heading[rows, steps],
            speed=scenario.speed[rows, steps],
            acceleration=scenario.acceleration[rows, steps],
        )


def messages_of(data: bytes, source: str = "scenarios") -> tuple[bytes, ...]:
    """Return the messages of a scenario's data.

    Raises:
        InputError: it is damaged.
    """
    return tuple(message for _, message in _read(data, source))


def _read(data: bytes, source: str) -> Iterator[tuple[Trajectory, bytes]]:
    place = 0
    while not place or len(data) - place >= len(HEADER):  # up to 3 bytes of padding may follow
        part, size = trajectory.decode_first(data[place:] if place else data, source)
        yield part, data[place : place + size]
        place += size


def decode_scenario(
    data: bytes,
    *,
    seed: int = 0,
    index: int = 0,
    source: str = "scenarios",
    may_start_late: bool = False,
) -> tuple[int, Scenario]:
    """Return the stamp [ns] and the scenario; seed and index are in its `scenarios/info`.

    Args:
        data: of one message, or of all messages of the scenario.
        seed: of its request.
        index: its number in the request.
        source: names it in errors.
        may_start_late: whether it may begin after 0, as a vehicle that arrives late does.

    Raises:
        InputError: a message is damaged, its times do not increase from 0, or messages are not of
            one scenario.
    """
    parts = [part for part, _ in _read(data, source)]
    for part in parts:
        if len(part.time_ns) < 2:
            raise InputError(f"{source}: {len(part.time_ns)} point(s); at least 2 are needed")
        if (np.diff(part.time_ns) <= 0).any():
            raise InputError(
                f"{source}: a point is not later than the previous one; time_from_start must "
                "increase from 0"
            )
    time_ns = np.unique(np.concatenate([part.time_ns for part in parts]))
    if may_start_late and time_ns[0] > 0:
        time_ns = np.concatenate((np.zeros(1, dtype=np.int64), time_ns))
    if time_ns[0] != 0:
        raise InputError(
            f"{source}: it begins at {time_ns[0] * 1e-9:g} s; time_from_start must increase from "
            "0 (a vehicle that arrives "
            "late has a message of its own: the scenario's other messages are needed, too)"
        )
    if time_ns[-1] > trajectory.MAX_DURATION_NS:
        raise InputError(
            f"{source}: it lasts {time_ns[-1] * 1e-9:g} s; at most "
            f"{trajectory.MAX_DURATION_NS * 1e-9:g} s are read"
        )
    return parts[0].stamp_ns, _joined(parts, time_ns, seed, index, source)


def _joined(
    parts: Sequence[Trajectory], time_ns: Ints, seed: int, index: int, source: str
) -> Scenario:
    """Return the scenario with the instants (T,) [ns] from its messages."""
    head = parts[0]
    ids = [vehicle.id for part in parts for vehicle in part.vehicles]
    headers = {(part.stamp_ns, part.frame_id) for part in parts}
    if len(headers) > 1 or len(set(ids)) < len(ids):
        raise InputError(
            f"{source}: messages with other stamps or frames, or with the same vehicle, are not "
            "one scenario"
        )
    present, arrays = [], []
    for part in parts:
        first = int(np.searchsorted(time_ns, part.time_ns[0]))
        last = first + len(part.time_ns) - 1
        if last >= len(time_ns) or (time_ns[first : last + 1] != part.time_ns).any():
            raise InputError(
                f"{source}: vehicle {part.vehicles[0].id} has other instants than the vehicles "
                "present with it"
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
        time_ns / NS_PER_S,
        *states,
        seed,
        index,
        head.frame_id,
        present=np.array(present, dtype=np.int64),
    )


def digest(data: bytes) -> str:
    """Return the SHA-256 of a scenario's or a message's CDR bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()
