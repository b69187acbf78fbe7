# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Decisions: other outcomes of recorded conflicts, their probabilities, and their sets."""

from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console
from support.textbook_motions import labelled

import scenario_gen as sg
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.results import Drives
from scenario_gen.closed_loop.trials import run_trials, trials_of
from scenario_gen.method.decisions import goes_first_probability, offered_lags
from scenario_gen.method.outcome_sets import drawn_sizes, requested_decisions
from scenario_gen.output.report.summary import summary
from scenario_gen.output.review.validation import validate_bag
from scenario_gen.situation import conflict_of, Situation
from scenario_gen.types import Decided, NoteKind, Outcome, Request, YIELD

DRAWN = sg.PipelineConfig(sampling=sg.SamplingConfig(decisions="drawn"))
WAITS = "crossing, stops"


def recorded(kind=WAITS, seed=0):
    return replace(labelled(kind, seed).encounter, name=f"{kind} {seed}")


@pytest.fixture(scope="module")
def sets():
    """The sets of a crossing whose recorded second vehicle stops."""
    return sg.generate_outcomes(recorded(), "corridor", DRAWN, count=12, seed=4)


def first_to_enter(scenario):
    return scenario.vehicles[conflict_of(scenario, 0, 1).first].id


def test_the_probabilities_of_the_outcomes_add_up_to_one():
    for kind in (WAITS, "left turn before oncoming, stops", "merges"):
        decisions = sg.decisions_of(recorded(kind))
        assert sum(each.probability for each in decisions.possible) == pytest.approx(1.0)
        assert Outcome.GOES_FIRST in {each.outcome for each in decisions.possible}
        assert all(reason for _, reason in decisions.refused)


def test_who_goes_first_follows_the_law_of_the_offered_lag():
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
    assert patient < bold


def test_the_sizes_of_the_sets_follow_the_probabilities():
    decisions = sg.decisions_of(recorded()).possible
    sizes = np.array([drawn_sizes(decisions, 50, seed) for seed in range(200)])
    shares = np.array([decision.probability for decision in decisions])
    assert (sizes.sum(axis=1) == 50).all()
    error = np.sqrt(shares * (1.0 - shares) / (50 * 200))
    assert (np.abs(sizes.mean(axis=0) / 50 - shares) < 4.0 * error).all()
    chi_square = np.square(sizes - 50 * shares) / (50 * shares)
    assert chi_square.sum(axis=1).mean() == pytest.approx(len(shares) - 1, rel=0.25)


def test_the_drawn_order_holds_in_all_scenarios(sets):
    assert sum(map(len, sets)) == 12 and len(sets) == 3
    for result in sets:
        decision = result.encounter.decision
        assert {first_to_enter(scenario) for scenario in result} == {decision.first}
        assert {scenario.facts.decision for scenario in result} == {decision}
        assert any(
            (edge.kind, edge.confidence) == (YIELD, 1.0) for edge in result.generated.reactions
        )
        decider = [vehicle.id for vehicle in result.encounter.vehicles].index(decision.who)
        stands = min(scenario.speed[decider].min() for scenario in result) < 0.1
        assert stands == (decision.outcome is Outcome.STOPS)


def test_a_decided_driver_goes_first_as_people_do():
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


def test_the_recorded_outcome_is_the_recording():
    encounter = recorded()
    made = sg.decided(encounter, sg.decisions_of(encounter).possible[0])
    assert made.name == encounter.name and made.recording == encounter.name
    np.testing.assert_array_equal(made.position, encounter.position)


def test_what_cannot_be_decided_is_refused_by_name():
    inside = recorded(seed=1)
    conflict = Situation.of(inside).conflicts[0]
    late = inside.between(round(conflict.entry_first / inside.dt) + 2, len(inside.time) - 1)
    brief = replace(inside, present=np.array([[80, len(inside.time) - 1], [0, 95]]))
    merging = recorded("merges")
    shift = np.array([[[0.0, 0.0]], [[0.0, -1.5]]])
    beside = replace(merging, position=merging.position + shift)
    for encounter, why in (
        (beside, "hardly touch each other's paths"),
        (recorded("follows"), "no vehicle crosses"),
        (recorded("merges", 4), "the vehicle ahead decides this merge"),
        (late, "inside the shared area when its recording begins"),
        (brief, "together for less than 2 s"),
    ):
        decisions = sg.decisions_of(encounter)
        assert why in decisions.why and not decisions.possible
        (result,) = sg.generate_outcomes(encounter, "corridor", DRAWN, count=1, seed=1)
        assert any(note.kind is NoteKind.NOTHING_DECIDED for note in result.generated.adaptations)
    decision = sg.decisions_of(recorded()).possible[-1]
    with pytest.raises(sg.RefusedError, match="slow down too much"):
        sg.decided(recorded(), replace(decision, lag=-3.0))


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


def test_one_seed_gives_the_same_scenarios(sets):
    again = sg.generate_outcomes(recorded(), "corridor", DRAWN, count=12, seed=4)
    for result, other in zip(sets, again, strict=True):
        assert [s.facts for s in result] == [s.facts for s in other]
        for scenario, same in zip(result, other, strict=True):
            np.testing.assert_array_equal(scenario.position, same.position)


def test_a_bag_keeps_outcome_and_probability(sets, tmp_path):
    result = sets[-1]
    result.save(tmp_path / "bag")
    read = sg.load(tmp_path / "bag")
    assert read.encounter.source == result.encounter.source
    assert [s.facts.decision for s in read] == [s.facts.decision for s in result]
    (validation,) = validate_bag(tmp_path / "bag")
    assert validation.invalid == 0 and set(validation.proven.values()) == {len(result)}


def test_the_summary_states_the_mix(sets):
    console = Console(width=200, record=True, file=StringIO())
    console.print(summary(sets))
    text = console.export_text()
    sizes = {result.encounter.decision.outcome: len(result) for result in sets}
    assert f"and goes first in {sizes[Outcome.GOES_FIRST]}" in text
    assert f"vehicle 2 stops in {sizes[Outcome.STOPS]} scenarios" in text


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
