# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Trucks, buses, motorcycles, bicycles and pedestrians: read, kept with their types, and generated within their own limits."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import binary_dilation

from benchmarks._recheck import Account, Recheck
from scenario_gen import generate, read_log
from scenario_gen.base.errors import RefusedError
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.trials import read_trials
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.routing import PlanningConfig
from scenario_gen.method.validity import Limits
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.output.results import write_results
from scenario_gen.roads import RoadConfig
from scenario_gen.situation import Situation
from scenario_gen.types import Dynamics, VEHICLE_TYPES

T = np.arange(0.0, 14.05, 0.1)
SIZES = {"truck": (9.0, 2.5)}  # others have the usual ones


def driven(points, speeds):
    """Rows x, y, heading, speed of who follows a polyline (M, 2) [m] at speeds (T,) [m/s]."""
    along = np.concatenate(([0.0], np.cumsum((speeds[1:] + speeds[:-1]) / 2.0 * 0.1)))
    step = np.diff(points, axis=0)
    reached = np.concatenate(([0.0], np.cumsum(np.hypot(*step.T))))
    yaw = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    x, y = (np.interp(along, reached, column) for column in points.T)
    return np.column_stack(
        (x, y, np.interp(along, (reached[1:] + reached[:-1]) / 2.0, yaw), speeds)
    )


def straight(start, end):
    return np.linspace(start, end, 200)


def left_turn(radius, before):
    angle = np.linspace(0.0, np.pi / 2.0, 60)
    arc = np.column_stack((radius * np.sin(angle), radius * (1.0 - np.cos(angle))))
    return np.concatenate(
        (
            straight((-before, 0.0), (0.0, 0.0))[:-1],
            arc,
            straight(arc[-1], arc[-1] + (0.0, 80.0))[1:],
        )
    )


def standing(speed, begin, end):
    """Speeds of who brakes with 2 m/s² to stand from `begin` to `end` [s], and goes on as before."""
    return np.clip(np.where(begin > T, 2.0 * (begin - T), 2.0 * (T - end)), 0.0, speed)


def log_of(**road_users):
    """A table as a data set has it: road users by type."""
    rows = []
    for name, (kind, states) in road_users.items():
        length, width = SIZES.get(kind, (VEHICLE_TYPES[kind].length, VEHICLE_TYPES[kind].width))
        columns = dict(zip(("x", "y", "heading", "speed"), states.T, strict=True))
        rows.append(
            pd.DataFrame(
                {"id": name, "agent_type": kind, "t": T, "length": length, "width": width}
                | columns
            )
        )
    return pd.concat(rows)


def waits_for_pedestrian(walks=1.4, drives=8.0, away=8.0):
    """A car that stands 2 m before the line on which a pedestrian crosses, and goes on when that one is across."""
    begin = away / walks - 1.5
    end = begin + 1.5 + 3.1 / walks
    travelled = drives * (begin - drives / 2.0) + drives * drives / 4.0
    car = driven(straight((-4.8 - travelled, 0.0), (150.0, 0.0)), standing(drives, begin, end))
    walker = driven(straight((0.0, -away), (0.0, 40.0)), np.full(len(T), walks))
    return log_of(c=("car", car), p=("pedestrian", walker))


def meeting(kind, radius):
    """One that turns left, and a car that lets it pass."""
    car = driven(straight((55.0, 3.5), (-100.0, 3.5)), standing(8.0, 6.0, 11.0))
    return log_of(c=("car", car), u=(kind, driven(left_turn(radius, 35.0), np.full(len(T), 5.0))))


def following(kind, ahead, speed):
    line = straight((0.0, 0.0), (300.0, 0.0))
    leader, follower = (np.asarray(speed + np.sin((T - lag) / 2.0)) for lag in (0.0, 1.2))
    return log_of(a=(ahead, driven(line, leader)), b=(kind, driven(line - (18.0, 0.0), follower)))


WORLDS = {
    "a car waits for a pedestrian": (waits_for_pedestrian(), ("c", "p", "yield")),
    "a bus turns": (meeting("bus", 9.5), ("c", "u", "yield")),
    "a motorcycle turns": (meeting("motorcycle", 8.0), None),
    "a car follows a bicycle": (following("car", "bicycle", 5.0), ("b", "a", "follow")),
    "a truck follows": (following("truck", "car", 9.0), ("b", "a", "follow")),
}


