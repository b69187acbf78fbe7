# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The estimator: parameters in X's units, predictions, warnings, scikit-learn's checks."""

import json
import subprocess
import sys

import numpy as np
import pytest
from scipy import stats
from support.source_files import ROOT

from scenario_gen.method.segmentation import SegmentationWarning, StickyHDPHMM

pytestmark = pytest.mark.filterwarnings(
    "ignore::scenario_gen.method.segmentation.SegmentationWarning"
)
QUICK = {"chains": 2, "sweeps": 60, "random_state": 1}
TRUE_MEANS = np.array([[0.0, 0.0], [400.0, -0.3]])
TRUE_COVARIANCES = np.array([[[900.0, 1.2], [1.2, 0.0064]], [[2500.0, -1.0], [-1.0, 0.0016]]])


def drawn(seed, rows=((0, 150), (1, 150), (0, 100), (1, 200))):
    """Two states with other covariances, channels of far-apart units."""
    rng = np.random.default_rng(seed)
    labels = np.repeat([k for k, _ in rows], [n for _, n in rows])
    x = np.array([rng.multivariate_normal(TRUE_MEANS[k], TRUE_COVARIANCES[k]) for k in labels])
    return x, labels


@pytest.fixture(scope="module")
def fitted():
    x, labels = drawn(3)
    return StickyHDPHMM(**QUICK).fit(x), x, labels


