"""Small worlds with known answers: a crossing of two cars, and samples around it."""

import numpy as np

from scenario_gen.encounter import Encounter, Vehicle
from scenario_gen.scenario import Scenario

CARS = (Vehicle("west", 4.0, 2.0), Vehicle("south", 4.0, 2.0))


def crossing(dt=0.1, steps=121, lag=2.0):
    """Car 0 drives east at 10 m/s through the origin at t = 5 s; car 1 north, `lag` seconds later, slowing a little."""
    time = np.arange(steps) * dt
    east = 10.0 * (time - 5.0)
    pace = 9.0 + 2.0 * np.cos(2.0 * np.pi * time / time[-1])
    north = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) * dt)])
    north -= np.interp(5.0 + lag, time, north)
    zero = np.zeros_like(time)
    position = np.stack([np.stack([east, zero], -1), np.stack([zero, north], -1)])
    heading = np.stack([zero, zero + np.pi / 2])
    return Encounter("crossing", CARS, 0, round(dt * 1e9), position, heading, np.stack([zero + 10.0, pace]))


def replayed(encounter, index=0, shift=(0.0, 0.0), pace=1.0):
    """The encounter as a scenario: shifted, and its speeds scaled about their mean by `pace`."""
    mean = encounter.speed.mean(axis=1, keepdims=True)
    speed = mean + pace * (encounter.speed - mean)
    dt = encounter.dt
    step = 0.5 * (speed[:, 1:] + speed[:, :-1]) * dt
    along = np.concatenate([np.zeros((len(speed), 1)), np.cumsum(step, axis=1)], axis=1)
    way = np.stack([np.cos(encounter.heading), np.sin(encounter.heading)], axis=-1)
    position = encounter.position[:, :1] + along[..., None] * way + np.asarray(shift)
    return Scenario(
        encounter.vehicles, encounter.time, position, encounter.heading, speed, np.gradient(speed, dt, axis=1), index=index
    )


def samples(encounter, count, seed=3, spread=0.5, pace=1.0):
    """`count` scenarios around the encounter, shifted at random."""
    rng = np.random.default_rng(seed)
    return [replayed(encounter, i, rng.normal(0.0, spread, 2), pace + rng.normal(0.0, 0.1)) for i in range(count)]
