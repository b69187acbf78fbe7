# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Decisions: other outcomes of recorded conflicts, their probabilities, and their sets."""

from dataclasses import replace

import numpy as np
import pytest
from support.motions import encounter_of
from support.textbook_motions import labelled

from msg_conventions.tracks import decode_tracks
import scenario_gen as sg
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.results import Drives
from scenario_gen.closed_loop.trials import run_trials, trials_of
from scenario_gen.method.decisions import DecidedConflict, goes_first_probability, offered_lags
from scenario_gen.method.outcome_sets import drawn_sizes, requested_decisions
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.situation import conflict_of, passing, Situation
from scenario_gen.types import Decided, NoteKind, Outcome, Request, YIELD

DRAWN = sg.PipelineConfig(sampling=sg.SamplingConfig(decisions="drawn"))
WAITS = "crossing, stops"


def recorded(kind=WAITS, seed=0):
    return replace(labelled(kind, seed).encounter, name=f"{kind} {seed}")


@pytest.fixture(scope="module")
def sets():
    """The sets of a crossing whose recorded second vehicle stops."""
    return sg.generate_outcomes(recorded(), "corridor", DRAWN, count=12, seed=6)


def first_to_enter(scenario):
    return scenario.vehicles[conflict_of(scenario, 0, 1).first].id


def test_probabilities_add_up_to_one():
    for kind in (WAITS, "left turn before oncoming, stops", "merges"):
        decisions = sg.decisions_of(recorded(kind))
        refused = sum(each.probability for each, _ in decisions.refused)
        possible = sum(each.probability for each in decisions.possible)
        assert refused + possible == pytest.approx(1.0)
        assert Outcome.GOES_FIRST in {each.outcome for each in decisions.possible}
        assert all(reason for _, reason in decisions.refused)


def test_first_goer_follows_the_law():
    lags = np.array(offered_lags(3.0))
    assert lags.std() == pytest.approx(3.0, rel=0.1) and lags.sum() == pytest.approx(0.0)
    assert goes_first_probability(0.0, 0.8) == 0.5
    odds = [goes_first_probability(x, 0.8) / (1.0 - goes_first_probability(x, 0.8)) for x in lags]
    np.testing.assert_allclose(np.log(odds), 0.8 * lags, atol=1e-9)
    patient, bold = (
        sum(
            each.probability
            for each in sg.decisions_of(recorded(), sg.SamplingConfig(decision_rate=rate)).possible
            if each.outcome is Outcome.GOES_FIRST
        )
        for rate in (0.0, 5.0)
    )
    assert patient == pytest.approx(bold) == pytest.approx(0.5), "the lags are symmetric"


def test_set_sizes_follow_probabilities():
    decisions = sg.decisions_of(recorded()).possible
    sizes = np.array([drawn_sizes(decisions, 50, seed) for seed in range(200)])
    shares = np.array([decision.probability for decision in decisions])
    assert (sizes.sum(axis=1) == 50).all()
    error = np.sqrt(shares * (1.0 - shares) / (50 * 200))
    assert (np.abs(sizes.mean(axis=0) / 50 - shares) < 4.0 * error).all()
    chi_square = np.square(sizes - 50 * shares) / (50 * shares)
    assert chi_square.sum(axis=1).mean() == pytest.approx(len(shares) - 1, rel=0.25)


def test_drawn_order_holds_throughout(sets):
    assert sum(map(len, sets)) == 12 and len(sets) == 4
    for result in sets:
        decision = result.encounter.decision
        assert {first_to_enter(scenario) for scenario in result} == {decision.first}
        assert {scenario.facts.decision for scenario in result} == {decision}
        yields = any(
            (edge.kind, edge.confidence) == (YIELD, 1.0) for edge in result.generated.reactions
        )
        assert yields == (decision.outcome is not Outcome.GOES_SECOND)
        decider = [vehicle.id for vehicle in result.encounter.vehicles].index(decision.who)
        stands = min(scenario.speed[decider].min() for scenario in result) < 0.1
        assert stands == (decision.outcome is Outcome.STOPS)


