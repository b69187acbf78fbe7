# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Who reacts to whom: planted reactions are found with their lag, independent drives have none, circles are cut."""

from dataclasses import astuple, replace
from functools import cache
import itertools

import numpy as np
import pytest
from support.motions import encounter_of
from support.reaction_scenes import answering, crossing, lane_encounter, wander
from support.textbook_motions import CHANCE, labelled, NOTHING, REACTIONS

from scenario_gen.situation import Conflict, departure, interaction_windows, kind_of, Situation
from scenario_gen.situation.reactions import without_circles
from scenario_gen.situation.separation import least_gaps
from scenario_gen.situation.yielding import _enters_from_beside, Recording
from scenario_gen.types import FOLLOW, Reaction, Vehicle, YIELD

TWO = tuple(map(Vehicle, "12"))


@pytest.mark.parametrize("lag", [0.6, 1.2, 2.0])
def test_planted_lag_and_gain_are_found(lag):
    found = []
    for seed in range(6):
        leader = wander(np.random.default_rng(seed), 400)
        (edge,) = Situation.of(lane_encounter(leader, answering(leader, lag, 0.8))).reactions.edges
        assert (edge.kind, edge.who, edge.whom) == (FOLLOW, 1, 0)
        assert edge.gain == pytest.approx(0.8, abs=0.1)
        found.append(edge.lag)
    assert np.median(found) == pytest.approx(lag, abs=0.15)


def test_independent_drives_hardly_ever_react():
    """Neighbouring lanes never do; one behind another with a speed of its own hardly ever."""
    behind = beside = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        leader, other = wander(rng, 300, 1.5), wander(rng, 300, 1.5) - 2.5
        behind += bool(Situation.of(lane_encounter(leader, other, 58.0)).reactions.edges)
        beside += bool(Situation.of(lane_encounter(leader, other, 25.0, lane=3.5)).reactions.edges)
    assert beside == 0
    assert behind <= 4


@pytest.mark.parametrize("lag", [0.3, 1.5, 2.5])
def test_waiting_vehicle_yields(lag):
    clears = Situation.of(crossing(8.0)).reactions.edges[0].clears
    graph = Situation.of(crossing(clears + lag)).reactions
    (edge,) = graph.edges
    assert (edge.kind, edge.who, edge.whom, edge.stands) == (YIELD, 1, 0, True)
    assert edge.lag == pytest.approx(lag, abs=0.35)  # it leaves when it is faster than 0.5 m/s
    assert graph.sentences(TWO)[0].startswith("vehicle 2 waits for vehicle 1, then passes")


@pytest.mark.parametrize("speed", [2.0, 3.9, 4.4, 6.0])
def test_confidence_falls_with_the_time_gap(speed):
    """0.9 at 2 s, 0.5 at 4 s and in between on a line; who is slower than 4 m/s counts as so fast."""
    steady, bumper = np.full(150, speed), 20.0 - 4.8
    (edge,) = Situation.of(lane_encounter(steady, steady, 20.0)).reactions.edges
    assert edge.confidence == pytest.approx(0.9 - 0.2 * (bumper / max(speed, 4.0) - 2.0))


def test_late_departure_is_no_reaction():
    graph = Situation.of(crossing(14.0)).reactions
    assert graph.edges == ()
    assert graph.sentences(TWO)[0].startswith(
        "no reactions detected: the nearest are vehicle 2 and vehicle 1"
    )


@cache
def judged(kind):
    """(confidence, whether it is right) of the edges of 20 drawn motions, and how many reactions there are."""
    motions = [labelled(kind, seed) for seed in range(20)]
    edges = [
        (one.confidence, (one.who, one.whom) == motion.edge)
        for motion in motions
        for one in pairs_of(motion.encounter)
    ]
    return edges, sum(motion.edge is not None for motion in motions)


def seen(kinds):
    """The same of several kinds."""
    edges, there = zip(*map(judged, kinds), strict=True)
    return np.array(list(itertools.chain(*edges))), sum(there)


def pairs_of(encounter):
    """The surest edge of each pair: one may both come behind another and follow it."""
    edges = sorted(Situation.of(encounter).reactions.edges, key=lambda one: one.confidence)
    return {(one.who, one.whom): one for one in edges}.values()


def test_only_textbook_reactions_are_seen():
    edges, there = seen([kind for kind in (*REACTIONS, *NOTHING) if kind not in CHANCE])
    right = int(edges[:, 1].sum())
    assert right / len(edges) >= 0.95 and right / there >= 0.95


@pytest.mark.parametrize("kind", REACTIONS)
def test_every_kind_of_reaction_is_seen(kind):
    edges, there = seen([kind])
    assert edges[:, 1].sum() >= 0.85 * there == 17.0


