# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Records that end in another vehicle's way: driven on, or refused by name."""

from dataclasses import replace

import numpy as np
import pytest
from support.textbook_motions import labelled

import scenario_gen as sg
from scenario_gen.method.continuation import driven_on
from scenario_gen.situation import find_conflicts, Situation


def cut_in_the_area(kind, seconds=0.3, seed=0):
    """The first vehicle's record ends shortly after its entry; the encounter goes on."""
    whole = replace(labelled(kind, seed).encounter, name=kind)
    conflict = Situation.of(whole).conflicts[0]
    present = whole.present.copy()
    present[conflict.first, 1] = np.searchsorted(whole.time, conflict.entry_first + seconds)
    return whole, replace(whole, present=present), conflict.first


@pytest.mark.parametrize("kind", ["crossing, stops", "left turn before oncoming, stops"])
def test_vehicle_is_continued_beyond_the_area(kind):
    whole, cut, first = cut_in_the_area(kind)
    made, (note,) = driven_on(cut)
    assert f"vehicle {whole.vehicles[first].id} drives on" in str(note)
    real, new, vanishing = (Situation.of(each).conflicts[0] for each in (whole, made, cut))
    assert new.encroachment == pytest.approx(real.encroachment, abs=0.4)
    assert vanishing.encroachment > real.encroachment + 0.2, "as if it had vanished"
    end = made.present[first, 1]
    assert made.time[end] > new.exit_first + 1.0
    rows = slice(made.present[first, 0], end + 1)
    steps = np.hypot(*np.diff(made.position[first, rows], axis=0).T)
    assert np.abs(steps / made.dt - made.speed[first, rows][1:]).max() < 1.0, "without a jump"
    assert driven_on(made) == (made, ()) and driven_on(whole) == (whole, ())
    result = sg.generate(cut, "corridor", count=2, seed=1)
    assert "drives on" in " ".join(map(str, result.fit.notes))
    for scenario in result:
        (conflict,) = find_conflicts(scenario)
        assert scenario.time[scenario.present[first, 1]] > conflict.exit_first


def test_standing_in_area_is_refused():
    _, cut, first = cut_in_the_area("crossing, stops")
    speed, position = cut.speed.copy(), cut.position.copy()
    end = cut.present[first, 1]
    speed[first, end - 15 :], position[first, end - 15 :] = 0.0, position[first, end]
    stands = replace(cut, speed=speed, position=position)
    with pytest.raises(sg.RefusedError, match=r"stands in the conflict area when its recording"):
        sg.generate(stands, "corridor", count=1)
