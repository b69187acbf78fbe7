# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The evaluation as a whole: rows, notes, determinism and its documents; the oracle."""

from collections import Counter
from dataclasses import replace
import json
import math

import numpy as np
import pytest
from support.evaluation_worlds import CARS, crossing, replayed, samples

from scenario_gen.method.evaluation import evaluate_scenarios, EvaluationConfig, replay
from scenario_gen.method.evaluation.evaluate import measured
from scenario_gen.types import ALWAYS, NoteKind
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.fit import Fit, FittedVehicle
from scenario_gen.types.scenario import BoundaryStates, Cause, ScenarioSet

T = 121
K = 2
QUICK = EvaluationConfig(resamples=100)


def kinds_of(row):
    return [note.kind for note in row.notes]


def run(accounts=(), **extra):
    encounter = crossing()
    rows = {
        "with changepoints": samples(encounter, 50),
        "without changepoints": samples(encounter, 12, seed=4, pace=0.0),
        "replay": [replayed(encounter)],
    }
    for name, (candidates, refused) in dict(accounts).items():
        rows[name] = ScenarioSet(candidates, rows[name], candidates, Counter(refused))
    return evaluate_scenarios(encounter, rows, changepoints=K, config=QUICK, **extra)


def test_rows_say_what_happened():
    found = run(
        accounts={
            "with changepoints": (60, {Cause.OVERLAP: 9, Cause.SPEED: 1}),
            "without changepoints": (20, {Cause.OFF_ROAD: 4}),
        },
        road="cross",
    )
    assert [row.name for row in found.rows] == [
        "recording",
        "with changepoints",
        "without changepoints",
        "replay",
    ]
    assert found.changepoints == 2 and found.vehicles == ("west", "south")
    assert NoteKind.PAIRS_LEFT_OUT not in kinds_of(found.row("without changepoints"))
    assert found.value("replay", "e_position") < 1e-6 and found.value("replay", "min_ade") < 1e-6
    for key in ("e_position", "e_speed", "js_speed", "js_acceleration", "wasserstein_speed"):
        assert found.value("with changepoints", key) < found.value("without changepoints", key)
    assert found.value("with changepoints", "collision_rate") == pytest.approx(0.15)
    assert found.value("with changepoints", "limit_rate") == pytest.approx(1 / 60)
    assert found.value("with changepoints", "acceptance") == pytest.approx(50 / 60)
    assert found.value("without changepoints", "off_road_rate") == pytest.approx(0.2)
    assert "from 12 scenarios, not 50" in str(found.row("without changepoints").notes[0])
    assert not found.row("with changepoints").notes
    assert all(
        math.isnan(estimate.low) for estimate in found.row("replay").values.values()
    )  # one sample has no interval
    assert math.isnan(found.value("replay", "diversity"))
    assert math.isnan(found.value("nobody", "e_position"))


def test_estimates_lie_in_their_intervals():
    found = run(seed=3)
    for row in found.rows:
        for key, estimate in row.values.items():
            if math.isfinite(estimate.low):
                assert estimate.low <= estimate.value <= estimate.high, (row.name, key)
    text = found.to_json()
    assert "NaN" not in text and json.loads(text)["changepoints"] == 2
    assert text == run(seed=3).to_json() != run(seed=4).to_json()
    page = found.to_markdown()
    assert "K = 2 changepoints" in page and "| E position |" in page and "–" in page


def turning(scenario, degrees):
    """The scenario, its first car turned more and more to the left."""
    more = np.radians(degrees) * np.linspace(0.0, 1.0, len(scenario.time))
    return replace(scenario, heading=scenario.heading + np.stack([more, 0.0 * more]))


def test_headings_and_turns():
    encounter = crossing()
    bend = np.radians(60.0) * np.linspace(0.0, 1.0, T)
    bent = replace(encounter, heading=encounter.heading + np.stack([bend, 0.0 * bend]))
    rows = {str(d): [turning(s, d) for s in samples(encounter, 3)] for d in (0, 40, 58, 60)}
    found = evaluate_scenarios(bent, rows, changepoints=K, config=QUICK)
    kept = [found.value(name, "turn_kept") for name in rows]
    assert kept == [0.5, 1.0, 1.0, 1.0]  # of two cars one goes straight on instead
    errors = [found.value(name, "e_heading") for name in rows]
    assert (
        errors[0] == pytest.approx(1.0) and errors[3] < 1e-6
    )  # parallel headings are a matrix of zeros
    straight = evaluate_scenarios(encounter, rows, changepoints=K, config=QUICK)
    assert "e_heading" not in straight.row("0").values  # nobody turns in the template
    assert straight.value("60", "turn_kept") == 0.5


def test_vanished_conflicts_are_counted_for_themselves():
    encounter = crossing()
    away = replace(
        replayed(encounter, 1),
        position=replayed(encounter).position + np.array([[[0.0, 0.0]], [[500.0, 0.0]]]),
    )
    found = evaluate_scenarios(
        encounter, {"x": [replayed(encounter), away]}, changepoints=K, config=QUICK
    )
    assert found.value("recording", "conflicts") == 1.0
    assert (found.value("x", "conflicts"), found.value("x", "vanished_conflicts")) == (0.5, 0.5)
    assert found.value("x", "order_kept") == 1.0  # of those that are there
    (note,) = [n for n in found.row("x").notes if n.kind is NoteKind.CONFLICTS_VANISHED]
    assert note.values == {"vanished": 0.5, "total": 1.0}