def test_confidence_is_the_share_of_right():
    edges, _ = seen((*REACTIONS, *NOTHING))
    for low, high in ((0.5, 0.85), (0.85, 0.95), (0.95, 1.0)):
        band = edges[(edges[:, 0] >= low) & (edges[:, 0] < high)]
        assert band[:, 1].mean() == pytest.approx(band[:, 0].mean(), abs=0.12)


def test_who_overtakes_does_not_follow():
    lane = lane_encounter(np.full(150, 7.0), np.full(150, 14.0), 40.0)
    steps = 1.0 / (1.0 + np.exp((np.abs(lane.time - 7.0) - 3.5) * 3.0))
    aside = np.stack([np.zeros((150, 2)), np.column_stack([np.zeros(150), 3.5 * steps])])
    reactions = Situation.of(replace(lane, position=lane.position + aside)).reactions
    assert reactions.edges == () and "share an area" not in reactions.why


def edge(who, whom, confidence):
    return Reaction(FOLLOW, who, whom, 1.0, 1.0, 1.0, confidence, 0.0, 10.0, (1.0, 1.0, 1.0))


def test_least_sure_edge_is_cut():
    graph = without_circles([edge(0, 1, 0.9), edge(1, 2, 0.4), edge(2, 0, 0.8)], 3)
    assert [(one.who, one.whom) for one in graph.cut] == [(1, 2)]
    assert graph.order == (1, 0, 2)
    assert "left out, as it closes a cycle" in graph.sentences(tuple(map(Vehicle, "abc")))[-1]


@pytest.mark.parametrize("count", [2, 3, 4])
def test_order_follows_reactions(count):
    pairs = list(itertools.permutations(range(count), 2))
    for seed in range(20):
        rng = np.random.default_rng(seed)
        edges = [edge(a, b, float(rng.random())) for a, b in pairs if rng.random() < 0.7]
        graph = without_circles(edges, count)
        assert sorted(graph.order) == list(range(count))
        assert len(graph.edges) + len(graph.cut) == len(edges)
        assert all(graph.order.index(one.whom) < graph.order.index(one.who) for one in graph.edges)


def figures(encounter):
    """Reactions, conflicts, waits, kind, gaps and windows of an encounter of two."""
    situation = Situation.of(encounter)
    names = [
        "kind",
        "who",
        "whom",
        "stands",
        "merges",
        "lag",
        "gain",
        "residual",
        "confidence",
        "since",
        "until",
    ]
    edges = [[getattr(one, name) for name in names] for one in situation.reactions.edges]
    windows = interaction_windows(situation).ravel()
    return [
        *edges,
        *map(astuple, situation.conflicts),
        *map(astuple, situation.waits),
        (kind_of(encounter, 0, 1),),
        tuple(least_gaps(encounter)),
        tuple(windows),
    ]


@pytest.mark.parametrize("kind", [*REACTIONS, *NOTHING])
def test_nothing_depends_on_the_frame(kind):
    """Turned by 126° and 760 m away, it is the same encounter."""
    encounter = labelled(kind, 0).encounter
    cos, sin = np.cos(2.2), np.sin(2.2)
    position = encounter.position @ np.array([[cos, sin], [-sin, cos]]) + (700.0, -300.0)
    moved = replace(encounter, position=position, heading=encounter.heading + 2.2)
    for before, after in zip(figures(encounter), figures(moved), strict=True):
        assert after == pytest.approx(before, abs=1e-6)


@pytest.mark.parametrize("frame", [0.0, 2.2])
@pytest.mark.parametrize(
    ("left", "turned", "beside"),
    [(1.0, 0.0, False), (2.3, 0.0, True), (1.0, 0.6, True), (1.0, -0.6, True), (0.0, 0.4, False)],
)
def test_angled_entry_comes_from_beside(frame, left, turned, beside):
    """Within half a lane and half a radian it is behind; 10 m after the other one's start."""
    along = np.array([[np.cos(frame), np.sin(frame)], [-np.sin(frame), np.cos(frame)]])
    time = np.arange(101) * 0.1
    ways = np.stack([[8.0 * time, 0.0 * time], [8.0 * time + 10.0, 0.0 * time + left]])
    position = np.moveaxis(ways, 1, 2) @ along
    encounter = encounter_of(position, frame + np.array([[0.0], [turned]]), 8.0)
    recording = Recording(encounter, Situation.of(encounter).tracks, (), ())
    conflict = Conflict(0, 1, False, 3.0, 4.0, 5.0, 6.0)
    assert _enters_from_beside(recording, conflict) == beside


@pytest.mark.parametrize("begin", [3.0, 3.03, 3.07])
def test_departure_is_between_samples(begin):
    """It stands until then, and is as fast as 0.5 m/s a quarter of a second later."""
    speed = np.maximum(2.0 * (0.1 * np.arange(101) - begin), 0.0)
    motion = encounter_of(np.zeros((2, 101, 2)), speed=speed)
    assert departure(motion, 0, 6.0) == pytest.approx(begin + 0.25)
