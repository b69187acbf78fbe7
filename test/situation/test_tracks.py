# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Cleaned tracks, path coordinates, separation."""

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics.curve import crossings, Curve
from scenario_gen.situation import abreast_in_lane, Equation, path_crossing, solve_placement
from scenario_gen.situation.frenet import _extended, main_line, to_frenet
from scenario_gen.situation.separation import separate, separate_recorded, smallest_gaps
from scenario_gen.situation.tracks import clean_tracks, is_same_turn, manoeuvre_of
from scenario_gen.types import Encounter, Vehicle


def encounter_of(*motions, dt=0.1):
    """An encounter of (T, 3) poses; speeds by differences."""
    poses = np.stack(motions)
    step = np.hypot(*np.moveaxis(np.diff(poses[:, :, :2], axis=1), 2, 0)) / dt
    speed = np.concatenate((step, step[:, -1:]), axis=1)
    vehicles = tuple(Vehicle(str(i)) for i in range(len(poses)))
    return Encounter.sampled(vehicles, dt, poses[..., :2], poses[..., 2], speed, "made")


def line(x0, y0, yaw, speed, t=100):
    s = np.arange(t) * 0.1 * speed
    return np.column_stack((x0 + s * np.cos(yaw), y0 + s * np.sin(yaw), np.full(t, yaw)))


def arc(x0, y0, yaw, radius, speed, t=100):
    """Poses on a circle that turns left (radius > 0) or right."""
    a = yaw + np.arange(t) * 0.1 * speed / radius
    return np.column_stack(
        (x0 + radius * (np.sin(a) - np.sin(yaw)), y0 - radius * (np.cos(a) - np.cos(yaw)), a)
    )


@settings(max_examples=50)
@given(
    st.floats(6.0, 200.0),
    st.sampled_from([-1.0, 1.0]),
    st.floats(-3.0, 3.0),
    st.floats(2.0, 60.0),
    st.floats(-4.0, 4.0),
)
def test_projection_undoes_placing_beside_a_curve(radius, sign, yaw, length, offset):
    s = np.linspace(0.0, min(length, 4.0 * radius), 400)
    a = yaw + sign * s / radius
    xy = np.column_stack(
        (sign * radius * (np.sin(a) - np.sin(yaw)), -sign * radius * (np.cos(a) - np.cos(yaw)))
    )
    curve = Curve.through(xy)
    at = (
        np.linspace(-5.0, curve.length + 5.0, 37)
        if radius > 40.0
        else np.linspace(0.1, curve.length - 0.1, 37)
    )
    poses = curve.at_offset(at, np.full(37, offset))
    station, found = curve.project(poses[:, :2])
    assert np.abs(station - at).max() < 0.06
    assert np.abs(found - offset).max() < 0.02


def test_crossings_are_found_at_their_stations():
    one = Curve(np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]]))
    two = Curve(np.array([[4.0, -3.0, np.pi / 2.0], [4.0, 3.0, np.pi / 2.0]]))
    assert crossings(one, two).tolist() == [[pytest.approx(4.0), pytest.approx(3.0)]]
    assert len(crossings(one, Curve(one.points + np.array([0.0, 1.0, 0.0])))) == 0


def test_noise_is_smoothed():
    rng = np.random.Generator(np.random.PCG64(3))
    clean = arc(0.0, 0.0, 0.3, 30.0, 8.0)
    noisy = clean.copy()
    noisy[:, :2] += rng.normal(0.0, 0.2, (100, 2))
    still = np.tile([20.0, -9.0, 1.0], (100, 1))
    encounter = encounter_of(clean, still)
    moving, standing = clean_tracks(replace(encounter, position=np.stack((noisy, still))[..., :2]))
    error = np.hypot(*(moving.poses[:, :2] - clean[:, :2]).T)
    assert error.max() < 0.6 and error[5:-5].max() < 0.25
    assert np.abs(moving.poses[5:-5, 2] - clean[5:-5, 2]).max() < 0.12
    assert (np.diff(moving.progress) > 0.0).all()
    assert standing.still and standing.travelled == 0.0
    assert standing.poses[0].tolist() == pytest.approx([20.0, -9.0, 1.0])