def test_decided_drivers_go_first_like_people():
    encounter = recorded()
    (first,) = (
        decision
        for decision in sg.decisions_of(encounter).possible
        if decision.outcome is Outcome.GOES_FIRST
    )
    made = sg.decided(encounter, first)
    conflict = Situation.of(made).conflicts[0]
    assert made.vehicles[conflict.first].id == first.who and conflict.encroachment >= 1.0
    assert -np.diff(made.speed).min() / made.dt < 3.5
    assert made.source == Decided(encounter.name, first)
    row, recorded_row = (
        [vehicle.id for vehicle in each.vehicles].index(first.who) for each in (made, encounter)
    )
    to_path = made.position[row][:, None] - encounter.position[recorded_row]
    away = np.hypot(*to_path.transpose(2, 0, 1)).min(axis=1)
    assert np.median(away[made.present_slice(row)]) < 0.6, "it stays on its recorded path"


def test_undecidable_conflicts_are_refused():
    crossing = recorded(seed=1)
    conflict = Situation.of(crossing).conflicts[0]
    inside = round(conflict.entry_second / crossing.dt) + 2
    present = np.tile([0, len(crossing.time) - 1], (2, 1))
    present[conflict.second, 0] = inside
    merging = recorded("merges")
    shift = np.array([[[0.0, 0.0]], [[0.0, -1.5]]])
    beside = replace(merging, position=merging.position + shift)
    for encounter, why in (
        (beside, "hardly touch each other's paths"),
        (recorded("follows"), "no vehicle yields to another one"),
        (recorded("merges", 4), "the vehicle ahead decides this merge"),
        (replace(crossing, present=present), "no vehicle yields to another one"),
        (recorded("meets another one closely"), "has not yet passed when its recording ends"),
    ):
        decisions = sg.decisions_of(encounter)
        assert why in decisions.why and not decisions.possible
        (result,) = sg.generate_outcomes(encounter, "corridor", DRAWN, count=1, seed=1)
        assert any(note.kind is NoteKind.NOTHING_DECIDED for note in result.generated.adaptations)
    merging = recorded("merges", 1)
    (decision, why), *_ = sg.decisions_of(merging).refused
    assert "slow down too much" in why
    with pytest.raises(sg.RefusedError, match="slow down too much"):
        sg.decided(merging, decision)


def crossing(*knots, first_begin=-70.0, second_begin=-55.0):
    """One vehicle crosses at 10 m/s; the speeds (s, m/s) of the other one are given."""
    time = np.arange(0.0, 16.0, 0.1)
    speed = np.stack([np.full(len(time), 10.0), np.interp(time, *np.array(knots).T)])
    along = np.array([[first_begin], [second_begin]]) + 0.1 * np.cumsum(speed, axis=1)
    position = np.zeros((2, len(time), 2))
    position[0, :, 0], position[1, :, 1] = along
    vehicles = (sg.Vehicle("i", 4.6, 1.9), sg.Vehicle("j", 4.6, 1.9))
    return encounter_of(position, np.array([[0.0], [0.5 * np.pi]]), speed, vehicles)


def lag_of(encounter):
    return DecidedConflict.of(encounter).lag


def test_offered_lag_precedes_the_decision():
    rolls = crossing((0.0, 10.0), (2.0, 10.0), (5.0, 3.0), (9.0, 3.0), (12.0, 10.0))
    stops = crossing((0.0, 10.0), (2.5, 10.0), (6.5, 0.0), (9.0, 0.0), (14.0, 10.0))
    assert lag_of(rolls) == pytest.approx(1.5, abs=0.1), "15 m at 10 m/s"
    assert lag_of(stops) == pytest.approx(lag_of(rolls), abs=0.2)


