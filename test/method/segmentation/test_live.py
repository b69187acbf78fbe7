# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Samples of vehicles that come and go, changepoints as they are confirmed."""

import numpy as np
import pytest

from msg_conventions import trajectory
from msg_conventions.changepoints import encode_live_changepoints
from scenario_gen.method.segmentation import LiveSegmenter, OnlineSegmenter
from scenario_gen.types import Sample, Vehicle

TICK = 100_000_000
START = 10**18


@pytest.fixture
def samples(encounter_of):
    t = np.arange(400) * 0.1
    speeds = np.array(
        [np.full(400, 8.0), np.interp(t, [0, 10, 15, 25, 30, 40], [10, 10, 2, 2, 12, 12])]
    )
    made = encounter_of(speeds, noise=0.1, seed=3)
    return [
        Sample(START + k * TICK, made.vehicles, made.position[:, k], made.speed[:, k])
        for k in range(400)
    ]


def found_in(samples):
    live = LiveSegmenter(TICK)
    return [
        (sample.stamp_ns, found) for sample in samples if (found := live.push(sample)) is not None
    ]


def test_changepoints_come_soon_with_the_states_there(samples):
    found = found_in(samples)
    at = np.concatenate([f.time_ns for _, f in found]) * 1e-9
    assert np.abs(at - [10.0, 15.0, 25.0, 30.0]).max() <= 0.4
    online = OnlineSegmenter(2, 0.1)
    alone = [change for sample in samples for change in online.push(sample.position, sample.speed)]
    assert [p for _, f in found for p in f.probability] == [change.probability for change in alone]
    assert max(stamp - START - int(f.time_ns[-1]) for stamp, f in found) <= 1.5e9
    for _, f in found:
        assert f.start_ns == START
        index = int(f.time_ns[0]) // TICK
        assert np.array_equal(f.position[:, 0], samples[index].position)
        assert np.abs(f.heading).max() < 0.2
        assert (f.probability > 0.9).all()
        message = trajectory.decode(encode_live_changepoints(f), "changepoints/live")
        assert np.array_equal(message.time_ns, f.time_ns) and np.array_equal(
            message.position, f.position
        )
        assert (message.stamp_ns, message.frame_id) == (START, "local_enu")


def test_another_set_of_vehicles_or_a_gap_begins_a_new_stretch(samples):
    third = Vehicle("third")

    def joined(sample):
        place = np.vstack([sample.position, [[0.0, 50.0]]])
        return Sample(
            sample.stamp_ns, (*sample.vehicles, third), place, np.append(sample.speed, 0.0)
        )

    starts = {f.start_ns for _, f in found_in([*samples[:200], *map(joined, samples[200:])])}
    assert starts == {START, START + 200 * TICK}
    starts = {f.start_ns for _, f in found_in([*samples[:200], *samples[201:]])}
    assert starts == {START, START + 201 * TICK}