def test_junction_turn_differs_from_bend():
    turner, bender = clean_tracks(
        encounter_of(arc(0.0, 0.0, 0.0, 10.0, 2.0), arc(0.0, 50.0, 0.0, -80.0, 8.0))
    )
    assert turner.turns
    assert turner.turning(30.0) > 0.0
    assert not turner.makes_u_turn
    assert not bender.turns
    (round_, _) = clean_tracks(
        encounter_of(arc(0.0, 0.0, 0.0, 6.0, 2.0), line(0.0, 40.0, 0.0, 5.0))
    )
    assert round_.makes_u_turn


def test_gaps_survive_straightening():
    lead, follow = arc(0.0, 0.0, 0.0, 90.0, 12.0, 400), arc(0.0, 0.0, 0.0, 90.0, 12.0, 400)
    encounter = encounter_of(lead[50:350], follow[:300])  # 5 s, 60 m behind
    frenet = to_frenet(clean_tracks(encounter))
    assert np.abs(frenet.station[0] - frenet.station[1] - 60.0).max() < 0.1
    assert frenet.direction.tolist() == [1, 1] and frenet.lanes == 1
    low, high = frenet.span(clean_tracks(encounter))
    assert low == pytest.approx(frenet.station[1, 0] - 2.4)  # half a car
    assert high == pytest.approx(frenet.station[0, -1] + 2.4)
    station = main_line(frenet, clean_tracks(encounter)).station
    assert station[[0, -1]] == pytest.approx([low, high])
    assert np.ptp(np.diff(station)) < 1e-6


def test_lanes_are_told_from_offsets():
    t = 200
    changing = line(0.0, 3.6, 0.0, 10.0, t)
    x = np.clip((np.arange(t) - 60) / 60.0, 0.0, 1.0)
    changing[:, 1] -= 3.6 * x**2 * (3.0 - 2.0 * x)
    encounter = encounter_of(
        changing, line(-30.0, 0.0, 0.0, 10.0, t), line(200.0, 7.3, np.pi, 9.0, t)
    )
    frenet = to_frenet(clean_tracks(encounter))
    assert frenet.direction.tolist() in ([1, 1, -1], [-1, -1, 1])
    assert frenet.lane.tolist() == [[0, 1], [1, 1], [0, 0]]
    assert frenet.change[0, 40] < 0.05 and frenet.change[0, -40] > 0.95
    assert not frenet.change[1:].any()


@pytest.mark.parametrize(
    ("apart", "between"),
    [(3.5, (0, 0)), (7.0, (1, 0)), (12.0, (1, 1)), (14.0, (2, 1)), (25.0, (2, 2)), (-4.0, (0, 0))],
)
def test_distant_oncoming_have_lanes_between(apart, between):
    encounter = encounter_of(line(0.0, 0.0, 0.0, 10.0), line(120.0, apart, np.pi, 9.0))
    frenet = to_frenet(clean_tracks(encounter))
    assert frenet.between == between
    spread = frenet.spread()
    ahead, against = (spread.lane[frenet.direction == sign, 0].item() for sign in (1, -1))
    assert (ahead, against) == between
    assert spread.lanes == max(between) + 1


def test_distant_continuation_makes_no_jump():
    encounter = encounter_of(line(0.0, 0.0, 0.0, 7.0), line(125.0, 18.0, np.pi, 6.0))
    frenet = to_frenet(clean_tracks(encounter))
    assert np.ptp(frenet.line.points[:, 1]) < 1.0
    assert abs(abs(frenet.offset[1] - frenet.offset[0]).mean() - 18.0) < 0.5


