# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How near vehicles come to one another."""

import numpy as np
import pytest

from scenario_gen.situation import interaction_windows, Situation
from scenario_gen.situation.separation import least_gaps
from scenario_gen.types import ALWAYS, Encounter, Vehicle

TIME = 0.1 * np.arange(30)


def queue(*places, present=ALWAYS):
    """Vehicles of 4 m by 2 m that drive along x at 5 m/s, so many metres ahead of the first one's place."""
    way = np.column_stack([5.0 * TIME, np.zeros(len(TIME))])
    position = np.stack([way + np.array([x, 0.0]) for x in places])
    count = len(places)
    vehicles = tuple(Vehicle(str(n), 4.0, 2.0) for n in range(count))
    flat = np.zeros((count, 30))
    return Encounter.sampled(vehicles, 0.1, position, flat, flat + 5.0, "queue", present=present)


def test_least_gap_is_to_nearest():
    encounter = queue(0.0, 4.4, 10.0, 30.0)
    assert least_gaps(encounter) == pytest.approx([0.4, 0.4, 1.6, 16.0])
    assert Situation.of(encounter).least_gap == pytest.approx(0.4)


def test_gaps_of_apart_and_coincident():
    assert Situation.of(queue(0.0, 5.0, present=np.array([[0, 9], [20, 29]]))).least_gap == np.inf
    assert (least_gaps(queue(0.0, 1.0)) < 0.0).all()


@pytest.mark.parametrize(("meet", "begin"), [(6.25, 3.25), (0.5, 0.0), (9.5, 5.0)])
def test_nearest_instants_are_needed(meet, begin):
    """For 5 s about the instant at which two pass each other that react to nothing, or from an end on."""
    time = np.arange(101) * 0.1
    along = np.column_stack([8.0 * time, np.zeros(101)])
    position = np.stack([along, [16.0 * meet, 3.5] - along])
    heading = np.repeat([[0.0], [np.pi]], 101, axis=1)
    vehicles = (Vehicle("1"), Vehicle("2"))
    speed = np.full((2, 101), 8.0)
    passing = Encounter.sampled(vehicles, 0.1, position, heading, speed, "passing")
    windows = interaction_windows(Situation.of(passing))
    assert windows[:, 1] - windows[:, 0] == pytest.approx(5.0)
    assert windows[:, 0] == pytest.approx(begin, abs=0.06)
