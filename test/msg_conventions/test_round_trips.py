# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every convention gives back what went in, bit for bit, and refuses what is damaged with a reason."""

from collections import Counter
from dataclasses import replace
import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from support.message_decoders import decode_state
from support.message_examples import (
    assert_same,
    encounter,
    generator,
    lanes_again,
    NASTY_HEADINGS,
    road_with,
    route,
    scenario,
    seeds,
    segmentation,
)

from msg_conventions import (
    changepoints,
    diagnostics,
    ego,
    fits,
    paths,
    roads,
    scenario_info,
    scenarios,
    tracks,
    trajectory,
)
from msg_conventions.cdr import decode, encode
from msg_conventions.layouts import PATH, STRING
from scenario_gen.base.errors import InputError
from scenario_gen.numerics.arrays import canonical_angle
from scenario_gen.types import Facts, Loss, Note, NoteKind, Route, token, tokens, Vehicle
from scenario_gen.types.fit import Fit, FittedVehicle
from scenario_gen.types.lanes import DrawnFor, Lane, LaneNetwork, RuleKind, TrafficRule
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates, Cause, ScenarioSet


@given(seeds, st.integers(2, 5), st.integers(2, 60))
@settings(max_examples=40)
def test_tracks(seed, n, t):
    sent = encounter(seed, n, t)
    assert_same(
        sent,
        tracks.decode_tracks(tracks.encode_tracks(sent)),
        *(f for f in sent.__dataclass_fields__),
    )


@given(seeds, st.integers(1, 5), st.integers(2, 60))
@settings(max_examples=40)
def test_scenario(seed, n, t):
    sent = scenario(seed, n, t)
    stamp, got = scenarios.decode_scenario(
        scenarios.encode_scenario(sent, 12_345_678_901), seed=sent.seed, index=sent.index
    )
    assert stamp == 12_345_678_901
    assert_same(sent, got, *(f for f in sent.__dataclass_fields__))


@given(st.floats(-40.0, 40.0))
@settings(max_examples=60)
def test_every_canonical_heading_survives(angle):
    for value in (angle, *NASTY_HEADINGS):
        for turns in (0, 1, -3):
            canonical = canonical_angle(value) + turns * 2.0 * math.pi
            from msg_conventions.poses import quaternion, yaw

            back = canonical_angle(yaw(quaternion(np.array([canonical]))))
            assert back[0] == canonical_angle(value)


@given(seeds, st.integers(0, 3))
@settings(max_examples=30)
def test_changepoints_and_posterior(seed, k):
    template, sent = encounter(seed), segmentation(seed, k=k)
    got = changepoints.decode_changepoints(
        changepoints.encode_changepoints(template, sent), template
    )
    assert_same(sent, got, "changepoints")
    assert (np.flatnonzero(np.diff(got.labels)) + 1 == sent.changepoints).all()
    whole = changepoints.decode_posterior(
        changepoints.encode_posterior(template, sent), sent.descriptions
    )
    assert_same(sent, whole, "labels", "changepoints", "changepoint_probability", "descriptions")


@given(seeds, st.integers(1, 30), st.integers(1, 30), st.integers(0, 4))
@settings(max_examples=30)
def test_road(seed, height, width, ways):
    rng = generator(seed)
    drivable = rng.random((height, width)) < 0.5
    drivable[0, 0] = True
    ends = np.column_stack([rng.normal(0, 50, (ways, 2)), rng.choice(NASTY_HEADINGS, ways)])
    sent = Road("map", drivable, 0.2, rng.normal(0, 50, 2), ends, ends[::-1], "a" * (seed % 5 + 1))
    grid = roads.encode_map(sent, 99)
    stamp, got = roads.decode_map(grid, roads.encode_description(sent, grid, 99))
    assert stamp == 99
    assert_same(sent, got, *(f for f in sent.__dataclass_fields__))
    assert len(roads.decode_map(grid)[1].entries) == 0