def test_turns_are_not_along_a_road():
    with pytest.raises(RefusedError, match="vehicle 0 turns left"):
        to_frenet(
            clean_tracks(encounter_of(arc(0.0, 0.0, 0.0, 10.0, 2.0), line(0.0, 30.0, 0.0, 5.0)))
        )
    with pytest.raises(RefusedError, match="across"):
        to_frenet(
            clean_tracks(
                encounter_of(line(0.0, 0.0, 0.0, 8.0), line(30.0, -30.0, np.pi / 2.0, 5.0))
            )
        )


def test_overlapping_vehicles_are_pulled_apart():
    tracks = clean_tracks(encounter_of(line(0.0, 0.0, 0.0, 8.0), line(0.5, 1.5, 0.0, 8.0)))
    assert smallest_gaps(tracks)[0, 1] == pytest.approx(-0.4, abs=0.01)
    separation = separate(tracks, 0.5, 3.0)
    assert smallest_gaps(separation.tracks)[0, 1] > 0.499
    assert separation.moved.tolist() == pytest.approx([0.45, 0.45], abs=0.01)
    assert len(separation.notes) == 2 and "0.45 m" in str(separation.notes[0])
    with pytest.raises(RefusedError, match="vehicles 1 and 0"):
        separate(tracks, 0.5, 0.3)


def test_smoothing_of_a_metre_is_reported():
    tracks = clean_tracks(encounter_of(line(0.0, 0.0, 0.0, 8.0), line(0.0, 9.0, 0.0, 8.0)))
    smoothed = [
        replace(track, deviation=metres)
        for track, metres in zip(tracks, (1.01, 0.99), strict=True)
    ]
    (note,) = separate_recorded(smoothed).notes
    assert dict(note.values) == {"vehicle": "0", "distance": 1.01}


def test_tight_bend_is_eased():
    t = 60
    tight = np.vstack((line(0.0, 0.0, 0.0, 5.0, t), arc(29.5, 0.0, 0.0, 3.5, 2.0, 56)))
    last = tight[-1]
    tight = np.vstack((tight, line(last[0], last[1], last[2], 5.0, t)))
    (track, _) = clean_tracks(encounter_of(tight, np.tile([0.0, 30.0, 0.0], (len(tight), 1))))
    curvature = np.abs(np.diff(track.curve.points[:, 2])) / np.diff(track.curve.station)
    assert curvature.max() <= 0.2
    turned = track.curve.points[-1, 2] - track.curve.points[0, 2]
    assert turned == pytest.approx(tight[-1, 2] - tight[0, 2], abs=0.05)
    assert track.deviation < 3.0


@pytest.mark.parametrize("beyond", [0.9, 6.0])
@pytest.mark.parametrize("aside", [0.0, 1.5])
def test_line_is_extended_beyond_its_ends(beyond, aside):
    own = Curve(np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]]))
    x = np.linspace(-beyond, 50.0 + beyond, 200)
    found = _extended(own, Curve.through(np.column_stack([x, np.full(200, aside)])))
    if beyond < 1.0:
        assert found is own
    else:
        assert found.length == pytest.approx(50.0 + 2.0 * beyond, abs=0.5)
        assert np.abs(found.points[:, 1]).max() < 0.01


def test_placements_are_weighted_least_squares():
    """A chain without contradiction, and one of two places with weights of 1 and 2: 4 m of 5 m."""
    chain = [
        Equation(((7, 1.0),), 2.0, 1.0),
        Equation(((3, 1.0), (7, -1.0)), 10.0, 1.0),
        Equation(((5, 1.0), (3, -1.0)), -4.0, 2.0),
    ]
    assert solve_placement([7, 3, 5], chain) == pytest.approx({7: 2.0, 3: 12.0, 5: 8.0})
    apart = [Equation(((1, 1.0),), value, weight) for value, weight in ((0.0, 1.0), (5.0, 2.0))]
    assert solve_placement([1], apart) == pytest.approx({1: 4.0})


