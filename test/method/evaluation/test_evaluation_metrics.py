# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Each metric against a hand-computed case and, where there is one, a library."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy import stats
from scipy.spatial.distance import jensenshannon
from support.evaluation_worlds import CARS, crossing, samples

from benchmarks._feature_matrix import feature_matrix, pair_similarities
from scenario_gen.method.evaluation import evaluate_scenarios, similarity
from scenario_gen.method.evaluation.distributions import (
    Bootstrap,
    compare,
    jensen_shannon,
    QUANTITIES,
    values_of,
    wilson,
)
from scenario_gen.method.evaluation.measures import distance_and_ttc, footprint_distance
from scenario_gen.types import Motion, Vehicle

ONCE = np.ones((1, 1))


def still(xy, yaw, sizes=((4.0, 2.0), (4.0, 2.0)), speed=(0.0, 0.0)):
    vehicles = tuple(Vehicle(str(n), *size) for n, size in enumerate(sizes))
    position = np.array(xy, float)[:, None]
    heading = np.array(yaw, float)[:, None]
    pace = np.array(speed, float)[:, None]
    return Motion.sampled(vehicles, 0.1, position, heading, pace)


def time_to_collision(motion, a, b):
    return distance_and_ttc(motion, a, b)[1]


def test_time_to_collision_by_hand():
    head_on = still(
        [(0, 0), (24, 0)], (0, np.pi), speed=(5.0, 5.0)
    )  # 20 m between bumpers, closing at 10 m/s
    assert time_to_collision(head_on, 0, 1) == pytest.approx(2.0)
    passing = still(
        [(0, 0), (24, 2.5)], (0, np.pi), speed=(5.0, 5.0)
    )  # half a metre beside each other
    assert np.isinf(time_to_collision(passing, 0, 1))
    abreast = still(
        [(0, 0), (6, 0)], (0, 0), speed=(0.5, np.nextafter(0.5, 0))
    )  # differ by rounding alone
    assert np.isinf(time_to_collision(abreast, 0, 1))
    parting = still([(0, 0), (24, 0)], (np.pi, 0), speed=(5.0, 5.0))
    assert np.isinf(time_to_collision(parting, 0, 1))
    assert time_to_collision(still([(0, 0), (1, 0)], (0, 0)), 0, 1) == 0.0  # they overlap now


@settings(max_examples=25)
@given(
    *[st.tuples(st.floats(-b, b), st.floats(-b, b)) for b in (20, 3)],
    st.tuples(st.floats(0.5, 12), st.floats(0.5, 12)),
)
def test_footprints_touch_at_ttc(place, yaws, speeds):
    motion = still([(0, 0), place], yaws, speed=speeds)
    found = float(time_to_collision(motion, 0, 1)[0])
    way = np.stack([np.cos(motion.heading), np.sin(motion.heading)], -1) * motion.speed[..., None]

    def distance(t):
        moved = Motion.sampled(
            motion.vehicles, 0.1, motion.position + t * way, motion.heading, motion.speed
        )
        return footprint_distance(moved, 0, 1)[0]

    if np.isinf(found):
        assert all(distance(t) >= 0.0 for t in np.linspace(0, 5, 11))
        assert not any(
            distance(t) == 0.0 and distance(t + 0.01) == 0.0 for t in np.linspace(0, 10, 41)
        )
    else:
        assert distance(found) < 1e-6
        assert all(distance(share * found) > 0.0 for share in (0.0, 0.3, 0.6, 0.9)) or found == 0.0


def test_values_by_hand():
    time = np.arange(31) * 0.1
    speed = np.stack([2.0 + time**2, 5.0 + 0.0 * time])  # acceleration 2t, jerk 2
    motion = Motion.sampled(
        CARS,
        0.1,
        np.broadcast_to([[[0.0, 0.0]], [[10.0, 0.0]]], (2, 31, 2)),
        np.stack([0.3 * time, 0 * time]),
        speed,
    )
    values = values_of(motion)
    np.testing.assert_allclose(values["acceleration"].reshape(2, 31)[0, 1:-1], 2.0 * time[1:-1])
    jerk = values["jerk"].reshape(2, -1)
    assert jerk.shape[1] == 31 - 5  # of means over 0.5 s
    np.testing.assert_allclose(jerk[0, 1:-1], 2.0)
    assert not jerk[1].any()
    np.testing.assert_allclose(values["yaw_rate"].reshape(2, 31)[0], 0.3)
    assert values["gap"][0] == pytest.approx(6.0)


def test_jensen_shannon_equals_scipy():
    assert jensen_shannon(np.array([1.0, 0.0]), np.array([0.0, 1.0])) == pytest.approx(1.0)
    assert jensen_shannon(np.array([2.0, 2.0]), np.array([5.0, 5.0])) == 0.0
    rng = np.random.default_rng(0)
    p, q = rng.integers(0, 9, 20).astype(float), rng.integers(0, 9, 20).astype(float)
    assert jensen_shannon(p, q) == pytest.approx(jensenshannon(p, q, base=2) ** 2)