@given(seeds, st.integers(1, 4))
@settings(max_examples=20)
def test_lanes(seed, count):
    rng = generator(seed)
    own = []
    for k in range(count):
        left, right = rng.normal(0, 50, (2, 2 + int(rng.integers(5)), 2))
        limit = math.nan if k % 2 else float(rng.random())
        height = np.where(
            np.arange(len(left)) == k, np.nan, 4.0 * k
        )  # from two lanes on they lie above each other
        own.append(
            Lane(
                f"é.{k}",
                left,
                right,
                (int(rng.integers(count)),),
                tuple(range(k)),
                limit,
                "j" * k,
                height,
            )
        )
    rules = tuple(
        TrafficRule(
            f"é{k}",
            kind,
            (int(rng.integers(count)),),
            tuple(range(k % count)),
            rng.normal(0, 50, (2 * (k % 2), 2)),
        )
        for k, kind in enumerate(RuleKind)
    )
    aim, origin = (
        DrawnFor(rng.normal(0, 50, 3), (("é.0", ""), ("", "2.1"))),
        (49.0, 8.4) if count % 2 else (),
    )
    sent = LaneNetwork(
        "map",
        tuple(own),
        (Note.of(NoteKind.LIGHTS_OFF),),
        rules[: int(rng.integers(5))],
        bool(rng.integers(2)),
        True,
        aim,
        origin,
    )
    got = lanes_again(sent)
    assert (got.name, got.notes, got.drawn, got.origin) == (sent.name, sent.notes, True, origin)
    assert_same(got.drawn_for, aim, "frame", "lanes")
    assert got.rules_kept == sent.rules_kept
    for one, other in zip(sent.rules, got.rules, strict=True):
        assert_same(one, other, "id", "kind", "lanes", "over", "line")
    for one, other in zip(sent.lanes, got.lanes, strict=True):
        assert_same(one, other, "id", "left", "right", "successors", "neighbours", "junction")
        assert np.array_equal(one.speed_limit, other.speed_limit, equal_nan=True)
        assert np.array_equal(other.height, one.height, equal_nan=True)
    road = replace(road_with(sent), frame_id="odom")
    data = roads.encode_description(road, b"", 9)
    with pytest.raises(InputError, match="frame 'odom' is not the map's"):
        roads.decode_map(roads.encode_map(road_with(sent), 1), data)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (b"[0.0, 0.0]", b"[0.0, 5e9]", "more than 1e.08 m away"),
        (b"[0.0, 0.0]", b"[0.0, 1e999]", "not finite"),
        (b"[0.0, 0.0], ", b"", "borders of shapes"),
        (b'"successors": [0]', b'"successors": [0.5]', "0.5 is no int"),
        (b'"successors": [0]', b'"successors": [8]', "leads to a lane that is not there"),
        (b'"name"', b'"nome"', "LaneNetwork"),
        (b'{"stamp"', b'["stamp"', "no JSON"),
        (b'{"stamp": 5', b'{"stamp": true', "True is no int"),
    ],
)
def test_impossible_lanes_are_refused(old, new, said):
    border = np.column_stack((np.arange(3.0), np.zeros(3)))
    network = LaneNetwork("m", (Lane("7", border + 1.0, border, (0,)),))
    text = decode(STRING, roads.encode_description(road_with(network), b"", 5), "").data.encode()
    assert old in text
    data = encode(STRING, data=text.replace(old, new).decode())
    with pytest.raises(InputError, match=said):
        roads.decode_description(data)


def test_unknown_cells_are_not_drivable():
    road = Road(
        "map", np.ones((2, 2), dtype=bool), 0.5, np.zeros(2), np.zeros((0, 3)), np.zeros((0, 3))
    )
    grid = bytearray(roads.encode_map(road, 0))
    grid[-4:] = np.array([-1, 64, 65, 100], dtype=np.int8).tobytes()
    assert roads.decode_map(bytes(grid))[1].drivable.tolist() == [[False, True], [False, False]]


@given(seeds, st.sampled_from(["map", "m", "longer_frame"]))
@settings(max_examples=30)
def test_route(seed, frame):
    sent = route(seed)
    anchors = [5_000_000_000, 6_100_000_000, 7_000_000_000, 7_000_000_001, 9_000_000_000]
    path = decode(PATH, paths.encode_route(sent, anchors, frame), "route")
    assert (path.stamp, path.frame_id) == (anchors[0], frame)
    poses, stamps = paths.timed_poses(path, "route")
    at = np.searchsorted(stamps, anchors)
    assert (stamps[at] == anchors).all() and (np.diff(stamps) >= 0).all()
    moved = np.concatenate([[True], (np.diff(poses, axis=0) != 0.0).any(axis=1)])
    got = Route(poses[moved], (np.cumsum(moved) - 1)[at], sent.length)
    assert_same(sent, got, "points", "anchor")


