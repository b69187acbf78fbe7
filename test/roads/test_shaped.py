# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Roads shaped to a template: what it needs is there, what it cannot use is refused, and the fit keeps the manoeuvres."""

from dataclasses import replace

import numpy as np
import pytest
from support.motions import encounter_of_drives as made
from support.source_files import ROOT
from support.textbook_motions import labelled

from scenario_gen.base.errors import RefusedError
from scenario_gen.logs import read_log
from scenario_gen.method.fitting import fit_template
from scenario_gen.numerics.curve import Curve
from scenario_gen.pipeline import generate
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.roads.vector.ground import on_lane
from scenario_gen.roads.ways import draw_ring_route
from scenario_gen.situation import Situation
from scenario_gen.types import RuleKind, Trailer, Vehicle
from scenario_gen.types.fit import Segmentation

T = 140


def motion(xy, speed, start=0.0):
    """(T, 3) poses and (T,) speeds at constant speed on a curve through points."""
    curve = Curve.through(np.asarray(xy, dtype=np.float64))
    return curve.at(start + speed * 0.1 * np.arange(T)), np.full(T, float(speed))


def line(yaw, x=0.0, y=0.0):
    s = np.arange(0.0, 200.0, 1.0)
    return np.column_stack((x + s * np.cos(yaw), y + s * np.sin(yaw)))


def bend(angle, radius, before):
    """Along x for `before` metres, then an arc of `angle` [rad], then straight on."""
    a = np.linspace(0.0, angle, 60)[1:]
    r = np.copysign(radius, angle)
    first = np.column_stack((np.arange(0.0, before, 1.0), np.zeros(int(np.ceil(before)))))
    arc = np.column_stack((before + r * np.sin(a), r * (1.0 - np.cos(a))))
    rest = np.arange(1.0, 120.0)[:, None] * np.array([np.cos(angle), np.sin(angle)])
    return np.vstack((first, arc, arc[-1] + rest))