def late(source, n, first):
    """The encounter or scenario, vehicle n of which arrives at sample `first`."""
    present = source.present.copy()
    present[n, 0] = first
    return replace(source, present=present)


def test_late_arrival_is_measured_while_present():
    whole = crossing()
    encounter, made = late(whole, 1, 40), [late(sample, 1, 40) for sample in samples(whole, 3)]
    found = evaluate_scenarios(
        encounter,
        {"x": made, "replay": [late(replayed(whole), 1, 40)]},
        changepoints=K,
        config=QUICK,
    )
    # for the pair the same as where both are there from then on
    cut = whole.between(40, len(whole.time) - 1)
    rows = [replayed_from(sample, 40) for sample in samples(whole, 3)]
    after = evaluate_scenarios(cut, {"x": rows}, changepoints=K, config=QUICK)
    for key in ("e_position", "e_speed"):
        assert found.value("x", key) == pytest.approx(after.value("x", key), rel=0.03), key
    for key in ("min_distance", "min_ttc"):
        assert found.value("x", key) == pytest.approx(after.value("x", key), rel=1e-9), key
    assert found.value("replay", "e_position") < 1e-6 and found.value("replay", "js_gap") < 1e-9
    alone = late(encounter, 1, 115)
    last = evaluate_scenarios(
        alone, {"x": [late(replayed(whole), 1, 115)]}, changepoints=K, config=QUICK
    )
    assert NoteKind.PAIRS_LEFT_OUT in kinds_of(last.row("x"))
    assert math.isnan(last.value("x", "e_position")) and math.isfinite(last.value("x", "js_speed"))


def replayed_from(scenario, first):
    """The scenario from an instant on."""
    parts = {
        name: getattr(scenario, name)[:, first:]
        for name in ("position", "heading", "speed", "acceleration")
    }
    return replace(
        scenario, time=scenario.time[first:] - scenario.time[first], present=ALWAYS, **parts
    )


def test_long_template_is_resampled():
    encounter, config = crossing(), EvaluationConfig(max_steps=60, resamples=20)
    found = evaluate_scenarios(
        encounter, {"x": [replayed(encounter)]}, changepoints=K, config=config
    )
    assert "60 steps" in str(found.row("recording").notes[0])
    assert found.value("x", "e_position") < 1e-6


@pytest.mark.parametrize("count", [999, 1000, 1001, 5000])
def test_measured_runs_span_the_set(count):
    found = np.array(measured(range(count)))
    assert (found[0], found[-1], len(found)) == (0, count - 1, min(count, 1000))
    starts = found[::50]
    assert count <= 1000 or np.ptp(np.diff(starts)) <= 1


def test_replay_keeps_dwells_and_chords():
    time = np.arange(21) * 0.1
    x = np.minimum(time, 1.0) * 4.0
    position = np.stack([np.stack([x, 0 * x], -1), np.stack([0.1 * np.sin(time), 20 + 0 * x], -1)])
    encounter = Encounter.sampled(
        CARS, 0.1, position, np.zeros((2, 21)), np.stack([np.gradient(x, 0.1), 0 * x]), "stop"
    )
    first = np.array([[0, 0, 0], [8, 0, 0], [8, 0, 0.0]])
    second = np.array([[50, 0, np.pi / 2], [50, 0.2, np.pi / 2], [50, 0.2, np.pi / 2]])
    fitted = (
        FittedVehicle(first, np.zeros(3), np.array([False, True]), 2.0, "straight"),
        FittedVehicle(second, np.zeros(3), np.array([False, True]), 1.0, "wait"),
    )
    states = BoundaryStates(np.zeros((2, 4)), np.zeros((2, 4)))
    found = replay(encounter, Fit(CARS, fitted, np.array([0, 10, 20]), states, ()))
    np.testing.assert_allclose(found.position[0, 5], [4.0, 0.0])
    assert (found.position[0, 10:] == [8.0, 0.0]).all() and not found.speed[0, 10:].any()
    np.testing.assert_allclose(found.position[1, [0, 10]], [[50, 0], [50, 0.2]], atol=1e-9)


def alone(scenario, n):
    """The scenario of vehicle n alone."""
    fields = ("position", "heading", "speed", "acceleration", "present")
    return replace(
        scenario,
        vehicles=(scenario.vehicles[n],),
        **{name: getattr(scenario, name)[[n]] for name in fields},
    )


def test_left_out_ego_has_no_row():
    encounter = crossing()
    ones = [alone(scenario, 1) for scenario in samples(encounter, 4)]
    found = evaluate_scenarios(
        encounter, {"x": ones, "replay": [replayed(encounter)]}, changepoints=K, config=QUICK
    )
    assert found.vehicles == (CARS[1].id,)
    for figure in ("e_position", "min_distance", "min_ttc", "pet", "js_gap", "order_kept"):
        assert np.isnan(found.value("x", figure)), figure
    for figure in ("js_speed", "diversity", "min_ade", "coverage"):
        assert np.isfinite(found.value("x", figure)), figure
    assert NoteKind.ONE_VEHICLE in kinds_of(found.row("x"))
