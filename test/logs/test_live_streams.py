# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Streams come out as the log that they are, whatever happens to their messages."""

import math

import numpy as np
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.logs import encounters_of, LogConfig, read_log, Streams
from scenario_gen.logs.geodesy import latitude_longitude
from scenario_gen.logs.streams import FAR_NS
from scenario_gen.logs.synthetic import bundled

TICK = 100_000_000


@pytest.fixture(scope="module")
def encounter():
    return read_log(bundled("c")).encounters[0]


def messages_of(encounter):
    """(kind, vehicle, stamp, values…) of every sample, in order of time."""
    places = latitude_longitude(encounter)
    found = []
    for k in range(encounter.speed.shape[1]):
        stamp = encounter.start_ns + k * encounter.dt_ns
        for i, vehicle in enumerate(encounter.vehicles):
            found.append(("fix", vehicle.id, stamp, *places[i, k]))
            found.append(("speed", vehicle.id, stamp, encounter.speed[i, k]))
    return found


def fed(messages, config=LogConfig()):
    """Streams with these messages."""
    streams = Streams(config)
    for kind, *values in messages:
        (streams.put_fix if kind == "fix" else streams.put_speed)(*values)
    return streams


def test_messages_have_stamp_row_and_value():
    streams = Streams()
    streams.put_fix("1", 7 * TICK, 48.0, 11.0)
    streams.put_speed("1", 8 * TICK, 3.5)
    (vehicle,) = streams.flush("live").vehicles
    assert (vehicle.fix_ns, vehicle.fix_row, vehicle.fix.tolist()) == (7 * TICK, 1, [[48.0, 11.0]])
    assert (vehicle.speed_ns, vehicle.speed_row, vehicle.speed) == (8 * TICK, 2, 3.5)


def test_streams_are_read_like_a_log(encounter):
    streams = fed(messages_of(encounter))
    (again,) = encounters_of(streams.flush("live"), streams.config).encounters
    assert again.vehicles == encounter.vehicles
    assert again.start_ns == encounter.start_ns
    assert again.duration == pytest.approx(encounter.duration)
    moved = again.position - encounter.position
    assert np.ptp(moved, axis=(0, 1)).max() < 0.2  # smoothed once more, about another origin
    assert streams.flush("live") is None


def test_disorder_and_repetition_change_nothing(encounter):
    messages = messages_of(encounter)
    rng = np.random.Generator(np.random.PCG64(5))
    late = np.argsort(
        np.arange(len(messages)) + rng.uniform(0.0, 16.0, len(messages))
    )  # by up to 0.4 s
    mixed = [messages[i] for i in late for _ in range(1 + (rng.uniform() < 0.2))]
    streams, again = fed(messages), fed(mixed)
    one, two = (encounters_of(s.flush("live"), s.config).encounters[0] for s in (streams, again))
    assert np.array_equal(one.position, two.position) and one.start_ns == two.start_ns


def test_lost_and_wrong_messages_are_bridged(encounter):
    rng = np.random.Generator(np.random.PCG64(6))
    damaged = []
    for kind, vehicle, stamp, *values in messages_of(encounter):
        chance = rng.uniform()
        if chance < 0.1:
            continue
        wrong = (
            [math.nan] * len(values)
            if chance < 0.2
            else [value + 0.01 for value in values]
            if chance < 0.22
            else values
        )
        strange = stamp + 3600 * 10**9 if 0.22 < chance < 0.24 else stamp
        damaged.append(
            (kind, vehicle, strange, *(values if chance < 0.24 and strange != stamp else wrong))
        )
    streams = fed(damaged)
    (again,) = encounters_of(streams.flush("live"), streams.config).encounters
    assert again.duration > encounter.duration - 1.0


def test_backward_clock_is_refused_and_forgotten(encounter):
    streams = Streams()
    for k in range(50):
        for vehicle in ("1", "2"):
            streams.put_fix(vehicle, 10**18 - k * TICK, 42.0, -83.0)
    with pytest.raises(InputError):
        encounters_of(streams.flush("live"), streams.config)
    for kind, *values in messages_of(encounter):
        (streams.put_fix if kind == "fix" else streams.put_speed)(*values)
    (again,) = encounters_of(streams.flush("live"), streams.config).encounters
    assert again.start_ns == encounter.start_ns


def test_memory_is_bounded(encounter):
    config = LogConfig(max_duration=2.0)
    streams = Streams(config)
    for k in range(3000):
        streams.put_fix("1", k * TICK // 50, 42.0, -83.0)
        streams.put_fix("2", k * TICK // 50, 42.0, -83.0)
    assert len(streams._rows["1"].fixes) <= 200


def test_set_clock_differs_from_wrong_stamp():
    streams = Streams()
    streams.put_speed("1", 10**18, 1.0)
    assert [streams.breaks(10**18 + FAR_NS + 1) for _ in range(5)] == [
        False,
        False,
        False,
        False,
        True,
    ]
    assert not streams.breaks(10**18 + TICK)
    assert not streams.breaks(10**18 + FAR_NS + 1)
    streams.put_speed("1", 10**18 + FAR_NS + 1, 1.0)
    assert streams.seconds == 0.0
