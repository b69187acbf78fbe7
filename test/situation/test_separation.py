# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How near vehicles come to one another."""

import numpy as np
import pytest
from support.motions import encounter_of

from scenario_gen.base.errors import RefusedError
from scenario_gen.situation import clean_tracks, interaction_windows, Situation
from scenario_gen.situation.separation import least_gaps, separate
from scenario_gen.types import ALWAYS, Vehicle

TIME = 0.1 * np.arange(30)


def queue(*places, present=ALWAYS, width=2.0):
    """Vehicles of 4 m by 2 m, or another width, that drive along x at 5 m/s, so many metres ahead of the first one's place."""
    way = np.column_stack([5.0 * TIME, np.zeros(len(TIME))])
    position = np.stack([way + np.array([x, 0.0]) for x in places])
    vehicles = tuple(Vehicle(str(n), 4.0, width) for n in range(len(places)))
    return encounter_of(position, 0.0, 5.0, vehicles, present=present)


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
    passing = encounter_of(position, np.array([[0.0], [np.pi]]), 8.0)
    windows = interaction_windows(Situation.of(passing))
    assert windows[:, 1] - windows[:, 0] == pytest.approx(5.0)
    assert windows[:, 0] == pytest.approx(begin, abs=0.06)


@pytest.mark.parametrize("free", [0.6, 1.2])
def test_queue_is_pulled_apart_lengthwise(free):
    """Two overlap by 0.49 m; a third is free of them until the second is moved towards it."""
    tracks = clean_tracks(queue(0.0, 3.51, 7.51 + free, width=0.6))
    separation = separate(tracks, 0.5, 1.0, sideways=0.0)
    x = np.stack([track.poses[:, 0] for track in separation.tracks])
    assert (np.diff(x, axis=0) > 4.499).all()
    assert np.ptp(x[:, 0]) == pytest.approx(max(9.0, 8.005 + free), abs=0.01)


def test_longer_shifts_are_refused():
    """Two pairs overlap by 0.49 m: 1.45 m between them are less than shifts of 0.5 m need."""
    tracks = clean_tracks(queue(0.0, 3.51, 8.96, 12.47, width=0.6))
    assert separate(tracks, 0.5, 0.6, sideways=0.0).moved.max() > 0.5
    with pytest.raises(RefusedError):
        separate(tracks, 0.5, 0.5, sideways=0.0)
