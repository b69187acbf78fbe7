# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounters whose reactions are known: one behind another, and one that waits for another to cross."""

import numpy as np

from scenario_gen.types import Vehicle
from support.motions import encounter_of

DT = 0.1


def wander(rng, count, sigma=1.0, length=2.0):
    """A smooth random speed about 12 m/s."""
    time = np.arange(count) * DT
    covariance = sigma**2 * np.exp(-0.5 * ((time[:, None] - time) / length) ** 2) + 1e-8 * np.eye(
        count
    )
    return 12.0 + np.linalg.cholesky(covariance) @ rng.standard_normal(count)


def answering(leader, lag, gain):
    """The speed of one who answers a leader's speed after `lag` seconds."""
    late = round(lag / DT)
    return 12.0 + gain * (np.concatenate([np.full(late, leader[0]), leader[:-late]]) - 12.0)


def along(speed, start, lane=0.0):
    s = start + np.concatenate([[0.0], np.cumsum(0.5 * DT * (speed[1:] + speed[:-1]))])
    return np.column_stack([s, np.full(len(s), lane)])


def lane_encounter(leader, follower, gap=20.0, lane=0.0):
    """Two vehicles on the x axis, the second `gap` metres behind the first."""
    position = np.stack([along(leader, gap), along(follower, 0.0, lane)])
    return encounter_of(position, speed=np.stack([leader, follower]), name="lane")


def crossing(wait_until, speed=8.0, seconds=20.0):
    """Vehicle 1 drives east through the origin at 6 s; vehicle 2 comes from the south, stands before it, and leaves then."""
    time = np.arange(round(seconds / DT) + 1) * DT
    first = np.column_stack([speed * (time - 6.0), np.zeros(len(time))])
    stop, begins = -8.0, 3.0
    own = np.where(
        time < begins,
        8.0 * (1.0 - time / begins),
        np.where(time < wait_until, 0.0, np.minimum(2.0 * (time - wait_until), 8.0)),
    )
    y = np.concatenate([[0.0], np.cumsum(0.5 * DT * (own[1:] + own[:-1]))])
    y += stop - y[round(begins / DT)]
    position = np.stack([first, np.column_stack([np.full(len(time), 0.0), y])])
    speeds = np.stack([np.full(len(time), speed), own])
    return encounter_of(position, np.array([[0.0], [0.5 * np.pi]]), speeds, name="crossing")


def platoon(count, rows=200, seed=3):
    """So many vehicles on the x axis, each 20 m behind the one before it, whose speed it answers after 1.2 s."""
    speeds = [wander(np.random.default_rng(seed), rows)]
    for _ in range(1, count):
        speeds.append(answering(speeds[-1], 1.2, 0.9))
    position = np.stack([along(speed, 20.0 * (count - 1 - k)) for k, speed in enumerate(speeds)])
    return encounter_of(position, speed=np.stack(speeds), name="platoon")


def led_crossing(wait_until=8.0):
    """The crossing, with vehicle 3 20 m ahead of vehicle 1."""
    two = crossing(wait_until)
    heading, speed = (np.concatenate([own, own[:1]]) for own in (two.heading, two.speed))
    position = np.concatenate([two.position, two.position[:1] + np.array([20.0, 0.0])])
    return encounter_of(position, heading, speed, (*two.vehicles, Vehicle("3")), name="led")
