# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""New encounters out of two recorded ones: one vehicle of each, who do to each other what the recorded ones did."""

from dataclasses import replace
import math

import numpy as np
import pytest
from support.textbook_motions import labelled

from scenario_gen import generate, recombined, RefusedError
from scenario_gen.method.evaluation.encounter_features import DISTANCE, features_of
from scenario_gen.method.recombination import pair_of, recombinations
from scenario_gen.situation import conflict_of, lane_gaps, time_gaps
from scenario_gen.types import FOLLOW, Recorded, YIELD

WAITS, FOLLOWS, MERGES, TURNS = (
    "crossing, stops",
    "follows",
    "merges",
    "left turn before oncoming, stops",
)


def recorded(kind, *seeds):
    return [replace(labelled(kind, seed).encounter, name=f"{kind} {seed}") for seed in seeds]


def stands(motion, n):
    return float((motion.speed[n, motion.present_slice(n)] < 0.5).sum() * motion.dt)


@pytest.mark.parametrize("kind", [WAITS, FOLLOWS, MERGES, TURNS])
def test_an_encounter_recombined_with_itself_is_itself(kind):
    (one,) = recorded(kind, 1)
    made, second = recombined(one, one), pair_of(one).conflict.second
    begin = round((made.start_ns - one.start_ns) / one.dt_ns)
    same = slice(begin, begin + len(made.time))
    assert (
        len(made.time) > 0.7 * len(one.time)
        and len({vehicle.id for vehicle in made.vehicles}) == 2
    )
    assert np.abs(made.speed[1] - one.speed[second, same]).max() < 0.3
    assert np.hypot(*(made.position[1] - one.position[second, same]).T).max() < 0.7, (
        "a follower's path is the clean one"
    )


@pytest.mark.parametrize("kind", [WAITS, TURNS])
def test_who_waits_stands_as_long_and_passes_as_long_behind_as_it_did_for_another_one(kind):
    tried = 0
    for one, other in zip(recorded(kind, *range(6)), recorded(kind, *range(1, 7)), strict=True):
        try:
            made = recombined(one, other)
        except RefusedError:
            continue
        tried += 1
        first, second = pair_of(one).conflict.first, pair_of(other).conflict.second
        begin = round((made.start_ns - one.start_ns) / one.dt_ns)
        np.testing.assert_allclose(
            made.speed[0, made.present_slice(0)],
            one.speed[first, begin:][: len(made.time)],
            atol=1e-9,
        )
        assert stands(made, 1) == pytest.approx(stands(other, second), abs=0.2)
        behind = conflict_of(other, 0, 1).encroachment
        assert conflict_of(made, 0, 1).encroachment == pytest.approx(behind, abs=0.6), (
            "the shared area differs by its edges"
        )
        assert pair_of(made).graph == pair_of(other).graph
    assert tried >= 3


def test_who_follows_keeps_its_own_distance_behind_another_leader():
    makes, wanted, others = [], [], []
    for one in recorded(FOLLOWS, *range(4)):
        for other in recorded(FOLLOWS, *range(4, 8)):
            try:
                made = recombined(one, other)
            except RefusedError:
                continue
            assert [edge.kind for edge in pair_of(made).reactions] == [FOLLOW]
            for found, motion in ((makes, made), (wanted, other), (others, one)):
                conflict = conflict_of(motion, 0, 1)
                found.append(
                    float(np.median(time_gaps(lane_gaps(motion), conflict.second, conflict.first)))
                )
    assert len(makes) >= 8
    off, off_ones = (np.abs(np.subtract(makes, gaps)).mean() for gaps in (wanted, others))
    assert off < 0.25 and off < 0.6 * off_ones, (off, off_ones)


@pytest.mark.parametrize("kind", [FOLLOWS, MERGES, "U-turn"])
def test_most_pairs_of_a_kind_recombine_and_come_no_closer_than_drivers_do(kind):
    known = recorded(kind, *range(4))
    made, refused = recombinations(known, 12)
    assert len(made) >= 8, refused
    nearest = min(pair_of(encounter).features[DISTANCE] for encounter in known)
    for encounter in made:
        assert pair_of(encounter).features[DISTANCE] >= min(nearest, 1.0)
        assert encounter.present_slice(0, 1).start == 0, "it begins when both are there"


