# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A hand-made scene: a straight crossed by a quarter turn, with a wait, and a third vehicle that stands."""

from functools import cache

import numpy as np

from benchmarks._paper_speed_profile import SpeedProfile
from scenario_gen.method.sampling import Plan
from scenario_gen.situation import Situation, Wait
from scenario_gen.types import Encounter, Vehicle
from scenario_gen.types.fit import Route, Segmentation
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates

TIME = np.arange(201) * 0.1
CHANGES = (60, 90, 140)
CLOCK = TIME[[0, *CHANGES, 200]]


def straight(length):
    s = np.linspace(0.0, length, int(length / 0.4) + 2)
    return np.column_stack([s, np.zeros_like(s), np.zeros_like(s)]), s


def turn(before, radius, after):
    """South to north, then a quarter turn to the left."""
    total = before + 0.5 * np.pi * radius + after
    s = np.linspace(0.0, total, int(total / 0.4) + 2)
    angle = np.clip((s - before) / radius, 0.0, 0.5 * np.pi)
    rest = np.maximum(s - before - 0.5 * np.pi * radius, 0.0)
    x = 60.0 - radius * (1.0 - np.cos(angle)) - rest
    y = -30.0 + np.minimum(s, before) + radius * np.sin(angle)
    return np.column_stack([x, y, 0.5 * np.pi + angle]), s


def route(points, s, speed):
    driven = SpeedProfile(TIME, speed).state(CLOCK)[0]
    anchor = np.searchsorted(s, driven - 1e-9).clip(0, len(s) - 1)
    anchor[-1] = anchor[-1] if driven[-1] - driven[-2] < 1e-9 else len(s) - 1
    return Route(points, anchor, s)


@cache
def scene(width=60.0):
    """Vehicle 0 drives on, vehicle 1 waits from 7.0 s to 13.0 s, then turns left; vehicle 2 stands throughout."""
    steady = np.full(201, 6.0) + np.sin(TIME / 3.0)
    stopping = np.interp(TIME, [0.0, 4.0, 7.0, 13.0, 17.0, 20.0], [6.0, 6.0, 0.0, 0.0, 6.0, 6.0])
    parts = [straight(SpeedProfile(TIME, steady).travelled[-1])]
    total = SpeedProfile(TIME, stopping).travelled[-1]
    parts.append(turn(35.0, 9.0, total - 35.0 - 4.5 * np.pi))
    routes = [route(*part, speed) for part, speed in zip(parts, (steady, stopping), strict=True)]
    routes.append(Route(np.array([[30.0, 15.0, 0.3]]), np.zeros(5, dtype=int), [0.0]))
    speed = np.array([steady, stopping, np.zeros(201)])
    vehicles = (Vehicle("a"), Vehicle("b"), Vehicle("c"))
    encounter = Encounter.sampled(
        vehicles, 0.1, np.zeros((3, 201, 2)), np.zeros((3, 201)), speed, "scene"
    )
    segmentation = Segmentation(
        np.searchsorted(CHANGES, np.arange(201), side="right"), CHANGES, np.zeros(201), ("",) * 4
    )
    road = Road(
        "open", np.ones((int(2 * width), 500), dtype=bool), 0.5, [-50.0, -0.5 * width], [], []
    )
    asked = BoundaryStates(
        *(
            np.array([[*r.points[r.anchor[k]], v[k]] for r, v in zip(routes, speed, strict=True)])
            for k in (0, -1)
        )
    )
    return encounter, segmentation, road, tuple(routes), asked, (Wait(1, 7.0, 13.0),)


def scene_plan(width=60.0):
    """The scene as the sampler's input."""
    encounter, *planned = scene(width)
    return Plan(Situation.of(encounter), *planned)