def _fit(template, at) -> Fit:
    rng = generator(3)
    n, k = len(template.vehicles), len(at)
    anchors = np.concatenate(
        [rng.normal(0, 30, (n, k, 2)), rng.choice(NASTY_HEADINGS, (n, k, 1))], axis=-1
    )
    fitted = tuple(
        FittedVehicle(a, np.full(k, 0.2), np.zeros(k - 1, dtype=bool), 0.9, "left")
        for a in anchors
    )
    start, end = (np.concatenate([anchors[:, j], rng.random((n, 1))], axis=1) for j in (0, -1))
    return Fit(
        template.vehicles,
        fitted,
        at,
        BoundaryStates(start, end),
        (Note.of(NoteKind.SCALED, scale=0.9),),
    )


def test_fit():
    template = encounter(3)
    at = np.array([0, 7, 20, 39])
    sent = _fit(template, at)
    got = trajectory.decode(fits.encode_fit(template, sent, "map"), "fit")
    assert (got.stamp_ns, got.frame_id) == (template.start_ns, "map")
    states = np.dstack([got.position, got.heading, got.speed])
    assert_same(sent.requested, BoundaryStates(states[:, 0], states[:, -1]), "start", "end")
    assert (
        canonical_angle(got.heading) == np.stack([v.anchors for v in sent.fitted])[..., 2]
    ).all()
    assert fits.anchor_stamps(template, at[1:-1]) == [
        template.start_ns + int(k) * template.dt_ns for k in at
    ]


def test_plan():
    template, at = encounter(3), np.array([0, 7, 20, 39])
    losses = (Loss("order", ("1", "2"), "é goes first"),)
    sent = replace(_fit(template, at), losses=losses)
    ways = (route(1), replace(route(2), joined=2, left_out=(1,), farthest=0.1), route(3))
    messages = {"tracks": b"a", "changepoints": b"b", "map": b"c", "road/entries": b"d"}
    plan = fits.decode_plan(fits.encode_plan(template, sent, ways, "map", messages))
    assert (plan.stamp, plan.frame_id) == (template.start_ns, "map")
    assert plan.inputs.keys() == {"tracks", "changepoints", "map"}
    got = plan.fit(template)
    assert (got.notes, got.losses) == (sent.notes, losses)
    assert_same(sent.requested, got.requested, "start", "end", "relaxed")
    for one, other in zip(sent.fitted, got.fitted, strict=True):
        assert_same(one, other, "anchors", "moved", "stands", "scale", "manoeuvre")
    for one, other in zip(ways, plan.routes, strict=True):
        assert_same(one, other, *(f for f in one.__dataclass_fields__ if f != "farthest"))
    assert math.isnan(plan.routes[0].farthest) and plan.routes[1].farthest == 0.1
    with pytest.raises(InputError, match="3 vehicles at 4 points; tracks have 2"):
        plan.fit(encounter(3, 2))
    with pytest.raises(InputError, match="it ends at sample 39, not with the tracks"):
        plan.fit(encounter(3, 3, 50))


def test_reports():
    sent = ScenarioSet(
        50,
        (scenario(1),),
        70,
        Counter({Cause.OVERLAP: 15, Cause.OFF_ROAD: 5}),
        (Note.of(NoteKind.STRETCHED, percent=5.0),),
    )
    template = encounter(3)
    fit = _fit(template, np.array([0, 7, 20, 39]))
    asked = BoundaryStates(np.ones((2, 4)), np.zeros((2, 4)))
    data = scenarios.encode_scenario(sent.scenarios[0], 5)
    made = _entry(sent.scenarios[0], data, asked=asked, names=("log", "straight"))
    edge = {"kind": "yield", "words": "b waits for a", "lag": 1.4, "confidence": 0.9, "kept": True}
    cut = {"kind": "follow", "words": "a follows b (doubtful)", "lag": 1.0, "confidence": 0.4}
    reactions = {"edges": [edge], "cut": [cut], "sentences": ["b waits for a"]}
    summary = _again(scenario_info.request_summary(sent, "r1", 7, 5, reactions=reactions))
    assert (summary.reactions, summary.cut) == ((edge,), (cut,))
    statuses = fits.fit_statuses(fit, "/planner")
    said = diagnostics.encode_diagnostics(statuses, 5)
    assert diagnostics.decode_diagnostics(said) == (5, statuses)
    entry = _again(made)
    assert (entry.stamp, entry.road, entry.sha256) == (5, "straight", scenarios.digest(data))
    assert_same(entry.asked(), asked, "start", "end", "relaxed")
    assert entry.achieved.tobytes() == made.achieved.tobytes()
    assert entry.witness == "" and entry.asked(witness=True) is None
    assert summary.result(sent.scenarios) == sent
    assert not summary.is_full
    with pytest.raises(InputError, match=r"time_law.* version"):
        replace(summary, refused={"time_law": 1}).result()  # as 0.2 wrote it