@pytest.mark.parametrize(
    ("yaw", "speed", "driven"),
    [
        *((90, 5.0, True), (90, 2.0, False), (90, 1.0, None)),
        *((30, 5.0, True), (20, 5.0, None), (145, 5.0, True), (155, 5.0, None)),
    ],
)
def test_paths_cross_where_lines_do(yaw, speed, driven):
    """30 m from both beginnings; up to 15 m beyond an end, between 25° and 150°."""
    yaw = np.radians(yaw)
    second = line(10.0 - 30.0 * np.cos(yaw), -30.0 * np.sin(yaw), yaw, speed)
    found = path_crossing(*clean_tracks(encounter_of(line(-20.0, 0.0, 0.0, 8.0), second)))
    assert (found is None) == (driven is None)
    if found:
        assert (found.first, found.second) == pytest.approx((30.0, 30.0), abs=0.05)
        assert found.driven == driven


@pytest.mark.parametrize(("speed", "turned", "along"), [(5.0, 1, 12.68), (7.2, 5, 47.32)])
def test_crossing_closer_in_time_counts(speed, turned, along):
    """A circle of 20 m is crossed after 30° and after 150°, at 1.3 s and at 6.5 s."""
    circle, north = arc(0.0, -20.0, 0.0, 20.0, 8.0), line(10.0, -30.0, np.pi / 2.0, speed)
    found = path_crossing(*clean_tracks(encounter_of(circle, north)))
    assert found.first == pytest.approx(turned * np.pi / 6.0 * 20.0, abs=0.3)
    assert found.second == pytest.approx(along, abs=0.3)


@pytest.mark.parametrize(
    ("beside", "width", "count"),
    [(1.6, 0.6, 1), (-2.9, 0.6, 1), (1.6, 1.9, 0), (0.9, 0.6, 0), (3.1, 0.6, 0)],
)
def test_bicycle_beside_car_shares_its_lane(beside, width, count):
    encounter = encounter_of(line(0.0, 0.0, 0.0, 5.0), line(10.0, beside, 0.0, 5.0))
    pair = (Vehicle("c", 4.5, 1.9), Vehicle("b", 1.8, width))
    found = abreast_in_lane(clean_tracks(replace(encounter, vehicles=pair)))
    assert len(found) == count
    for one in found:
        assert one.offset == pytest.approx(beside, abs=0.01)
        assert one.clearance == pytest.approx(abs(beside) - 0.95 - 0.3, abs=0.01)
        assert one.spans == pytest.approx(np.array([[10.0, 49.5], [0.0, 39.5]]), abs=0.6)


@pytest.mark.parametrize("off", [-0.02, 0.02])
def test_headings_about_west_stay_together(off):
    """A drive to the west, of which the path is beyond ±π and the recorded heading is not."""
    recorded = line(0.0, 0.0, np.pi - off, 8.0)
    recorded[:, 2] = np.sign(off) * np.pi + off
    encounter = encounter_of(recorded, line(0.0, 60.0, 0.0, 5.0))
    track, _ = clean_tracks(encounter)
    np.testing.assert_allclose(track.poses[:, 2], encounter.heading[0], atol=0.1)


@pytest.mark.parametrize(
    ("recorded", "turn", "same"),
    [
        (0, 14, True),
        (20, 34, True),
        (20, 36, False),
        (45, 84, True),
        (45, 86, False),
        (-45, 45, False),
    ],
)
def test_turns_are_compared_by_name(recorded, turn, same):
    """Up to 15° they are the same, up to 40° if they are named the same."""
    recorded, turn = np.radians([recorded, turn])
    assert is_same_turn(recorded, turn) == is_same_turn(turn, recorded) == same


@pytest.mark.parametrize(
    ("turn", "name"),
    [
        (29, "straight"),
        (-29, "straight"),
        (31, "left"),
        (-31, "right"),
        (149, "left"),
        (-151, "U-turn"),
    ],
)
def test_manoeuvres_are_named_by_turn(turn, name):
    assert manoeuvre_of(np.radians(turn)) == name