def proven(scenario, limits=Limits()):
    """Whether a scenario keeps to the limits of each type and no footprints overlap, at its instants alone."""
    for n, vehicle in enumerate(scenario.vehicles):
        own, there = limits.of(vehicle.type), scenario.is_present[n]
        step, speed, turn = (
            np.diff(scenario.time[there]),
            scenario.speed[n, there],
            np.diff(scenario.heading[n, there]),
        )
        way = np.hypot(*np.diff(scenario.position[n, there], axis=0).T)
        rate = np.diff(speed) / step
        kept = (
            speed.max() <= own.max_speed
            and -own.max_deceleration <= rate.min()
            and rate.max() <= own.max_acceleration
        )
        kept &= bool((np.abs(turn) <= min(own.sharpest, 1e6) * way + 2e-4).all())
        if not kept:
            return False
    poses = np.concatenate((scenario.position, scenario.heading[..., None]), axis=-1)
    a, b = scenario.vehicles
    both = scenario.is_present.all(axis=0)
    return bool((footprint_gaps(a.half, poses[0, both], b.half, poses[1, both])[0] > 0.0).all())


@pytest.mark.parametrize(
    ("road", "name"),
    [("corridor", name) for name in WORLDS] + [("four_way", "a car waits for a pedestrian")],
)
def test_road_users_keep_their_limits(road, name):
    table, edge = WORLDS[name]
    (encounter,) = read_log(table).encounters
    assert [vehicle.type for vehicle in encounter.vehicles] == list(
        dict(zip(table["id"], table["agent_type"], strict=True)).values()
    )
    edges = [
        (encounter.vehicles[one.who].id, encounter.vehicles[one.whom].id, one.kind)
        for one in Situation.of(encounter).reactions.edges
    ]
    assert edge is None or edge in edges
    case, account = generate(encounter, road, count=5, seed=1), Account()
    made = case.generated.scenarios
    assert len(made) == 5 and all(proven(scenario) for scenario in made)
    judge = Recheck(
        case.encounter, case.road, case.fit.requested, bool(case.segmentation.changepoints.size)
    )
    judge.check(made, account)  # pedestrians may be off the lanes, all others not
    assert account.found == {}
    judge.check(
        [replace(one, position=np.add(one.position, (0.0, 12.0))) for one in made], account
    )
    assert account.found["off_road"] >= 5 or road != "corridor"
    assert {tuple(vehicle.type for vehicle in scenario.vehicles) for scenario in made} == {
        tuple(v.type for v in encounter.vehicles)
    }


def test_pedestrians_walk_as_people_do():
    """One waits at the kerb for a car; waits differ, speeds stay about the recorded 1.4 m/s, and nobody creeps to its place."""
    begin, end, braking, step = 4.0, 8.0, 3.0, 0.8
    speeds = np.clip(np.where(begin > T, braking * (begin - T), braking * (T - end)), 0.0, 1.4)
    walks = driven(straight((0.0, -7.5), (0.0, 40.0)), speeds)
    table = log_of(
        c=("car", driven(straight((-40.0, 0.0), (120.0, 0.0)), np.full(len(T), 8.0))),
        p=("pedestrian", walks),
    )
    (encounter,) = read_log(table).encounters
    made = [generate(encounter, "corridor", count=60, seed=1 + k).generated for k in range(7)]
    walker = [vehicle.id for vehicle in made[0].scenarios[0].vehicles].index("p")
    by_seed = [[scenario.speed[walker] for scenario in each.scenarios] for each in made]
    speed = [one for speeds in by_seed for one in speeds]
    waits = np.array([0.1 * np.count_nonzero(one < 0.05) for one in speed])
    assert 3.0 < waits.mean() < 4.5 and waits.std() > 0.6 and waits.min() > 1.5
    starts = [
        0.1 * one[(one > 0.05) & (one < 0.8)].sum() for one in speed
    ]  # metres, of stopping and starting together
    assert max(starts) < 2.0 * step
    steady = [np.concatenate([one[one > 1.0] for one in speeds]) for speeds in by_seed]
    assert np.median([np.percentile(one, 99) for one in steady]) < 2.1  # one seed scatters by 0.1
    pooled = np.concatenate(steady)
    assert 1.2 < pooled.mean() < 1.5 and pooled.std() > 0.1
    assert np.mean([np.percentile(one[one > 0.05], 20) > 0.5 for one in speed]) > 0.9


