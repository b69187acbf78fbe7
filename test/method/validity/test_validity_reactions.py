# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The certificate of interaction: who enters or leaves too early or too late, or drives too near or too far, is refused."""

from dataclasses import replace

import numpy as np
import pytest
from support.motions import as_scenario
from support.reaction_scenes import answering, crossing, lane_encounter, wander
from support.textbook_motions import labelled, REACTIONS

from scenario_gen.method.validity import Checker, Limits
from scenario_gen.situation import find_conflicts, Situation
from scenario_gen.situation.gaps import lane_gaps
from scenario_gen.types.scenario import Cause


def refusals(scenario, template, limits=None):
    conflicts = find_conflicts(template)
    checker = Checker(
        None,
        None,
        conflicts,
        None,
        limits,
        reactions=Situation.of(template).reactions.edges,
        lane_gaps=lane_gaps(template),
    )
    (verdict,) = checker.check([scenario])
    return [one for one in verdict.violations if one.cause == Cause.REACTION]


TEMPLATE = crossing(8.0)
CLEARS = Situation.of(TEMPLATE).reactions.edges[0].clears


@pytest.mark.parametrize(
    ("lag", "kept"),
    [
        (-1.5, False),
        (-1.2, False),
        (-0.7, True),
        (0.0, True),
        (2.0, True),
        (3.0, True),
        (5.0, True),
        (9.0, False),
    ],
)
def test_yielder_leaves_neither_early_nor_late(lag, kept):
    """It is seen to leave 0.25 s after its speed begins to rise."""
    own = Situation.of(TEMPLATE).reactions.edges[0].lag
    assert -0.1 < own < 2.0
    found = refusals(as_scenario(crossing(CLEARS + lag)), TEMPLATE)
    assert (found == []) == kept
    if not kept:
        assert found[0].vehicles == (1, 0)
        assert ("leaves" if lag < 0.0 else "enters") in found[0].message
        assert "vehicle 1 has cleared" in found[0].message


def test_lag_bounds_are_parameters():
    early = as_scenario(crossing(CLEARS - 1.2))
    assert refusals(early, TEMPLATE) != []
    assert refusals(early, TEMPLATE, Limits(anticipation=1.5)) == []
    late = as_scenario(crossing(CLEARS + 9.0))
    assert refusals(late, TEMPLATE, Limits(patience=9.0)) == []


def test_yielder_without_meeting_does_not_yield():
    moved = TEMPLATE.position.copy()
    moved[0, :, 1] += 500.0
    (found,) = refusals(as_scenario(replace(TEMPLATE, position=moved)), TEMPLATE)
    assert "does not pass behind" in found.message


LEADER = wander(np.random.default_rng(3), 200)
LANE = lane_encounter(LEADER, answering(LEADER, 1.2, 0.9))


@pytest.mark.parametrize(
    ("ahead", "kept"),
    [(0.0, True), (2.0, True), (5.0, False), (12.0, False), (-3.0, True), (-25.0, False)],
)
def test_follower_keeps_its_drivers_gaps(ahead, kept):
    moved = LANE.position.copy()
    moved[1, :, 0] += ahead
    found = refusals(as_scenario(replace(LANE, position=moved)), LANE)
    assert (found == []) == kept


def test_least_headway_is_always_kept():
    """A driver who in the template is far behind, at any speed of it."""
    far = lane_encounter(LEADER, LEADER, 75.0)
    assert Situation.of(far).reactions.edges == ()
    for gap, kept in ((12.0, True), (9.0, False)):  # between centres, at 12 m/s
        found = refusals(as_scenario(lane_encounter(LEADER, LEADER, gap)), far)
        assert (found == []) == kept
    assert (
        refusals(as_scenario(lane_encounter(LEADER, LEADER, 9.0)), far, Limits(least_headway=0.2))
        == []
    )
    assert (
        refusals(
            as_scenario(lane_encounter(LEADER, LEADER, 9.0)), lane_encounter(LEADER, LEADER, 9.5)
        )
        == []
    ), "it does so, too"


@pytest.mark.parametrize(
    "template", [TEMPLATE, LANE, *(labelled(kind, 3).encounter for kind in REACTIONS)]
)
def test_templates_keep_their_own_reactions(template):
    assert refusals(as_scenario(template), template) == []
