# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""On its own road nothing is adapted that the template drove: its way, its bends, its ends and how it comes to a stand."""

from dataclasses import replace

import numpy as np
import pytest
from support.motions import encounter_of

from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.routing.task import distances_to_line
from scenario_gen.method.sampling.build_model import build_model
from scenario_gen.method.sampling.plan import Plan
from scenario_gen.method.sampling.vehicle_model import NoiseScale
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import build_road
from scenario_gen.situation import find_waits, Situation
from scenario_gen.types import NoteKind

DT = 0.1
CONFIG = PipelineConfig()
NARROW = replace(CONFIG.sampling, drivers=0.0)


def track(speed, bend):
    """Positions, headings and speeds of one that drives `speed` (T,) through curvatures `bend` (arc length -> 1/m)."""
    s = np.concatenate([[0.0], np.cumsum(0.5 * DT * (speed[1:] + speed[:-1]))])
    fine = np.linspace(0.0, s[-1], 4000)
    yaw = np.concatenate([[0.0], np.cumsum(bend(0.5 * (fine[1:] + fine[:-1])) * np.diff(fine))])
    step = np.diff(fine) * np.array([np.cos(yaw[:-1]), np.sin(yaw[:-1])])
    way = np.concatenate([np.zeros((2, 1)), np.cumsum(step, axis=1)], axis=1)
    return (
        np.column_stack([np.interp(s, fine, row) for row in way]),
        np.interp(s, fine, yaw),
        speed,
    )


def apart(drives, offset):
    """Two drives, the second one moved [m]."""
    position, heading, speed = (np.stack(values) for values in zip(*drives, strict=True))
    return encounter_of(position + np.array([[(0.0, 0.0)], [offset]]), heading, speed)


def s_bend():
    """Two cars through an S-bend at up to 3.4 m/s² sideways, one behind the other."""
    time = np.arange(201) * DT
    drives = [
        track(13.0 + 0.8 * np.sin(0.4 * (time - late)), lambda s: 0.02 * np.sin(s / 22.0))
        for late in (0.0, 1.5)
    ]
    return apart(drives, (-22.0, 0.0))


def rolls_out():
    """A car slows down, rolls at walking pace, and stands at last; one beside it ends while it brakes hard."""
    time = np.arange(141) * DT
    slow = np.interp(time, [0.0, 5.0, 8.0, 11.0, 14.0], [8.0, 6.0, 0.45, 0.0, 0.0])
    hard = np.interp(time, [0.0, 4.0, 13.0, 14.0], [6.0, 9.0, 9.0, 5.0])
    drives = [
        track(np.convolve(np.pad(v, 3, mode="edge"), np.ones(7) / 7.0, "valid"), lambda s: 0.0 * s)
        for v in (slow, hard)
    ]
    return apart(drives, (0.0, 4.0))


def undisturbed(encounter, segmentation):
    """The drive without deviations on the own road, and what was adapted."""
    road = build_road("corridor", encounter, CONFIG.road)
    planned = Chain(Situation.of(encounter), segmentation, road, CONFIG).plan()
    asked, waits = planned.fit.requested, find_waits(encounter)
    plan = Plan(Situation.of(encounter), segmentation, road, planned.routes, asked, waits)
    done = build_model(plan, NARROW)
    drawn = done.model.draw(np.zeros((1, done.model.size)), NoiseScale())
    return drawn.scenarios(0, [0], "map")[0], done.notes, planned


@pytest.mark.parametrize("encounter", [s_bend(), rolls_out()], ids=["s-bend", "rolls out"])
def test_own_road_is_driven_unchanged(encounter):
    segmentation = segment(encounter, CONFIG.segmentation)
    drive, adapted, planned = undisturbed(encounter, segmentation)
    assert not {NoteKind.SLOWED, NoteKind.STRETCHED} & {note.kind for note in adapted}
    assert drive.speed.shape == encounter.speed.shape
    for n, route in enumerate(planned.routes):
        assert distances_to_line(route.points, encounter.position[n]).max() < 0.1
    off = np.sqrt(np.square(drive.speed - encounter.speed).mean(axis=1))
    assert (off < 0.25).all()


def test_who_still_rolls_does_not_stand():
    encounter = rolls_out()
    drive, _, _ = undisturbed(encounter, segment(encounter, CONFIG.segmentation))
    rolls = (encounter.time > 8.5) & (encounter.time < 10.0)
    assert (drive.speed[0, rolls] > 0.05).all() and (drive.speed[0, -10:] == 0.0).all()