def ring_of(road):
    """Centre and radius of the circle on which the way from an arm back to it lies, but for its ends."""
    (way,) = (lane.centre for lane in road.lanes.lanes if lane.id == "1.-1>1.1")
    points = way[len(way) // 4 : -len(way) // 4]
    x, y, rest = np.linalg.lstsq(
        np.column_stack((2.0 * points, np.ones(len(points)))),
        np.square(points).sum(axis=1),
        rcond=None,
    )[0]
    return np.array([x, y]), np.sqrt(rest + x * x + y * y)


def fitted(encounter, road_name):
    labels = np.repeat(np.arange(4), T // 4)
    pieces = Segmentation(labels, np.array([35, 70, 105]), np.zeros(T), ("piece",) * 4)
    road = build_road(road_name, encounter)
    return road, fit_template(encounter, pieces, road)


@pytest.mark.parametrize("angle", [-75.0, -50.0, 48.0, 68.0, 95.0])
@pytest.mark.parametrize("road_name", ["t_intersection", "four_way"])
def test_turns_and_their_conflicts_are_kept(angle, road_name):
    encounter = made(
        motion(bend(np.radians(angle), 14.0, 40.0), 8.0), motion(line(np.pi, 95.0, 3.5), 7.0)
    )
    _, fit = fitted(encounter, road_name)
    for vehicle in fit.fitted:
        assert np.degrees(vehicle.turned[1]) == pytest.approx(
            np.degrees(vehicle.turned[0]), abs=15.0
        )
        assert np.ptp(np.diff(vehicle.path[:, 2])) < 0.1
    assert not [loss for loss in fit.losses if loss.kind in ("turn", "conflict", "order")]


def test_crossing_needs_a_four_arm_road():
    encounter = made(motion(line(0.0), 8.0), motion(line(np.radians(70.0), 25.0, -40.0), 8.0))
    road, fit = fitted(encounter, "four_way")
    assert len(road.lanes.arms) == 4 and fit.losses == ()
    with pytest.raises(
        RefusedError,
        match=r"t_intersection has 3 arms, but the recorded vehicles use 4 \(for example vehicles 0, 1\)",
    ):
        build_road("t_intersection", encounter)


def test_unused_arm_is_reported():
    _, fit = fitted(made(motion(line(0.0), 8.0, 20.0), motion(line(0.0), 8.0)), "four_way")
    assert [loss.message for loss in fit.losses] == [
        "2 of the 4 arms of road four_way are unused: no recorded vehicle enters or leaves there"
    ]


def test_lanes_fit_the_widest_vehicle():
    for name in ("straight", "four_way", "curve"):
        _, fit = fitted(
            made(motion(line(0.0), 8.0, 20.0), motion(line(np.pi, 100.0, 4.0), 8.0), width=3.3),
            name,
        )
        assert fit.fitted[0].moved.max() == 0.0


def test_lane_changes_use_the_ramp():
    x = np.arange(0.0, 200.0, 0.5)
    t = np.clip((x - 50.0) / 50.0, 0.0, 1.0)
    joining = np.column_stack((x, -3.5 + 3.5 * t**3 * (10.0 - 15.0 * t + 6.0 * t * t)))
    road, fit = fitted(made(motion(line(0.0), 10.0, 18.0), motion(joining, 10.0)), "merge")
    away = [abs(np.degrees(f.path[0, 2]) % 360.0) for f in fit.fitted]
    assert (
        away[0] == pytest.approx(0.0, abs=0.5) and 8.0 < away[1] < 20.0
    )  # the second comes up the ramp
    assert len(road.entries) == len(road.exits) + 1
    _, fit = fitted(made(motion(line(0.0), 10.0, 28.0), motion(joining, 10.0)), "curve")
    assert fit.losses == ()  # who ends beyond another one's path in a bend is in its lane
    _, fit = fitted(made(motion(line(0.0), 8.0, 20.0), motion(line(0.0), 8.0)), "merge")
    assert [loss.kind for loss in fit.losses] == ["arm"]


def test_roundabout_is_sized_to_the_speed():
    for speed in (8.0, 9.5):
        road, fit = fitted(
            made(motion(line(0.0), speed, 18.0), motion(line(0.0), speed)), "roundabout"
        )
        centre, radius = ring_of(road)
        assert radius == pytest.approx(max(speed**2 / 3.0, 13.0), abs=0.5)
        for vehicle in fit.fitted:
            assert np.hypot(*(vehicle.path[:, :2] - centre).T).min() > radius - 0.5
            assert abs(vehicle.turned[1]) < np.radians(25.0)


@pytest.mark.parametrize("oncoming", [False, True])
def test_arms_hold_fast_vehicles(oncoming):
    other = motion(line(np.pi, 250.0, 4.0) if oncoming else line(0.0), 18.0)
    road, fit = fitted(made(motion(line(0.0), 18.0, 20.0), other), "roundabout")
    centre, radius = ring_of(road)
    assert radius == pytest.approx(45.0, abs=0.5)
    assert [loss.kind for loss in fit.losses] == ["arm"]
    for vehicle in fit.fitted:
        assert np.hypot(*(vehicle.path[:, :2] - centre).T).min() > radius


@pytest.mark.parametrize(("radius", "circles"), [(10.0, False), (16.0, True)])
def test_recorded_roundabout_keeps_its_size(radius, circles):
    poses, speeds = [], []
    for come, leave in ((np.pi, 0.0), (-np.pi / 2.0, np.pi / 2.0)):
        out = [np.array([np.cos(yaw), np.sin(yaw)]) for yaw in (come, leave)]
        beside = [1.75 * np.array([-y, x]) for x, y in out]
        start = np.array([*(90.0 * out[0] + beside[0]), come + np.pi])
        goal = np.array([*(90.0 * out[1] - beside[1]), leave])
        way = draw_ring_route(start, goal, np.zeros(2), radius)
        away = np.maximum(np.hypot(*way.points[:, :2].T) - radius - 3.0, 0.0)
        speed = np.minimum(np.sqrt(36.0 + 4.0 * away), 14.0)
        time = np.concatenate(
            ([0.0], np.cumsum(2.0 * np.diff(way.station) / (speed[1:] + speed[:-1])))
        )
        station = np.interp(0.1 * np.arange(T), time, way.station)
        poses.append(way.at(station))
        speeds.append(np.interp(station, way.station, speed))
    if circles:  # by 287°, neither coming nor going
        angle = np.linspace(1.0, 6.0, T)
        poses[1] = np.column_stack(
            (radius * np.cos(angle), radius * np.sin(angle), angle + np.pi / 2.0)
        )
        speeds[1] = np.full(T, 50.0 * radius / T)
    road, fit = fitted(made(*zip(poses, speeds, strict=True)), "roundabout")
    assert ring_of(road)[1] == pytest.approx(radius, abs=0.3)
    assert max(np.abs(vehicle.scale - 1.0) for vehicle in fit.fitted) == 0.0
    assert {loss.kind for loss in fit.losses} <= {"arm"}
    if not circles:  # it is wide enough for a trailer, too
        encounter = made(*zip(poses, speeds, strict=True))
        truck = Vehicle("0", 7.0, 2.5, "truck", Trailer("t", 10.0, 2.5, 3.2, 4.5))
        towing = replace(encounter, vehicles=(truck, encounter.vehicles[1]))
        assert len(generate(towing, "roundabout", count=1, seed=1)) == 1


def test_bend_is_no_second_roundabout_lane():
    """Two arms of the ring are 51° from a right angle, and one car follows the other."""
    (encounter,) = read_log(ROOT / "scenario_gen/resources/recorded/v2x_following.csv")
    assert len(generate(encounter, "roundabout", count=1, seed=7)) == 1


def test_roads_without_template_are_drawn():
    assert ring_of(build_road("roundabout"))[1] == pytest.approx(13.0, abs=0.1)
    curve = build_road("curve")
    assert abs(np.degrees(curve.exits[0, 2] - curve.entries[0, 2])) == pytest.approx(20.0, abs=1.0)
    merge = build_road("merge")
    assert len(merge.entries) == 3 and len(merge.exits) == 2


@pytest.mark.parametrize(
    "priority, kind",
    [("auto", RuleKind.GIVE_WAY), ("all_way_stop", RuleKind.STOP), ("none", None)],
)
def test_yielding_arms_have_give_way_lines(priority, kind):
    encounter = labelled("crossing, stops", 1).encounter
    (edge,) = Situation.of(encounter).reactions.edges
    road = build_road("four_way", encounter, RoadConfig(priority=priority, lanes=2))
    assert {rule.kind for rule in road.lanes.rules} == ({kind} if kind else set())
    for rule in road.lanes.rules:
        lanes = [road.lanes.lanes[k] for k in rule.lanes]
        assert all(np.hypot(*(lane.centre[-1] - rule.line.mean(axis=0))) < 2.0 for lane in lanes)
        assert np.hypot(*np.diff(rule.line, axis=0)[0]) == pytest.approx(7.0, abs=0.1)
    if priority == "auto":
        (rule,) = road.lanes.rules
        scenarios = generate(encounter, road, count=3, seed=1).generated.scenarios
        arm = road.lanes.lanes[rule.lanes[0]]
        for scenario in scenarios:
            poses = np.column_stack((scenario.position[edge.who], scenario.heading[edge.who]))
            assert on_lane(arm, poses) or on_lane(road.lanes.lanes[rule.lanes[1]], poses)
        assert len(scenarios) == 3


def test_roundabout_arms_and_ramps_give_way():
    ring, merge = (build_road(name).lanes for name in ("roundabout", "merge"))
    assert [rule.kind for rule in ring.rules] == [RuleKind.GIVE_WAY] * 4
    assert {ring.lanes[k].id for k in ring.rules[0].over} == {
        f"{a}.-1>{b}.1" for a in (2, 3, 4) for b in (1, 2, 3, 4)
    }
    ((ramp,),) = ([merge.lanes[k].id for k in rule.lanes] for rule in merge.rules)
    assert ramp == "3.-1"