def test_standing_driver_decides_at_the_approach():
    begins = (-60.0, -100.0)
    lags = [
        lag_of(crossing((0, 0), (start, 0), (start + 5, 8), first_begin=begin, second_begin=-9.0))
        for begin, start in zip(begins, (6.5, 10.5), strict=True)
    ]
    assert lags[0] == pytest.approx(lags[1], abs=0.2), "however long it has stood"
    assert goes_first_probability(lags[0], 0.8) == pytest.approx(0.5, abs=0.2)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_wider_gap_is_taken_before_narrower(seed):
    decisions = sg.decisions_of(recorded("merges", seed))
    refused = {each.lag for each, _ in decisions.refused if each.outcome == "goes first"}
    taken = set(offered_lags(3.0)) - refused
    assert refused and taken and max(refused) < min(taken)


@pytest.mark.parametrize("kind", ["crossing, rolls", WAITS])
def test_record_ending_in_area_is_continued(kind):
    encounter = recorded(kind, 1)
    (conflict,) = Situation.of(encounter).conflicts
    brief = encounter.between(0, round((conflict.entry_second + 0.5) / encounter.dt))
    (first,) = (
        decision
        for decision in sg.decisions_of(brief).possible
        if decision.outcome is Outcome.GOES_FIRST
    )
    made = sg.decided(brief, first)
    (new,) = Situation.of(made).conflicts
    clears, enters = passing(made, new, merges=new.following)
    assert enters - clears >= 1.0
    assert made.time[made.present[new.first, 1]] >= clears + 1.0


def test_one_set_has_one_outcome():
    with pytest.raises(sg.InputError, match="generate_outcomes"):
        sg.generate(recorded(), "corridor", DRAWN, count=1)
    for order in ("free", "swap"):
        request = Request(order=order)
        (result,) = sg.generate_outcomes(
            recorded(), "corridor", DRAWN, count=1, seed=1, request=request
        )
        assert len(result) == 1
    assert first_to_enter(result[0]) == result[0].facts.decision.first == "2", "swapped"


def test_a_bag_keeps_outcome_and_probability(sets, tmp_path):
    result = sets[-1]
    result.save(tmp_path / "bag")
    read = sg.load(tmp_path / "bag")
    assert read.encounter.source == result.encounter.source
    (original,) = (
        message.data
        for message in read_messages(tmp_path / "bag")
        if message.topic.endswith("tracks/recorded")
    )
    np.testing.assert_array_equal(decode_tracks(original).position, recorded().position)
    assert [s.facts.decision for s in read] == [s.facts.decision for s in result]
    (validation,) = evaluate_bag(tmp_path / "bag")
    assert validation.valid == len(result) and validation.result.generated.reactions


def test_the_requested_vehicles_take_part(sets):
    encounter = recorded()
    shift = np.array([0.0, -60.0])
    three = replace(
        encounter,
        vehicles=(*encounter.vehicles, replace(encounter.vehicles[0], id="third")),
        position=np.concatenate([encounter.position, encounter.position[:1] + shift]),
        heading=np.concatenate([encounter.heading, encounter.heading[:1]]),
        speed=np.concatenate([encounter.speed, encounter.speed[:1]]),
        present=np.tile([0, len(encounter.time) - 1], (3, 1)),
    )
    whys = [
        requested_decisions(three, DRAWN.sampling, Request(ego=ego)).why for ego in ("2", "third")
    ]
    assert whys == ["", "the requested vehicle third does not take part in it"]


def test_drives_are_counted_by_outcome(sets):
    trials = [trial for result in sets for trial in trials_of(result, "1")]
    outcomes = run_trials(trials, "scenario_gen.closed_loop.planners:ConstantSpeed")
    drives = Drives(outcomes, "constant", ClosedLoopConfig(), trials)
    assert {trial.encounter for trial in trials} == {recorded().name}
    (note,) = [note for note in drives.notes() if "outcome of the decision" in note]
    passed = sum(outcome.verdict.passed for outcome in outcomes[: len(sets[0])])
    assert f"stops: {passed} of {len(sets[0])}" in note and "weighted" in note
    documents = [drive["decision"] for drive in drives.document()["drives"]]
    assert documents == [trial.scenario.facts.decision.document() for trial in trials]