def test_what_is_not_alike_is_refused_and_says_why():
    (waits,), (follows,) = recorded(WAITS, 1), recorded(FOLLOWS, 1)
    with pytest.raises(RefusedError, match="different kinds"):
        recombined(waits, follows)
    far = replace(
        waits, position=waits.position + np.array([1000.0, 0.0]) * np.arange(2)[:, None, None]
    )
    with pytest.raises(RefusedError, match="different kinds"):
        recombined(far, far)
    late = replace(
        waits,
        speed=waits.speed
        * np.where(np.arange(2) == pair_of(waits).conflict.second, 9.0, 1.0)[:, None],
    )
    with pytest.raises(RefusedError, match=r"too hard|unusual|kind"):
        recombined(waits, late)


def parents_of(encounter):
    return encounter.source.first, encounter.source.second


def test_each_reacts_as_in_its_own_recording():
    waits, free = recorded(WAITS, *range(5)), recorded("crossing, by chance", *range(12))
    free = [encounter for encounter in free if not pair_of(encounter).graph][:5]
    made = [*recombinations([*waits, *free], 90)[0]]
    of_both = [[name.startswith(WAITS) for name in parents_of(encounter)] for encounter in made]
    for second in (True, False):
        found = [
            pair_of(own).graph
            for own, names in zip(made, of_both, strict=True)
            if names == [not second, second]
        ]
        assert len(found) >= 3 and all(
            graph == ({(True, YIELD)} if second else set()) for graph in found
        )


def test_pairs_are_drawn_by_the_seed_and_those_that_give_none_are_counted():
    known = recorded(WAITS, *range(4)) + recorded(FOLLOWS, *range(4))
    made, refused = recombinations(known, 100)
    assert 8 <= len(made) <= 24 and len(made) + sum(refused.values()) == 24, (
        "ordered pairs of four, of two kinds"
    )
    assert len({encounter.name for encounter in made}) == len(made)
    assert all(first[:8] == second[:8] for first, second in map(parents_of, made))
    few, again = (recombinations(known, 3, seed=5)[0] for _ in range(2))
    assert [encounter.name for encounter in few] == [
        encounter.name for encounter in again
    ] and len(few) == 3
    np.testing.assert_array_equal(few[0].position, again[0].position)
    assert (
        recombinations(known[:1], 5) == recombinations([], 5) == ([], {})
        and known[0].source == Recorded()
    )
    assert recombinations([known[0], replace(known[0], name="the same again")], 5) == ([], {})


def test_recombined_encounters_are_like_recorded_ones_and_new():
    """They are about as far from recorded encounters of other drivers as recorded ones are, and not where their parents are."""
    known = recorded(FOLLOWS, *range(12)) + recorded(WAITS, *range(12))
    for kind in ("following", "crossing"):
        own = [encounter for encounter in known if pair_of(encounter).kind == kind]
        features = np.array([features_of(encounter, "", 0).features for encounter in own])
        spread = np.maximum(features.std(axis=0), 0.05 * features.std(axis=0).max())
        names = [encounter.name for encounter in own]
        between = np.sqrt(
            np.square((features[:, None] - features) / spread).mean(axis=-1)
        ) + np.diag(np.full(len(own), math.inf))
        nearest, to_parents = [], []
        for encounter in recombinations(own, 40, seed=1)[0]:
            away = np.sqrt(
                np.square((features_of(encounter, "", 0).features - features) / spread).mean(
                    axis=-1
                )
            )
            parents = [names.index(name) for name in parents_of(encounter)]
            to_parents.append(away[parents].min())
            away[parents] = math.inf
            nearest.append(away.min())
        usual = np.median(between.min(axis=0))
        assert np.median(nearest) < 1.3 * usual, (kind, np.median(nearest), usual)
        assert np.median(to_parents) > 0.5 * usual, (kind, np.median(to_parents), usual)


def test_scenarios_are_generated_from_it_that_keep_its_reaction():
    one, other = recorded(WAITS, 0, 1)
    result = generate(recombined(one, other), "corridor", count=5, seed=1)
    assert len(result) == 5 and not result.lost_reactions
    assert [edge.kind for edge in result.generated.reactions] == [YIELD]
