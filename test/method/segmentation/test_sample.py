# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sampler on series with known states, and on awkward ones."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from support.lengths import LONG

from scenario_gen.method.segmentation import SamplerConfig, StickyHDPHMM
from scenario_gen.method.segmentation.hdp_hmm.sample import (
    hide_outliers,
    sample_posterior,
    usual_distances,
)
from scenario_gen.method.segmentation.posterior import r_hat

pytestmark = pytest.mark.filterwarnings(
    "ignore::scenario_gen.method.segmentation.SegmentationWarning"
)


def posterior_of(x, seed=0, lengths=None, **parameters):
    """The posterior of a fit."""
    return StickyHDPHMM(random_state=seed, **parameters).fit(x, lengths).posterior_


def two_states(seed: int, dimensions: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Four dwells of 60 samples, two states 4 standard deviations apart."""
    rng = np.random.default_rng(seed)
    labels = np.repeat([0, 1, 0, 1], 60)
    return rng.normal(size=(240, dimensions)) + 4.0 * labels[:, None] / np.sqrt(dimensions), labels


@pytest.mark.parametrize("dimensions", [1, 24])
def test_finds_states_and_shares_them(dimensions):
    x, labels = two_states(5, dimensions)
    posterior = posterior_of(x, seed=1)
    assert np.mean(posterior.labels != labels) <= 0.02
    assert posterior.labels.max() == 1
    assert np.abs(posterior.changepoints - [60, 120, 180]).max() <= 2


def test_same_seed_gives_same_bytes():
    x, _ = two_states(6)
    a = posterior_of(x, seed=3)
    b = posterior_of(x, seed=3)
    assert a.samples.tobytes() == b.samples.tobytes()
    assert a.probability.tobytes() == b.probability.tobytes()
    assert posterior_of(x, seed=4).samples.tobytes() != a.samples.tobytes()
    np.testing.assert_array_equal(posterior_of(x * 1024.0 - 512.0, seed=3).labels, a.labels)


@pytest.mark.parametrize("tremble", [1e-7, 0.1])
def test_quiet_channel_hides_nothing(tremble):
    """Scaled to unit variance, the noise of a standing vehicle hid all other changes."""
    x, labels = two_states(8)
    still = tremble * np.random.default_rng(1).normal(size=(240, 2))
    error = np.array([0.2, 0.2, 0.2, 0.4])
    posterior = sample_posterior(
        np.column_stack([x, still]), SamplerConfig(), 0, np.array([240]), error
    )
    assert np.mean(posterior.labels != labels) <= 0.02
    assert posterior.labels.max() == 1


@settings(max_examples=200 if LONG else 12)
@given(
    st.integers(4, 40),
    st.integers(1, 8),
    st.integers(0, 1000),
    st.sampled_from(["gaussian", "autoregressive"]),
)
def test_never_nan_and_always_consistent(samples, dimensions, seed, emission):
    rng = np.random.default_rng(seed)
    x = rng.standard_t(2, size=(samples, dimensions)) * 10.0 ** rng.integers(-6, 6, dimensions)
    posterior = posterior_of(x, seed, emission=emission, sweeps=20, chains=2)
    assert posterior.labels.shape == (samples,)
    assert np.isfinite(posterior.probability).all()
    assert ((posterior.probability >= 0.0) & (posterior.probability <= 1.0)).all()
    assert set(np.unique(posterior.labels)) == set(range(posterior.labels.max() + 1))
    intervals = posterior.intervals()
    assert intervals.shape == (len(posterior.changepoints), 2)
    assert (intervals[:, 0] <= intervals[:, 1]).all()
    assert posterior.primitives().sum() == pytest.approx(1.0)


def many_states(seed: int, states: int = 6, dwell: int = 60, visits: int = 3, dimensions: int = 3):
    """States 6 standard deviations apart, each visited several times."""
    rng = np.random.default_rng(seed)
    labels = np.repeat(np.concatenate([rng.permutation(states) for _ in range(visits)]), dwell)
    means = rng.normal(size=(states, dimensions)) * 6.0
    return means[labels] + rng.normal(size=(len(labels), dimensions)), labels


def found_as_drawn(posterior, labels):
    """Each state found is one that was drawn, but for 3 % of the samples."""
    table = np.zeros((posterior.labels.max() + 1, labels.max() + 1))
    np.add.at(table, (posterior.labels, labels), 1.0)
    return posterior.labels.max() == labels.max() and table.max(axis=1).sum() >= 0.97 * len(labels)


def test_chains_agree_and_say_so():
    x, labels = many_states(1)
    posterior = posterior_of(x, seed=0)
    assert found_as_drawn(posterior, labels)
    assert posterior.r_hat.shape == (5,)
    assert posterior.r_hat.max() <= SamplerConfig().r_hat
    assert posterior.kept.all()
    unfinished = posterior_of(x, 0, sweeps=10, r_hat=1.0001)
    assert unfinished.r_hat.max() > 1.0001


def test_r_hat_of_known_traces():
    rng = np.random.default_rng(0)
    same = [rng.normal(size=(400, 5)) for _ in range(4)]
    assert np.abs(r_hat(same) - 1.0).max() < 0.02
    apart = [trace + 3.0 * k for k, trace in enumerate(same)]
    assert r_hat(apart).min() > 2.0
    constant = [np.ones((20, 5)), np.ones((20, 5))]
    np.testing.assert_array_equal(r_hat(constant), 1.0)
    assert np.isinf(r_hat([constant[0], 2.0 * constant[1]])).all()


def test_truncation_grows_until_there_is_room():
    x, _ = many_states(2, states=26, dwell=25, visits=2)
    posterior = posterior_of(x, seed=0)
    assert posterior.labels.max() + 1 >= 25
    assert posterior.states > 26
    assert not posterior.full
    few = posterior_of(x, 0, states=10)
    assert few.full
    assert few.states == 10


def test_outliers_belong_to_their_sequence():
    x = (
        np.random.default_rng(2).normal(size=(100, 1))
        + np.where(np.arange(100) < 50, 0.0, 100.0)[:, None]
    )
    x[49] = 60.0  # the last of the first sequence, on the way to the second
    for ends, hidden in (([50, 100], [49]), ([100], [])):
        usual = usual_distances(x, np.array(ends))
        assert np.flatnonzero(np.isnan(hide_outliers(x, usual, np.array(ends)))).tolist() == hidden