@pytest.mark.parametrize(
    "bad", [{"sweeps": 1}, {"emission": "poisson"}, {"random_state": -1}, {"random_state": 0.5}]
)
def test_fit_refuses_bad_parameters(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        StickyHDPHMM(**bad).fit(drawn(0)[0])


def test_states_have_their_moments(fitted):
    model, x, labels = fitted
    assert model.n_states_ == 2
    assert model.n_features_in_ == 2
    assert np.mean(model.labels_ != labels) < 0.01
    assert np.abs(model.changepoints_ - [150, 300, 400]).max() <= 1
    for k in range(2):
        own = x[labels == k]
        unit = np.sqrt(np.diag(TRUE_COVARIANCES[k]))
        np.testing.assert_allclose((model.means_[k] - own.mean(axis=0)) / unit, 0.0, atol=0.02)
        np.testing.assert_allclose(
            (model.covariances_[k] - np.cov(own.T)) / np.outer(unit, unit), 0.0, atol=0.05
        )
    np.testing.assert_allclose(model.transitions_.sum(axis=1), 1.0)
    np.testing.assert_allclose(np.diag(model.transitions_), [248 / 250, 349 / 350], atol=0.01)
    assert model.startprob_[0] > 0.5
    assert model.startprob_.sum() == pytest.approx(1.0)
    assert model.dof_ == np.inf
    assert model.converged_ == (max(model.r_hat_.values()) <= 1.1)
    assert set(model.r_hat_) == {"log_joint", "occupied", "gamma", "alpha_kappa", "rho"}


def test_scores_are_those_of_hmm(fitted):
    """Against every path of states, written out, with scipy's densities."""
    model, x, _ = fitted
    few = x[147:153]
    density = np.array(
        [
            stats.multivariate_normal(m, c).pdf(few)
            for m, c in zip(model.means_, model.covariances_, strict=True)
        ]
    ).T
    paths = np.array(np.meshgrid(*[[0, 1]] * len(few), indexing="ij")).reshape(len(few), -1).T
    joint = model.startprob_[paths[:, 0]] * density[0, paths[:, 0]]
    for t in range(1, len(few)):
        joint = joint * model.transitions_[paths[:, t - 1], paths[:, t]] * density[t, paths[:, t]]
    assert model.score(few) * len(few) == pytest.approx(np.log(joint.sum()), rel=1e-9)
    expected = (
        np.array([[joint[paths[:, t] == k].sum() for k in range(2)] for t in range(len(few))])
        / joint.sum()
    )
    assert model.posterior_.weight == pytest.approx(1.0)
    np.testing.assert_allclose(model.predict_proba(few), expected, atol=1e-9)


def test_sequences_are_lists_or_lengths(fitted):
    _, x, _ = fitted
    a = StickyHDPHMM(**QUICK).fit([x[:250], x[250:]])
    b = StickyHDPHMM(**QUICK).fit(x, [250, 350])
    np.testing.assert_array_equal(a.labels_, b.labels_)
    np.testing.assert_array_equal(a.means_, b.means_)
    assert 250 not in a.changepoints_
    assert a.predict([x[:20], x[300:305]]).shape == (25,)
    apart = [a.predict_proba(part) for part in (x[:20], x[300:305])]
    np.testing.assert_allclose(a.predict_proba([x[:20], x[300:305]]), np.vstack(apart))


@pytest.mark.parametrize(
    ("data", "lengths", "said"),
    [
        (np.zeros((10, 2)), [5, 4], "add up to 10"),
        (np.zeros((10, 2)), [12, -2], "whole numbers"),
        (np.zeros((10, 2)), [5.0, 5.0], "whole numbers"),
        ([np.zeros((5, 2)), np.zeros((5, 3))], None, "differ in their channels"),
        ([np.zeros((5, 2))], [5], "not needed"),
        (np.full((10, 2), np.inf), None, "holds NaN or inf: inf at sample 0, channel 0"),
        (np.full((10, 2), np.nan), None, "holds NaN or inf: nan at sample 0, channel 0"),
        (np.zeros(10), None, "Reshape your data"),
        (np.zeros((3, 2)), None, "n_samples = 3"),
    ],
)
def test_fit_refuses_bad_data(data, lengths, said):
    with pytest.raises(ValueError, match=said):
        StickyHDPHMM(**QUICK).fit(data, lengths)


@pytest.mark.parametrize("lost", [0, 333])
def test_single_outlier_hides_nothing(fitted, lost):
    model, x, labels = fitted
    holed = x.copy()
    holed[lost] = 1e9
    with pytest.warns(SegmentationWarning, match="2 values far from their neighbours"):
        found = StickyHDPHMM(**QUICK).fit(holed)
    assert np.mean(found.labels_ != labels) < 0.01
    np.testing.assert_allclose(found.means_, model.means_, rtol=0.05, atol=0.5)
    assert np.mean(found.predict(holed) != labels) < 0.01


def test_left_out_channels_are_named(fitted):
    _, x, _ = fitted
    wide = np.column_stack([x, 2.0 * x[:, 0] - 100.0 * x[:, 1] + 7.0, np.full(len(x), 3.0)])
    left = r"left out: 2 \(follows from those before it\), 3 \(does not vary\)"
    with pytest.warns(SegmentationWarning, match=left):
        model = StickyHDPHMM(**QUICK).fit(wide)
    for k in range(2):
        a, b = model.means_[k, :2]
        np.testing.assert_allclose(
            model.means_[k, 2], 2.0 * a - 100.0 * b + 7.0, rtol=1e-6, atol=1e-3
        )
        turn = np.array([2.0, -100.0])
        np.testing.assert_allclose(
            model.covariances_[k, 2, 2], turn @ model.covariances_[k, :2, :2] @ turn, rtol=1e-6
        )
    np.testing.assert_allclose(model.means_[:, 3], 3.0)
    np.testing.assert_allclose(model.covariances_[:, 3, 3], 0.0, atol=1e-20)
    assert np.mean(model.predict(wide) != model.labels_) < 0.01
    plain = StickyHDPHMM(**QUICK).fit(x)
    assert model.score(wide) == pytest.approx(plain.score(x), abs=1e-3)


def test_autoregressive_states_in_units():
    rng = np.random.default_rng(2)
    labels = np.repeat([0, 1, 0], 300)
    regressions = np.array([[[0.9, 0.05], [0.0, 0.9]], [[-0.7, 0.0], [0.1, -0.7]]])
    unit, offset = np.array([100.0, 0.01]), np.array([5000.0, 1.0])
    y = np.zeros((900, 2))
    for t in range(1, 900):
        y[t] = regressions[labels[t]] @ y[t - 1] + rng.normal(size=2)
    x = y * unit + offset
    x[450, 0] = 1e9
    model = StickyHDPHMM(emission="autoregressive", **QUICK).fit(x)
    assert np.mean(model.labels_ != labels) < 0.02
    for k in range(2):
        np.testing.assert_allclose(
            model.coefficients_[k][:, 1:] * unit / unit[:, None], regressions[k], atol=0.15
        )
        np.testing.assert_allclose(
            model.covariances_[k] / np.outer(unit, unit), np.eye(2), atol=0.3
        )
    assert np.mean(model.predict(x) != model.labels_) < 0.02
    two = x[10:14]
    rest = [
        [
            stats.multivariate_normal(b[:, 0] + b[:, 1:] @ two[t - 1], c).pdf(two[t])
            for t in (1, 2, 3)
        ]
        for b, c in zip(model.coefficients_, model.covariances_, strict=True)
    ]
    ahead, total = model.startprob_, 0.0
    for t in range(3):
        ahead = ahead @ model.transitions_ * np.array(rest)[:, t]
        total += np.log(ahead.sum())
        ahead = ahead / ahead.sum()
    assert model.score(two) * 4 == pytest.approx(total)
    with pytest.raises(ValueError, match="needs 3 or more"):
        model.predict(x[:2])


def test_disagreeing_chains_are_warned_of():
    x = np.random.default_rng(0).normal(size=(120, 1)).cumsum(axis=0)
    with pytest.warns(SegmentationWarning) as told:
        model = StickyHDPHMM(states=2, chains=4, sweeps=12, r_hat=1.001, random_state=0).fit(x)
    messages = [str(each.message) for each in told]
    assert not model.converged_
    assert any(
        "R-hat is above 1.001" in message and "raise `sweeps`" in message for message in messages
    )
    assert any(
        "all L = 2 states" in message and "raise `states`" in message for message in messages
    )


@pytest.mark.long  # 8 s to import arviz
def test_to_arviz_has_every_chain(fitted):
    arviz = pytest.importorskip("arviz", reason="arviz is not installed")
    model, x, _ = fitted
    posterior = model.to_arviz().posterior
    draws = len(model.posterior_.trace[0])
    assert dict(posterior.sizes) == {"chain": 2, "draw": draws, "time": len(x)}
    np.testing.assert_array_equal(posterior["rho"].values[1], model.posterior_.trace[1][:, 4])
    rows = posterior["labels"].values.reshape(-1, len(x))
    np.testing.assert_array_equal(rows[(rows >= 0).all(axis=1)], model.posterior_.samples)
    assert float(arviz.ess(posterior["log_joint"].values)) > 0.0


def test_scikit_learns_checks():
    """All checks pass but one: the second argument of `fit` is `lengths`, as in hmmlearn."""
    checks = pytest.importorskip(
        "sklearn.utils.estimator_checks", reason="scikit-learn is not installed"
    )
    leave = {"check_fit_score_takes_y": "the second argument is `lengths`; `y` is ignored"}
    small = StickyHDPHMM(chains=1, sweeps=20)
    ran = checks.check_estimator(small, expected_failed_checks=leave, on_fail=None, on_skip=None)
    failed = {each["check_name"]: each["exception"] for each in ran if each["status"] == "failed"}
    assert not failed
    assert [each["check_name"] for each in ran if each["status"] == "xfail"] == list(leave)
    assert len(ran) > 30


def test_the_segmentation_loads_few_libraries():
    command = [sys.executable, "-W", "ignore", ROOT / "test" / "packaging" / "segmentation_use.py"]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    allowed = {"filelock", "numpy", "scipy", "numba", "llvmlite", "threadpoolctl", "scenario_gen"}
    # where they are installed, numba and numpy.f2py take these along
    allowed |= {"cffi", "charset_normalizer", "coverage", "pycparser", "yaml"}
    assert set(json.loads(ran.stdout)["loaded"]) <= allowed
