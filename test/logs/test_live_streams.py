# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Streams come out as samples on the common clock, whatever happens to their messages; and as the log that they are."""

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


def fed(messages, streams=None):
    """Samples of the messages, and the streams."""
    streams = streams or Streams()
    samples = []
    for kind, *values in messages:
        (streams.put_fix if kind == "fix" else streams.put_speed)(*values)
        samples += streams.samples()
    return samples, streams


def same(one, other):
    return len(one) == len(other) and all(
        a.stamp_ns == b.stamp_ns
        and a.vehicles == b.vehicles
        and np.array_equal(a.position, b.position)
        for a, b in zip(one, other, strict=True)
    )


def test_samples_are_the_vehicles_states_on_the_common_clock(encounter):
    samples, streams = fed(messages_of(encounter))
    stamps = np.array([sample.stamp_ns for sample in samples])
    assert (np.diff(stamps) == TICK).all() and stamps[0] == encounter.start_ns
    assert len(samples) >= len(encounter.time) - 7  # the last half second is still waiting
    moved = (
        np.array([s.position for s in samples]).swapaxes(0, 1)
        - encounter.position[:, : len(samples)]
    )
    assert np.ptp(moved, axis=(0, 1)).max() < 0.01  # another origin, nothing else
    assert (
        np.abs(np.array([s.speed for s in samples]).T - encounter.speed[:, : len(samples)]).max()
        < 1e-9
    )
    assert streams.origin.count(",") == 1


def test_disorder_and_repetition_change_nothing(encounter):
    messages = messages_of(encounter)
    rng = np.random.Generator(np.random.PCG64(5))
    late = np.argsort(
        np.arange(len(messages)) + rng.uniform(0.0, 16.0, len(messages))
    )  # by up to 0.4 s
    mixed = [messages[i] for i in late for _ in range(1 + (rng.uniform() < 0.2))]
    expected, streams = fed(messages)
    got, again = fed(mixed)
    assert same(got, expected)
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
    samples, streams = fed(damaged)
    expected, _ = fed(messages_of(encounter))
    assert len(samples) >= len(expected) - 3
    by_stamp = {sample.stamp_ns: sample for sample in expected}
    errors = [
        np.abs(np.diff(s.position - by_stamp[s.stamp_ns].position, axis=0)).max() for s in samples
    ]
    assert max(errors) < 1.0
    (again,) = encounters_of(streams.flush("live"), streams.config).encounters
    assert again.duration > encounter.duration - 1.0


def test_nothing_but_nonsense_gives_no_sample():
    streams = Streams()
    for k in range(60):
        for vehicle in ("1", "2"):
            streams.put_fix(vehicle, k * TICK, math.nan, 200.0)
            streams.put_speed(vehicle, k * TICK, -5.0)
        assert streams.samples() == []
    with pytest.raises(InputError, match="no usable position"):
        encounters_of(streams.flush("live"), streams.config)
    assert streams.flush("live") is None


def test_a_first_fix_off_the_globe_is_no_origin():
    streams, found = Streams(), []
    for k in range(60):
        for number, vehicle in enumerate(("1", "2")):
            streams.put_fix(
                vehicle,
                10**18 + k * TICK,
                300.0 if k == 0 else 42.0 + 1e-6 * k,
                -83.0 + 1e-4 * number,
            )
        found += streams.samples()
    assert found and streams.origin.startswith("42.0")


def test_a_clock_that_runs_backwards_is_said_and_survived():
    streams = Streams()
    for k in range(50):
        for vehicle in ("1", "2"):
            streams.put_fix(vehicle, 10**18 - k * TICK, 42.0, -83.0)
    with pytest.raises(InputError, match="runs backwards"):
        streams.samples()
    assert streams.samples() == []
    later = [
        ("fix", vehicle, 10**18 + k * TICK, 42.0, -83.0)
        for k in range(20)
        for vehicle in ("1", "2")
    ]
    assert len(fed(later, streams)[0]) > 10


def test_vehicles_come_and_go(encounter):
    """A third vehicle is there for four seconds in the middle."""
    messages = messages_of(encounter)
    begin = encounter.start_ns + 5 * 10**9
    extra = [
        (m[0], "9", *m[2:]) for m in messages if m[1] == "1" and begin <= m[2] <= begin + 4 * 10**9
    ]
    samples, _ = fed(sorted(messages + extra, key=lambda m: m[2]))
    there = [len(sample.vehicles) for sample in samples]
    assert [there[0], there[60], there[-1]] == [2, 3, 2]
    assert there.count(3) == 41
    assert [vehicle.id for vehicle in samples[60].vehicles] == ["1", "2", "9"]


def test_a_slower_source_is_waited_for(encounter):
    messages = [
        m
        for m in messages_of(encounter)
        if m[1] == "1" or (m[2] - encounter.start_ns) % 10**9 == 0
    ]
    samples, _ = fed(messages)
    assert {len(sample.vehicles) for sample in samples} == {2}
    assert len(samples) > 140


def test_memory_is_bounded(encounter):
    config = LogConfig(max_duration=2.0)
    streams = Streams(config)
    for k in range(3000):
        streams.put_fix("1", k * TICK // 50, 42.0, -83.0)
        streams.put_fix("2", k * TICK // 50, 42.0, -83.0)
        streams.samples()
    assert len(streams._all["1"].fixes) <= 200
    assert len(streams._recent["1"].fixes) <= 200


def test_a_clock_that_was_set_is_noticed_and_one_wrong_stamp_is_not():
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