def test_comparison_of_one_quantity():
    rng = np.random.default_rng(1)
    template, drawn = rng.normal(0, 2, 400), [rng.normal(0.5, 2, 300) for _ in range(6)]
    found = compare(QUANTITIES[0], template, drawn)
    every = np.ones((1, 6))
    assert found.template.sum() == 400 and found.samples.sum() == 1800
    assert found.wasserstein == pytest.approx(
        stats.wasserstein_distance(np.concatenate(drawn), template)
    )
    assert found.wasserstein_near(every)[0] == pytest.approx(found.wasserstein, abs=0.01)
    edges = np.arange(-30, 31) * QUANTITIES[0].bin_width
    p, q = np.histogram(np.concatenate(drawn), edges)[0], np.histogram(template, edges)[0]
    assert found.jensen_shannon(every)[0] == pytest.approx(jensenshannon(p, q, base=2) ** 2)
    assert found.coverage(every)[0] == pytest.approx(q[p > 0].sum() / q.sum())
    shifted = compare(QUANTITIES[0], template, [template + 3.0])
    assert shifted.wasserstein_near(ONCE)[0] == pytest.approx(3.0, abs=0.01)


def test_errors_are_those_of_mean_matrix():
    template = crossing().with_samples(60)
    motions = [scenario.with_samples(60) for scenario in samples(crossing(), 7)]
    position = np.stack([motion.position for motion in motions])
    pairs = pair_similarities(template.position, position, "euclidean")
    target = feature_matrix(*template.position)
    for weights in (np.ones(7), np.array([3.0, 0, 0, 1, 0, 2, 1])):
        mean = np.average(
            [feature_matrix(*motion.position) for motion in motions], axis=0, weights=weights
        )
        expected = np.linalg.norm(mean - target) / np.linalg.norm(target)
        assert similarity.mean_error(pairs, weights[None])[0] == pytest.approx(expected, rel=1e-9)
        assert similarity.mean_correlation(pairs, weights[None])[0] == pytest.approx(
            np.corrcoef(mean.ravel(), target.ravel())[0, 1]
        )


def test_constant_matrix_is_left_out():
    speed = np.stack([np.zeros(9), np.zeros(9), np.linspace(0, 5, 9)])[
        ..., None
    ]  # two stand, one drives off
    pairs = pair_similarities(
        speed, np.stack([speed * 1.1 + 0.1 * np.linspace(0, 1, 9)[:, None]]), "manhattan"
    )
    errors = [pair.error(ONCE)[0] for pair in pairs]
    assert math.isnan(errors[0]) and np.isfinite(errors[1:]).all()
    assert similarity.mean_error(pairs, ONCE)[0] == pytest.approx(np.mean(errors[1:]))


def test_diversity_by_hand():
    position = np.zeros((3, 1, 4, 2))
    position[1, ..., 0], position[2, ..., 1] = 3.0, 4.0  # samples at (0, 0), (3, 0), (0, 4)
    counted = np.ones((1, 4), dtype=np.bool_)
    table = similarity.displacements(position, counted)
    assert similarity.diversity(table, np.ones((1, 3)))[0] == pytest.approx(
        (3.0 + 4.0 + 5.0) / 3.0
    )
    assert similarity.diversity(table, np.array([[2.0, 1.0, 0.0]]))[0] == pytest.approx(3.0)
    assert math.isnan(similarity.diversity(np.zeros((1, 1)), ONCE)[0])
    error = similarity.displacement_to(position, position[0], counted)
    assert error.tolist() == [0.0, 3.0, 4.0]
    assert similarity.weighted_min(error, np.array([[0.0, 1.0, 1.0]]))[0] == 3.0


def test_mean_interval_agrees_with_scipy():
    values = np.random.default_rng(5).exponential(2.0, 80)
    ours = Bootstrap.draw(np.arange(80), 4000, 0.95, 1).mean(values)
    theirs = stats.bootstrap(
        (values,), np.mean, n_resamples=4000, method="percentile", random_state=1
    ).confidence_interval
    assert ours.value == pytest.approx(values.mean())
    width = theirs.high - theirs.low
    assert ours.low == pytest.approx(theirs.low, abs=0.08 * width)
    assert ours.high == pytest.approx(theirs.high, abs=0.08 * width)


@pytest.mark.parametrize(("count", "total"), [(0, 20), (3, 50), (50, 50)])
def test_wilson_equals_scipy(count, total):
    expected = stats.binomtest(count, total).proportion_ci(0.95, "wilson")
    found = wilson(count, total, 0.95)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=1e-12)
    assert math.isnan(wilson(0, 0, 0.95).value)


def test_pooled_units_keep_error_and_interval(monkeypatch):
    """At most MAX_UNIT_COUNT units are drawn, and the value does not depend on how they are pooled."""
    encounter = crossing()
    scenarios = samples(encounter, 150)
    whole = evaluate_scenarios(encounter, {"set": scenarios}).row("set").values
    monkeypatch.setattr("scenario_gen.method.evaluation.samples.MAX_UNIT_COUNT", 40)
    pooled = evaluate_scenarios(encounter, {"set": scenarios}).row("set").values
    for name in ("e_position", "e_speed", "correlation_speed"):
        assert pooled[name].value == pytest.approx(whole[name].value, rel=1e-9)
        width, before = (one[name].high - one[name].low for one in (pooled, whole))
        assert 0.5 < width / before < 2.0, name
    assert pooled["min_ttc"] == whole["min_ttc"], "others are drawn as before"
