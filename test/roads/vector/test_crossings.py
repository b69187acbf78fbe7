# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Who crosses another one's path in the template does so on the map, also where its roads are of another width."""

from itertools import islice

import numpy as np
import pytest
from support.map_builders import FORMATS, write
from support.motions import encounter_of

from scenario_gen.logs import read_log
from scenario_gen.roads import find_places, lane_graph, read_network
from scenario_gen.situation import clean_tracks, find_conflicts
from scenario_gen.types import Vehicle

STEPS, DT = 100, 0.1


def left_turn(median, start):
    """One turns left, 76° of it, after an oncoming one has passed, whose lane lies `median` metres to the left."""
    arc = np.minimum(np.maximum(np.arange(STEPS) * DT * 4.0 - 11.0, 0.0), 24.0) / 18.0
    yaw = arc
    turning = np.cumsum(0.4 * np.column_stack((np.cos(yaw), np.sin(yaw))), axis=0) - (11.0, 0.0)
    oncoming = np.column_stack((start - 0.8 * np.arange(STEPS), np.full(STEPS, median)))[:40]
    oncoming = np.concatenate((oncoming, np.repeat(oncoming[-1:], STEPS - 40, axis=0)))
    speed = np.stack((np.full(STEPS, 4.0), np.where(np.arange(STEPS) < 39, 8.0, 0.0)))
    vehicles = (Vehicle("turns", 4.0, 1.8), Vehicle("oncoming", 4.0, 1.8))
    heading = np.stack((yaw, np.full(STEPS, np.pi)))
    return encounter_of(np.stack((turning, oncoming)), heading, speed, vehicles)


def meet(tracks):
    """Whether two are in conflict."""
    poses, vehicles = np.stack([track.poses for track in tracks]), [t.vehicle for t in tracks]
    return bool(find_conflicts(encounter_of(poses[..., :2], poses[..., 2], 0.0, vehicles)))


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize(("median", "start"), [(4.0, 12.0), (7.0, 15.5), (10.0, 18.0)])
def test_left_turn_crosses_oncoming_lane(tmp_path, suffix, median, start):
    tracks = clean_tracks(left_turn(median, start))
    assert meet(tracks)
    graph = lane_graph(read_network(write(tmp_path, suffix)))
    placed = list(islice(find_places(graph, tracks), 2))
    assert placed
    for place in placed:
        assert meet(place.separation.tracks)


@pytest.mark.recorded
@pytest.mark.parametrize(
    "name", ["simple_4way_intersection", "fabriksgatan", "multi_intersections"]
)
def test_recorded_left_turn_crosses_oncoming_lane(data, name):
    """Of a wide crossroads: as one piece it resembles right turns of a narrow one more."""
    log = next((data / "trajectories" / "ngsim_commonroad").glob("encounter_b_left_turn*.csv"))
    tracks = clean_tracks(read_log(log).encounters[0])
    graph = lane_graph(read_network(data / "maps" / "opendrive" / f"{name}.xodr"))
    assert meet(next(find_places(graph, tracks)).separation.tracks)
