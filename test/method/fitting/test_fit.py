# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Templates on roads: ends, lanes, who crosses whom, repair, refusals."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.lengths import LOGS
from support.motions import encounter_of_drives as encounter_of

from scenario_gen.base.errors import RefusedError
from scenario_gen.logs import read_log
from scenario_gen.method.fitting import fit_template, FittingConfig
from scenario_gen.method.fitting.placement import place_given
from scenario_gen.method.fitting.state_check import refuse_misfits
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.roads.clearance import footprint_fits
from scenario_gen.situation import find_conflicts, Situation
from scenario_gen.types import Motion, Request, Vehicle
from scenario_gen.types.fit import Segmentation
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates

pytestmark = pytest.mark.spread
ROADS = ("straight", "t_intersection", "four_way", "corridor")


def segmented(encounter, *changepoints):
    t = encounter.speed.shape[1]
    labels = np.zeros(t, dtype=np.int64)
    for c in changepoints:
        labels[c:] += 1
    return Segmentation(
        labels,
        np.array(changepoints, dtype=np.int64),
        np.zeros(t),
        ("piece",) * (len(changepoints) + 1),
    )


def every(encounter, step=25):
    return segmented(encounter, *range(step, encounter.speed.shape[1] - max(step // 2, 1), step))


def driven(curve, speed, dt=0.1):
    """(T, 3) poses and (T,) speeds of a vehicle on a curve with the given speeds."""
    s = np.concatenate(([0.0], np.cumsum((speed[1:] + speed[:-1]) / 2.0 * dt)))
    return curve.at(s), speed


def turn(x, y, yaw, before, angle, radius, after=60.0):
    """Straight, an arc of `angle` [rad] (left positive), straight."""
    n = 60
    a = np.linspace(0.0, angle, n)
    r = np.copysign(radius, angle)
    local = np.column_stack((before + r * np.sin(a), r * (1.0 - np.cos(a)), a))
    end = local[-1] + [after * np.cos(angle), after * np.sin(angle), 0.0]
    local = np.vstack(([0.0, 0.0, 0.0], local, end))
    cos, sin = np.cos(yaw), np.sin(yaw)
    return Curve(
        np.column_stack(
            (
                x + local[:, 0] * cos - local[:, 1] * sin,
                y + local[:, 0] * sin + local[:, 1] * cos,
                yaw + local[:, 2],
            )
        )
    )


def straight(x, y, yaw):
    return Curve(np.array([[x, y, yaw], [x + 200.0 * np.cos(yaw), y + 200.0 * np.sin(yaw), yaw]]))


def grid(drivable, origin=(0.0, 0.0), name="grid"):
    """A road without lanes, in cells of 0.2 m."""
    return Road(name, drivable, 0.2, np.array(origin), np.zeros((0, 3)), np.zeros((0, 3)))


def relative(pose, other):
    d = other[:2] - pose[:2]
    return np.array(
        [
            d[0] * np.cos(pose[2]) + d[1] * np.sin(pose[2]),
            d[1] * np.cos(pose[2]) - d[0] * np.sin(pose[2]),
        ]
    )


@pytest.fixture(scope="module", params=LOGS)
def encounter(request):
    return read_log(request.param).encounters[0]


@pytest.fixture
def road_names(request, encounter):
    """The corridor, and a drawn road on which nothing of the recording is lost."""
    swerves = "lane_change" in str(request.node.callspec.params["encounter"])
    return "curve" if swerves else "four_way", "corridor"


def test_recorded_encounters_fit_two_roads(encounter, road_names):
    fitted = 0
    for road_name in ROADS:
        try:
            road = build_road(road_name, encounter)
            fit = fit_template(encounter, every(encounter), road)
        except RefusedError as error:
            assert "vehicle" in str(error)
            assert road_name == "straight" or "lost_overtaking" in str(error), (road_name, error)
            continue
        fitted += 1
        for vehicle, f in zip(fit.vehicles, fit.fitted, strict=True):
            assert footprint_fits(road, f.anchors, vehicle.length, vehicle.width).all()
            assert 0.8 <= f.scale <= 1.25
            assert f.moved.max() <= 3.0
        assert turned_otherwise(encounter, fit) <= {
            loss.vehicles[0] for loss in fit.losses if loss.kind in ("turn", "bend")
        }
    assert fitted >= (1 if "curve" in road_names else 2)


def turned_otherwise(encounter, fit):
    """Ids of the vehicles whose fitted path turns more than 25° differently than their recorded headings do."""
    found = set()
    for i, (vehicle, f) in enumerate(zip(fit.vehicles, fit.fitted, strict=True)):
        first, last = encounter.present[i]
        recorded = encounter.heading[i, last] - encounter.heading[i, first]
        driven = f.path[-1, 2] - f.path[0, 2]
        if not f.stands.all() and abs(np.degrees(recorded - driven)) > 25.0:
            found.add(vehicle.id)
    return found


def test_straight_drive_has_an_arm_ahead(data):
    """One vehicle's record begins, or ends, in the middle of the junction."""
    for pattern in ("encounter_a_cross*", "encounter_b_left*"):
        (path,) = data.glob(f"trajectories/ngsim_commonroad/{pattern}.csv")
        encounter = read_log(path).encounters[0]
        for road_name in ("t_intersection", "four_way"):
            fit = fit_template(encounter, every(encounter), build_road(road_name, encounter))
            assert not turned_otherwise(encounter, fit), road_name
            assert not any(loss.kind in ("turn", "conflict") for loss in fit.losses)


def test_oncoming_vehicles_keep_lanes_apart():
    speed = np.full(80, 9.0)
    encounter = encounter_of(
        driven(straight(0.0, 0.0, 0.3), speed), driven(straight(110.0, 45.0, 0.3 - np.pi), speed)
    )
    assert relative(np.array([0.0, 0.0, 0.3]), np.array([110.0, 45.0]))[1] == pytest.approx(
        10.5, abs=0.1
    )
    for lanes, apart in (
        (0, 10.5),
        (1, 3.5),
    ):  # as many as the template needs; one, which does too
        road = build_road("straight", encounter, RoadConfig(lanes=lanes))
        fit = fit_template(encounter, every(encounter), road)
        one, two = (f.anchors[0] for f in fit.fitted)
        assert abs(relative(one, two)[1]) == pytest.approx(apart, abs=0.1)


def test_ends_do_not_depend_on_changepoints(encounter, road_names):
    for road_name in road_names:
        road = build_road(road_name, encounter)
        with_, without = (
            fit_template(encounter, s, road) for s in (every(encounter, 10), segmented(encounter))
        )
        assert np.array_equal(with_.requested.start, without.requested.start)
        assert np.array_equal(with_.requested.end, without.requested.end)
        assert [f.manoeuvre for f in with_.fitted] == [f.manoeuvre for f in without.fitted]


def test_template_is_replayed_in_its_order(encounter, road_names):
    for road_name in road_names:
        road = build_road(road_name, encounter)
        fit = fit_template(
            encounter, every(encounter, 1), road
        )  # every sample an anchor: the dense placement
        poses = np.stack([f.anchors for f in fit.fitted])
        heading = np.unwrap(poses[..., 2], axis=1)
        found = find_conflicts(
            Motion(
                fit.vehicles,
                encounter.time[fit.anchor_index],
                poses[..., :2],
                heading,
                np.zeros_like(heading),
            )
        )
        order = {frozenset((c.first, c.second)): c.first for c in found}
        template = find_conflicts(encounter)
        for conflict in template:
            pair = frozenset((conflict.first, conflict.second))
            assert order.get(pair, conflict.first) == conflict.first, road_name
        step = np.hypot(*np.moveaxis(np.diff(poses[..., :2], axis=1), 2, 0)) / np.diff(
            encounter.time[fit.anchor_index]
        )
        recorded_speed = encounter.speed[:, fit.anchor_index]
        middle = (recorded_speed[:, 1:] + recorded_speed[:, :-1]) / 2.0
        scale = np.array([[vehicle.scale] for vehicle in fit.fitted])
        assert np.median(np.abs(step - scale * middle)) < 0.1, road_name


def crossing_pair():
    """Vehicle 1 comes from the right of vehicle 0 and waits for it."""
    t = 120
    waiting = np.concatenate(
        (np.full(30, 6.0), np.linspace(6.0, 0.0, 30), np.zeros(30), np.linspace(0.0, 7.0, 30))
    )
    return encounter_of(
        driven(straight(-50.0, 0.0, 0.0), np.full(t, 9.0)),
        driven(straight(0.0, -35.0, np.pi / 2.0), waiting),
    )


@pytest.mark.parametrize("road_name", ["four_way"])
@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_side_and_arrival_times_are_kept(road_name, yaw):
    encounter = crossing_pair()
    rotation = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    moved = encounter.position @ rotation.T + 500.0
    turned = replace(encounter, position=moved, heading=encounter.heading + yaw)
    fit = fit_template(turned, every(turned, 5), build_road(road_name, turned))
    first, second = (f.anchors for f in fit.fitted)
    assert [f.manoeuvre for f in fit.fitted] == ["straight", "straight"]
    for k in (0, 5, 15):
        i = fit.anchor_index[k]
        template = relative(
            [*encounter.position[0, i], encounter.heading[0, i]], encounter.position[1, i]
        )
        assert relative(first[k], second[k]) == pytest.approx(template, abs=0.3)
    assert fit.fitted[1].stands[13:17].all()  # it waits from 6 s to 9 s
    assert not fit.fitted[0].stands.any()
    assert fit.requested.start[:, 3].tolist() == pytest.approx([9.0, 6.0])


def test_crossing_needs_lanes_that_cross():
    encounter = crossing_pair()
    with pytest.raises(RefusedError, match="the paths of vehicles 0 and 1 cross, and no lanes do"):
        fit_template(encounter, every(encounter), build_road("merge"))


def test_separated_vehicles_stay_at_home():
    """The corridor is drawn around the paths as they were separated, with little room."""
    speed = np.full(101, 8.0)
    encounter = encounter_of(
        driven(straight(-40.0, 0.0, 0.0), speed), driven(straight(0.0, -42.0, np.pi / 2.0), speed)
    )
    road = build_road("corridor", encounter, RoadConfig(corridor_margin=0.1))
    fit = fit_template(encounter, every(encounter), road, FittingConfig(allow="lost_conflict"))
    assert "in the recording's own frame" in str(fit.notes[0])


def test_turns_take_arms_on_their_side():
    for angle, name in ((np.pi / 2.0, "left"), (-np.pi / 2.0, "right")):
        speeds = np.full(110, 7.0)
        encounter = encounter_of(
            driven(turn(-40.0, -1.75, 0.0, 35.0, angle, 9.0), speeds),
            driven(straight(45.0, 1.75, np.pi), np.full(110, 3.0)),
        )
        fit = fit_template(encounter, every(encounter), build_road("four_way", encounter))
        assert [f.manoeuvre for f in fit.fitted] == [name, "straight"]
        change = np.unwrap(fit.fitted[0].anchors[:, 2])
        assert change[-1] - change[0] == pytest.approx(angle, abs=0.02)
        with pytest.raises(RefusedError, match=f"vehicle 0 turns {name}"):
            fit_template(encounter, every(encounter), build_road("straight", encounter))


@pytest.mark.parametrize("road_name", ["curve", "t_intersection", "four_way"])
def test_platoon_keeps_its_bend_and_gaps(road_name):
    bend = turn(0.0, 0.0, 0.0, 20.0, 1.4, 120.0, 400.0)
    ahead = Curve(bend.at(np.arange(18.0, 400.0, 0.5)))
    encounter = encounter_of(driven(ahead, np.full(150, 12.0)), driven(bend, np.full(150, 12.0)))
    fit = fit_template(encounter, every(encounter), build_road(road_name, encounter))
    lead, follow = (f.anchors for f in fit.fitted)
    assert np.abs(np.hypot(*(lead - follow)[:, :2].T) - 18.0).max() < 0.25
    for f in fit.fitted:
        assert f.turned[1] == pytest.approx(f.turned[0], abs=np.radians(5.0))
    assert not [loss for loss in fit.losses if loss.kind != "arm"]
    losses = fit_template(encounter, every(encounter), build_road("straight", encounter)).losses
    assert {loss.kind for loss in losses} == {"bend"}
    assert "vehicle 0 turns left by 81° in the recording, goes straight on" in losses[0].message


def test_scale_out_of_range_is_refused():
    encounter = encounter_of(
        driven(straight(0.0, 0.0, 0.0), np.full(150, 12.0)),
        driven(straight(-20.0, 0.0, 0.0), np.full(150, 12.0)),
    )
    road = build_road("straight", encounter, RoadConfig(arm_length=60.0))
    with pytest.raises(RefusedError, match=r"scale 0\.5\d; at least 0\.8 is accepted"):
        fit_template(encounter, every(encounter), road)
    fit = fit_template(encounter, every(encounter), road, FittingConfig(scale_low=0.4))
    assert fit.fitted[0].scale == pytest.approx(0.55, abs=0.04)
    assert fit.requested.start[0, 3] == pytest.approx(12.0 * fit.fitted[0].scale)


def requested(encounter, starts, goals):
    """Ask for start and goal states of all vehicles."""
    texts = [
        ";".join(
            f"{vehicle.id}:" + " ".join(map(repr, row))
            for vehicle, row in zip(encounter.vehicles, rows.tolist(), strict=True)
        )
        for rows in (starts, goals)
    ]
    return Request(starts=texts[0], goals=texts[1])


def test_requested_ends_are_met_exactly():
    encounter = crossing_pair()
    road = grid(np.ones((1000, 1000), dtype=bool))
    chord = np.hypot(*(encounter.position[:, -1] - encounter.position[:, 0]).T)
    starts = np.array([[30.0, 100.0, 0.3, 9.0], [100.0, 60.0, 1.8, 6.0]])
    goals = starts.copy()
    for i in (0, 1):
        goals[i, :2] += 1.1 * chord[i] * np.array([np.cos(starts[i, 2]), np.sin(starts[i, 2])])
    goals[:, 3] = (9.0, 7.0)
    allowed = FittingConfig(allow="lost_conflict")
    request = requested(encounter, starts, goals)
    fit = fit_template(encounter, every(encounter), road, allowed, request=request)
    assert np.abs(fit.requested.start - starts).max() < 1e-8
    assert np.abs(fit.requested.end - goals).max() < 1e-8
    assert [f.scale for f in fit.fitted] == pytest.approx([1.1, 1.1], abs=0.01)
    for i in (0, 1):  # stations along the chord are the template's, times s
        along = np.hypot(*(fit.fitted[i].anchors[:, :2] - starts[i, :2]).T)
        own = np.hypot(*(encounter.position[i, fit.anchor_index] - encounter.position[i, 0]).T)
        assert along == pytest.approx(1.1 * own, abs=0.15)
    far = goals.copy()
    far[:, :2] = starts[:, :2] + 2.0 / 1.1 * (goals[:, :2] - starts[:, :2])
    with pytest.raises(RefusedError, match=r"scale 2\.0"):
        fit_template(
            encounter,
            every(encounter),
            grid(np.ones((2000, 2000), dtype=bool)),
            request=requested(encounter, starts, far),
        )


def test_returning_vehicle_turns_with_its_start():
    speed = np.full(100, 6.0)
    circle = turn(0.0, 0.0, 0.0, 0.0, 2.0 * np.pi, 59.4 / (2.0 * np.pi))
    encounter = encounter_of(driven(circle, speed), driven(straight(40.0, 30.0, 0.0), speed))
    starts = np.array([[100.0, 100.0, np.pi / 2.0, 6.0], [30.0, 30.0, 0.3, 6.0]])
    goals = starts.copy()
    goals[1, :2] += 59.4 * np.array([np.cos(0.3), np.sin(0.3)])
    goals[0, 2] += 2.0 * np.pi
    request = requested(encounter, starts, goals)
    road = grid(np.ones((1000, 1000), dtype=bool))
    fit = fit_template(encounter, every(encounter), road, request=request)
    assert [f.scale for f in fit.fitted] == pytest.approx([1.0, 1.0], abs=0.01)
    half_way = fit.fitted[0].path[len(fit.fitted[0].path) // 2]
    assert half_way[:2] == pytest.approx([100.0 - 2.0 * 59.4 / (2.0 * np.pi), 100.0], abs=0.5)


@pytest.mark.parametrize(("chord", "method"), [(1.9, "turned as its start"), (2.1, "similarity")])
def test_short_chord_has_no_direction(chord, method):
    """Of a drive of 59.4 m on nearly a whole circle, whose end is requested where it was recorded."""
    speed, radius = np.full(100, 6.0), (59.4 + chord) / (2.0 * np.pi)
    circle = turn(0.0, 0.0, 0.0, 0.0, 59.4 / radius, radius)
    encounter = encounter_of(driven(circle, speed), driven(straight(40.0, 30.0, 0.0), speed))
    ends = np.concatenate((encounter.position, encounter.heading[..., None]), axis=-1) + 50.0
    ends[..., 2] -= 50.0
    states = np.concatenate((ends, encounter.speed[..., None]), axis=-1)
    road = grid(np.ones((1000, 1000), dtype=bool))
    starts, goals = states[:, 0].copy(), states[:, -1].copy()
    placement, _ = place_given(Situation.of(encounter), road, FittingConfig(), starts, goals)
    assert placement.notes[0].values["method"].startswith(method)


def test_waiting_vehicle_cannot_be_sent_away():
    encounter = encounter_of(
        driven(straight(-30.0, 0.0, 0.0), np.full(100, 6.0)),
        driven(straight(0.0, -9.0, np.pi / 2.0), np.zeros(100)),
    )
    fit = fit_template(encounter, every(encounter), build_road("four_way", encounter))
    assert fit.fitted[1].manoeuvre == "wait"
    assert fit.fitted[1].stands.all()
    assert (fit.fitted[1].anchors == fit.fitted[1].anchors[0]).all()
    moving, waiting = (f.anchors[0] for f in fit.fitted)
    assert relative(moving, waiting) == pytest.approx([30.0, -9.0], abs=2.5)
    starts = np.array([[20.0, 60.0, 0.0], [60.0, 40.0, 1.5]])
    away = requested(encounter, starts, starts + np.array([59.0, 0.0, 0.0]))
    with pytest.raises(RefusedError, match="waits throughout"):
        fit_template(
            encounter, every(encounter), grid(np.ones((700, 700), dtype=bool)), request=away
        )


def test_anchors_move_near_not_far():
    encounter = encounter_of(
        driven(straight(10.0, 20.0, 0.0), np.full(100, 5.0)),
        driven(straight(10.0, 40.0, 0.0), np.full(100, 5.0)),
    )
    drivable = np.zeros((300, 400), dtype=bool)
    drivable[170:230, :] = True
    drivable[96:150, :] = (
        True  # the lower road begins at y = 19.2: vehicle 0 needs 19.05 or more, 0.15 m up
    )
    road = grid(drivable)
    fit = fit_template(encounter, every(encounter), road, FittingConfig(placement="identity"))
    assert fit.fitted[0].moved == pytest.approx(np.full(len(fit.anchor_index), 0.15), abs=0.02)
    assert not fit.fitted[1].moved.any()
    assert "vehicle 0: start moved by 0.15 m to where it has room" in map(str, fit.notes)
    drivable[96:120] = False
    far = grid(drivable)
    with pytest.raises(
        RefusedError,
        match=r"vehicle 0 is 5\.\d m from any pose with room at sample 0 .*fitting.max_move accepts 3 m; increase fitting.max_move",
    ):
        fit_template(encounter, every(encounter), far, FittingConfig(placement="identity"))


def test_search_finds_road_of_same_shape():
    encounter = encounter_of(
        driven(turn(0.0, 0.0, 0.0, 30.0, np.pi / 2.0, 12.0), np.full(100, 7.0)),
        driven(straight(60.0, 3.5, np.pi), np.full(100, 2.0)),
    )
    home = build_road("corridor", encounter)
    turned = grid(np.rot90(home.drivable), (300.0, -80.0))
    fit = fit_template(encounter, every(encounter), turned)
    one, two = (f.anchors for f in fit.fitted)
    assert all(f.scale == 1.0 for f in fit.fitted)
    assert relative(one[0], two[0]) == pytest.approx([60.0, 3.5], abs=0.1)
    assert one[0, 2] == pytest.approx(
        -np.pi / 2.0, abs=0.1
    )  # rows grow with y: rot90 turns clockwise
    narrow = grid(home.drivable[:, :60], name="narrow")
    with pytest.raises(RefusedError, match="no placement on road narrow has room"):
        fit_template(encounter, every(encounter), narrow)


@pytest.mark.parametrize("end", ["start", "goal"])
def test_requested_states_suit_each_other(end):
    """The second vehicle stands in the primitive at this end; both are 4.8 m long."""
    stands = np.array([True, False] if end == "start" else [False, True])
    fitted = (SimpleNamespace(stands=np.zeros(2, dtype=bool)), SimpleNamespace(stands=stands))
    free, row = np.full((2, 4), np.nan), int(end == "goal")

    def refused(vehicle, speed, apart=9.0):
        states = np.zeros((2, 4))
        states[1, 0] = apart
        asked = [free.copy(), free.copy()]
        asked[row][vehicle] = [states[vehicle, 0], 0.0, 0.0, speed]
        ends = [states, states + np.array([[0.0], [1.0]]) * [9.0, 0.0, 0.0, 0.0]][:: 1 - 2 * row]
        fit = SimpleNamespace(
            vehicles=(Vehicle("a"), Vehicle("b")), fitted=fitted, requested=BoundaryStates(*ends)
        )
        try:
            refuse_misfits(fit, *asked)
        except RefusedError as error:
            return str(error)
        return ""

    assert not refused(0, 8.0) and not refused(1, 0.05) and not refused(0, 8.0, 4.81)
    assert "vehicle b stands there" in refused(1, 0.06)
    assert f"requested {end} vehicles a and b overlap by 0.10 m" in refused(0, 8.0, 4.7)