def _again(info):
    return scenario_info.decode_info(scenario_info.encode_info(info))


def _entry(sent, data, **values):
    return scenario_info.scenario_entry(sent, data, "r1", template=sent.vehicles, **values)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"index": 0', '"index": -1', "r1: its index or seed is negative"),
        ('"index": 0', '"index": "0"', "'0' is no int"),
        ('"request": "r1"', '"reqest": "r1"', "no ScenarioEntry"),
        ('"start": [[0.0, ', '"start": [[', "requested states are no rows"),
        ('"start": [[0.0', '"start": [[null', "requested states are no rows"),
        ('"facts": {', '"facts": {"order": "late", ', "order is 'late'"),
        ('"facts": {', '"facts": {"pet_s": "soon", ', "could not convert"),
        ('"facts": {', '"facts": {"decision": {"who": "2"}, ', "no ScenarioEntry"),
        ('"requested": {', '"requested": {"relaxed": [[[-1, 0], [0, 0]]], ', "relaxed is not"),
        ("{", '{"published": 1, ', "no RequestSummary"),
        ("{", "[", "no JSON"),
    ],
)
def test_impossible_entries_are_refused(old, new, said):
    sent = replace(scenario(1, 1), index=0, facts=Facts(rarity=0.5))
    data = scenarios.encode_scenario(sent, 5)
    states = BoundaryStates(np.zeros((1, 4)), np.zeros((1, 4)))
    text = decode(STRING, scenario_info.encode_info(_entry(sent, data, asked=states)), "").data
    text = text.replace('"relaxed": [[[0.0, 0.0], [0.0, 0.0]]]', '"of": 0')
    assert old in text
    with pytest.raises(InputError, match=rf"scenarios/info.*{said}"):
        scenario_info.decode_info(encode(STRING, data=text.replace(old, new, 1)))


@given(seeds)
def test_states(seed):
    sent = np.array(
        [*generator(seed).normal(0, 100, 2), generator(seed).choice(NASTY_HEADINGS), 8.5]
    )
    stamp, frame, child, got = decode_state(ego.encode_state(sent, "vehicle_7", "map", 5))
    assert (stamp, frame, child) == (5, "map", "vehicle_7")
    assert got[[0, 1, 3]].tobytes() == sent[[0, 1, 3]].tobytes()
    assert canonical_angle(got[2]) == canonical_angle(sent[2])
    with pytest.raises(InputError, match="not finite"):
        ego.encode_state(sent * np.nan, "vehicle_7", "map", 5)


def test_ids_become_ros_tokens():
    assert tokens(["7", "car 1", "Ü-bus", "a__b"]) == ("7", "car_1", "bus", "a_b")
    with pytest.raises(InputError, match=r"'car 1' and 'car_1'"):
        tokens(["car 1", "car_1"])
    with pytest.raises(InputError, match="no letter"):
        token("--")


@given(st.floats(0.1, 50.0), st.floats(0.1, 10.0))
def test_footprints_travel_in_joint_names(length, width):
    vehicle = Vehicle("car_1", length, width)
    assert trajectory.vehicle_of(trajectory.joint_names([vehicle])[0]) == vehicle


@pytest.mark.parametrize("name", ["a:4.8", "a:0x1", "a:nanx1", "a:4.8x-1", "a:1e999x1", "a:--x1"])
def test_a_bad_footprint_is_refused(name):
    with pytest.raises(InputError, match=r"length.*width"):
        trajectory.vehicle_of(name)


def test_non_finite_values_are_refused():
    sent = trajectory.decode(tracks.encode_tracks(encounter(1, 2, 5)), "tracks")
    bad = np.array(sent.speed)
    bad[0, 0] = np.nan
    with pytest.raises(InputError, match="not finite"):
        trajectory.encode(replace(sent, speed=bad))
    data = bytearray(tracks.encode_tracks(encounter(1, 2, 5)))
    data[-24:-16] = np.array([np.nan]).tobytes()
    with pytest.raises(InputError, match="not finite"):
        tracks.decode_tracks(bytes(data))
