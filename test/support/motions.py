# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios, roads and random motions for the checker's tests."""

import numpy as np

from scenario_gen.base.road_users import Dynamics
from scenario_gen.method.validity import Checker, Limits
from scenario_gen.types import Encounter, Vehicle
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import Scenario

_UNLIMITED = Dynamics(1e6, 1e6, 1e6, 1e6, 1e6)
FREE = Limits(car=_UNLIMITED, truck=_UNLIMITED, slip=1e6, acceleration_tolerance=1e6)


def road_of(drivable, resolution=0.2, origin=(0.0, 0.0)):
    return Road("test", drivable, resolution, origin, np.empty((0, 3)), np.empty((0, 3)))


def open_road(size=200.0, resolution=0.25):
    cells = int(size / resolution)
    return road_of(np.ones((cells, cells), dtype=bool), resolution, (-0.5 * size, -0.5 * size))


def encounter_of(position, heading=0.0, speed=10.0, vehicles=None, *, dt=0.1, name="two", **more):
    """An encounter at 10 Hz from positions (N, T, 2); headings and speeds may be one for all, vehicles are called 1, 2, …"""
    shape = np.shape(position)[:2]
    heading, speed = (np.broadcast_to(values, shape) for values in (heading, speed))
    vehicles = vehicles or tuple(Vehicle(str(k + 1)) for k in range(shape[0]))
    return Encounter.sampled(vehicles, dt, position, heading, speed, name, **more)


def encounter_of_drives(*drives, width=1.9):
    """An encounter from (poses (T, 3), speeds (T,)) of vehicles that are called 0, 1, …"""
    poses, speed = (np.stack(values) for values in zip(*drives, strict=True))
    vehicles = tuple(Vehicle(str(k), 4.8, width) for k in range(len(poses)))
    return encounter_of(poses[..., :2], poses[..., 2], speed, vehicles)


def as_scenario(encounter, pace=1.0):
    """The encounter as a scenario, driven `pace` times as fast."""
    arrays = (encounter.time, encounter.position, encounter.heading, pace * encounter.speed)
    rate = np.gradient(pace * encounter.speed, encounter.dt, axis=1)
    return Scenario(encounter.vehicles, *arrays, rate, present=encounter.present)


def oncoming(side, count=101):
    """Two that pass each other at 10 m/s, each 1.75 m on its own `side` of the middle: 1 for the right."""
    way = 1.0 * np.arange(count) - 0.5 * (count - 1)
    position = np.stack(
        [np.column_stack([k * way, np.full(count, -1.75 * k * side)]) for k in (1.0, -1.0)]
    )
    return encounter_of(position, np.array([[0.0], [np.pi]]), name="o")


def scenario_of(tracks, time, vehicles=None):
    """A scenario from (position (T, 2), heading (T,), speed (T,)) per vehicle; the acceleration is the mean of each step."""
    position, heading, speed = (
        np.array(values, dtype=float) for values in zip(*tracks, strict=True)
    )
    rate = np.diff(speed, axis=1) / np.diff(time)
    acceleration = np.concatenate((rate, rate[:, -1:]), axis=1)
    vehicles = vehicles or tuple(Vehicle(f"v{i}") for i in range(len(tracks)))
    return Scenario(vehicles, time, position, heading, speed, acceleration)


def verdict_of(scenario, **known):
    """The checker's verdict on one scenario; what is not known is not checked, and nothing is limited."""
    given = dict.fromkeys(("road", "requested", "conflicts", "waits")) | {"limits": FREE} | known
    (verdict,) = Checker(**given).check([scenario])
    return verdict


def causes_of(scenario, **known):
    return [violation.cause for violation in verdict_of(scenario, **known).violations]


def straight(x, y, yaw, speed, time):
    """A steady straight drive."""
    s = speed * time
    return (
        np.stack((x + s * np.cos(yaw), y + s * np.sin(yaw)), axis=-1),
        np.full(time.size, yaw),
        np.full(time.size, speed),
    )


def arc(x, y, yaw, speed, yaw_rate, time):
    """A steady circular drive."""
    heading, radius = yaw + yaw_rate * time, speed / yaw_rate
    position = np.stack(
        (
            x + radius * (np.sin(heading) - np.sin(yaw)),
            y - radius * (np.cos(heading) - np.cos(yaw)),
        ),
        axis=-1,
    )
    return position, heading, np.full(time.size, speed)


def wander(rng, time, spread, max_speed=12.0):
    """A smooth random drive: speed and yaw rate are random sums of sines."""
    fine = np.linspace(time[0], time[-1], 40 * (time.size - 1) + 1)
    waves = [
        rng.normal(size=3)
        @ np.sin(np.outer(rng.uniform(0.1, 1.0, 3), fine) + rng.uniform(0, 6, (3, 1)))
        for _ in range(2)
    ]
    speed = np.clip(rng.uniform(0, max_speed) + 2.0 * waves[0], 0.0, None)
    heading = rng.uniform(-np.pi, np.pi) + np.concatenate(
        ([0.0], np.cumsum(0.4 * waves[1][1:] * np.diff(fine)))
    )
    velocity = speed[:, None] * np.stack((np.cos(heading), np.sin(heading)), axis=-1)
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(fine)[:, None]
    position = rng.uniform(-spread, spread, 2) + np.concatenate(
        (np.zeros((1, 2)), np.cumsum(steps, axis=0))
    )
    return position[::40], heading[::40], speed[::40]