@pytest.mark.parametrize("road", ["four_way", "t_intersection", "roundabout"])
def test_bus_drives_its_own_curves(road):
    (encounter,) = read_log(WORLDS["a bus turns"][0]).encounters
    made = generate(encounter, road, count=3, seed=1)
    (bus,) = (n for n, vehicle in enumerate(made.encounter.vehicles) if vehicle.type == "bus")
    drive = ClosedLoop(made.generated.scenarios[0], bus).limits
    assert (drive.max_curvature, drive.max_acceleration) == (
        0.125,
        3.0,
    )  # a bus as ego turns and speeds up like one
    bend = np.abs(np.diff(made.routes[bus].points[:, 2]) / np.diff(made.routes[bus].length))
    assert bend.max() <= VEHICLE_TYPES["bus"].dynamics.planned.max_curvature and all(
        map(proven, made.generated.scenarios)
    )
    across, along = (np.linspace(-0.5, 0.5, count) for count in (9, 41))
    for scenario in made.generated.scenarios:  # all of its footprint, not its outline alone
        ahead = np.stack((np.cos(scenario.heading[bus]), np.sin(scenario.heading[bus])), axis=-1)[
            :, None, None
        ]
        left = np.stack((-ahead[..., 1], ahead[..., 0]), axis=-1)
        size = scenario.vehicles[bus]
        swept = scenario.position[bus][:, None, None] + along[:, None, None] * size.length * ahead
        assert made.road.drivable_at(swept + across[:, None] * size.width * left).all()


@pytest.mark.parametrize("road", ["straight", "t_intersection", "curve"])
def test_pedestrian_makes_no_arm(road):
    (encounter,) = read_log(WORLDS["a car waits for a pedestrian"][0]).encounters
    made = generate(
        encounter, road, PipelineConfig(road=RoadConfig(crossing="zebra")), count=3, seed=1
    )
    assert len(made.generated.scenarios) == 3 and all(map(proven, made.generated.scenarios))
    walked = made.generated.scenarios[0].position[1]
    assert not made.road.drivable_at(walked[[0, -1]]).any()  # from kerb to kerb, beyond both


def overtaken():
    """A car that passes a bicycle on its right."""
    bicycle = driven(straight((20.0, -2.4), (300.0, -2.4)), np.full(len(T), 4.5))
    return log_of(
        a=("car", driven(straight((0.0, 0.0), (300.0, 0.0)), np.full(len(T), 9.0))),
        b=("bicycle", bicycle),
    )


@pytest.mark.parametrize(
    ("road", "table"),
    [
        ("straight", overtaken()),
        ("four_way", meeting("bicycle", 8.0)),
        ("t_intersection", overtaken()),
    ],
)
def test_bicycle_uses_the_cycle_lane(tmp_path, road, table):
    (encounter,) = read_log(table).encounters
    made = generate(
        encounter, road, PipelineConfig(road=RoadConfig(cycle_lane=1.8)), count=3, seed=1
    )
    (n,) = (n for n, vehicle in enumerate(made.encounter.vehicles) if vehicle.type == "bicycle")
    own = made.road.cells_in(made.road.lanes.others)
    row, column, _ = made.road.cells(
        np.concatenate([scenario.position[n] for scenario in made.generated.scenarios])
    )
    assert binary_dilation(own)[row, column].all()  # where it turns, it may leave by a cell
    row, column, _ = made.road.cells(
        np.concatenate([scenario.position[1 - n] for scenario in made.generated.scenarios])
    )
    assert made.road.drivable[row, column].all() and all(map(proven, made.generated.scenarios))
    write_results(tmp_path / "out", [made], title="", quality=(), provenance={})
    for trial in read_trials(
        tmp_path / "out" / "bag", encounter.vehicles[n].id
    ):  # as the ego it is on the road there, too
        loop = ClosedLoop(trial.scenario, trial.ego, trial.road)
        assert loop.road.drivable_at(trial.scenario.position[loop.ego])[
            trial.scenario.is_present[loop.ego]
        ].all()


def test_limit_binds_all_stages():
    (encounter,) = read_log(WORLDS["a bus turns"][0]).encounters
    tight = PipelineConfig(
        planning=PlanningConfig(iterations=100), limits=Limits(bus=Dynamics(max_curvature=0.03))
    )
    with pytest.raises(RefusedError, match=r"limits\.bus\.max_curvature"):
        generate(encounter, "corridor", tight, count=1)
    slow = PipelineConfig(limits=Limits(bus=Dynamics(max_speed=4.0)))
    with pytest.raises(RefusedError, match=r"vehicle u cannot drive .*limits\.bus\.max_speed"):
        generate(encounter, "corridor", slow, count=1)
    gentle = PipelineConfig(limits=Limits(car=Dynamics(max_acceleration=2.3)))
    made = generate(encounter, "corridor", gentle, count=5).generated.scenarios
    assert len(made) == 5 and max(scenario.acceleration[0].max() for scenario in made) <= 2.3
