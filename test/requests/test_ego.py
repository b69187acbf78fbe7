# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The ego slot: one vehicle is left out, the others are as valid as ever, and its template track is given."""

from dataclasses import replace

from given import answer, Given
import numpy as np
import pytest

from scenario_gen.logs import read_log
from scenario_gen.roads import build_road
from scenario_gen.roads.clearance import footprint_fits
from scenario_gen.segmentation import segment
from scenario_gen.template.interaction import find_conflicts, waits_to_keep
from scenario_gen.types.request import Request
from scenario_gen.types.scenario import BoundaryStates
from scenario_gen.validity import Checker


@pytest.mark.parametrize("ego", ["1", "2"])
def test_of_two_vehicles_one_is_left(chain, plain, ego):
    made = answer(chain, Request(ego=ego), count=5).generated
    index = int(ego) - 1
    assert [v.id for s in made.scenarios for v in s.vehicles] == ["2" if ego == "1" else "1"] * 5
    asked = plain.fit.asked
    for s in made.scenarios:
        assert s.position[0, 0] == pytest.approx(asked.start[1 - index, :2], abs=1e-5)
        assert s.position[0, -1] == pytest.approx(asked.end[1 - index, :2], abs=1e-5)
    track = made.ego
    assert [v.id for v in track.vehicles] == [ego]
    for k, state in ((0, asked.start[index]), (-1, asked.end[index])):
        assert track.position[0, k] == pytest.approx(state[:2], abs=1e-9)
        assert np.cos(track.heading[0, k] - state[2]) == pytest.approx(1.0)
        assert track.speed[0, k] == state[3]
    assert np.array_equal(track.time, np.round(chain.encounter.time, 9)), "stamps are the template's"


def test_the_track_is_drivable_in_shape_and_on_the_road(chain):
    track = answer(chain, Request(ego="2"), count=1).generated.ego
    poses = np.column_stack([track.position[0], track.heading[0]])
    vehicle = track.vehicles[0]
    assert footprint_fits(chain.road, poses, vehicle.length, vehicle.width).all()
    step = np.hypot(*np.diff(track.position[0], axis=0).T)
    assert np.abs(step / 0.1 - 0.5 * (track.speed[0, 1:] + track.speed[0, :-1]))[1:-1].max() < 1.5
    along = np.cos(np.arctan2(*np.diff(track.position[0], axis=0).T[::-1]) - track.heading[0, :-1])
    assert along[step > 0.2].min() > 0.99


def test_leaving_one_out_does_not_wait_for_its_limits(chain):
    """An ego that nobody could drive does not stand in the way of the others."""
    slow = replace(chain, encounter=chain.encounter, sampling=replace(chain.sampling, max_speed=11.0, max_stretch=0.0))
    fast = Request(ego="1", goals="1: 16.0 8.07 3.14159 40.0")
    assert answer(replace(slow, sampling=replace(slow.sampling, max_speed=40.0)), fast, count=2).generated.scenarios
    assert len(answer(slow, Request(ego="1"), count=2).generated.scenarios) == 2


@pytest.mark.data
@pytest.mark.parametrize("ego", range(3))
def test_the_others_stay_valid_among_themselves(data, ego):
    (log,) = (data / "trajectories" / "ngsim_commonroad").glob("encounter_3plus_*.csv")
    encounter = read_log(log).encounters[0]
    chain = Given(encounter, segment(encounter), build_road("t_intersection", encounter), 0)
    outcome = answer(chain, Request(ego=encounter.vehicles[ego].id), count=3)
    kept = [n for n in range(len(encounter.vehicles)) if n != ego]
    assert len(outcome.generated.scenarios) == 3
    vehicles = tuple(encounter.vehicles[n] for n in kept)
    conflicts = find_conflicts(vehicles, encounter.time, encounter.position[kept], encounter.heading[kept])
    kept_waits = waits_to_keep(chain.encounter, chain.segmentation)
    waits = [replace(wait, vehicle=kept.index(wait.vehicle)) for wait in kept_waits if wait.vehicle != ego]
    asked = BoundaryStates(outcome.fit.asked.start[kept], outcome.fit.asked.end[kept])
    checker = Checker(chain.road, asked, conflicts, waits)
    assert all(verdict.valid for verdict in checker.check(outcome.generated.scenarios))
    assert [v.id for v in outcome.generated.scenarios[0].vehicles] == [v.id for v in vehicles]
