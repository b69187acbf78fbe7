# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sticky HDP-HMM as an estimator in scikit-learn's manner; scikit-learn itself is not needed."""

from collections.abc import Iterator
from contextlib import contextmanager
import inspect
from typing import Any, Self
import warnings

import numpy as np
import numpy.typing as npt

from scenario_gen.base.errors import InputError
from scenario_gen.method.segmentation.estimates import (
    estimate,
    hidden_channels,
    mean_transitions,
    regressed,
    whitened,
)
from scenario_gen.method.segmentation.hdp_hmm.chain import TRACE
from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.smoother import log_densities, smooth
from scenario_gen.method.segmentation.series import (
    segment_visible,
    usual_distances,
    without_outliers,
)
from scenario_gen.numerics import Floats, Ints

Data = Any  # an array (T, D) or what becomes one, or a list of them

DEFAULT = SamplerConfig()
LEAST_SAMPLES = 4
USUAL_R_HAT = 1.1  # asked for where `r_hat` = 1 has all sweeps run


class SegmentationWarning(UserWarning):
    """A fit that should be looked at before it is believed."""


class EstimatorError(InputError, ValueError):
    """Data or a parameter that cannot be used; also a ValueError, as scikit-learn's users expect."""


@contextmanager
def as_value_error() -> Iterator[None]:
    """Turn an InputError into an EstimatorError.

    Raises:
        EstimatorError: the block raised an InputError.
    """
    try:
        yield
    except InputError as error:
        raise EstimatorError(str(error)) from None


class NotFittedError(ValueError, AttributeError):
    """Asked for what only `fit` finds; where scikit-learn is installed, its own NotFittedError is raised."""


class StickyHDPHMM:
    """Segments sequences into states that recur, how many of them unknown (Fox, Sudderth, Jordan, Willsky 2011).

    A parameter is a field of `SamplerConfig`, which says what it means.

    Attributes:
        labels_: (T,) state of each sample, 0 .. K - 1 in order of first appearance; several sequences stand one after the other.
        changepoints_: samples, counted over all sequences, whose state differs from the one before; a sequence's start is none.
        changepoint_probability_: (T,) posterior probability of a changepoint at each sample.
        n_states_: K.
        n_features_in_: D.
        means_: (K, D) mean of each state's samples, in X's units.
        covariances_: (K, D, D) Σ of each state's noise. Under Student-t noise it is the scale matrix, of which the
            covariance is `dof_` / (`dof_` - 2) times.
        coefficients_: (K, D, P) regression on z = 1, or (1, x of one sample before, x of two before, ...).
        transitions_: (K, K) probability of the next sample's state.
        startprob_: (K,) probability of a sequence's first state.
        dof_: degrees of freedom of the noise; inf: Gaussian.
        r_hat_: split R̂ of each trace, by its name.
        converged_: whether every R̂ is as low as was asked for.
        posterior_: all that was sampled.
    """

    states: int
    random_state: int | None

    def __init__(
        self,
        *,
        emission: str = DEFAULT.emission,
        order: int = DEFAULT.order,
        states: int = DEFAULT.states,
        chains: int = DEFAULT.chains,
        sweeps: int = DEFAULT.sweeps,
        r_hat: float = DEFAULT.r_hat,
        moves: int = DEFAULT.moves,
        dof: float = DEFAULT.dof,
        mean_weight: float = DEFAULT.mean_weight,
        weight: float = DEFAULT.weight,
        gamma_shape: float = DEFAULT.gamma_shape,
        gamma_rate: float = DEFAULT.gamma_rate,
        alpha_kappa_shape: float = DEFAULT.alpha_kappa_shape,
        alpha_kappa_rate: float = DEFAULT.alpha_kappa_rate,
        rho_a: float = DEFAULT.rho_a,
        rho_b: float = DEFAULT.rho_b,
        random_state: int | None = None,
    ) -> None:
        """Take the parameters of `SamplerConfig` and a seed (None: another one at every fit); `fit` checks them."""
        vars(self).update({name: value for name, value in locals().items() if name != "self"})

    def fit(self, X: Data, lengths: npt.ArrayLike | None = None, y: object = None) -> Self:
        """Sample the segmentations of X, and estimate each state's parameters from them.

        Args:
            X: (T, D), or a list of sequences (T_i, D); NaN where nothing was measured.
            lengths: where X is one array of several sequences, how long each is. An array with an entry per sample is taken
                for a target, which pipelines pass in this place, and ignored.
            y: ignored, as scikit-learn has it.

        Warns:
            SegmentationWarning: chains disagree, all states were in use, channels are left out, or outliers are hidden.

        Raises:
            EstimatorError: fewer than 4 samples, an infinite value, or a parameter out of its range.
        """
        x, ends = stacked(X, lengths)
        config = self._config()
        if len(x) < LEAST_SAMPLES:
            raise EstimatorError(
                f"X has n_samples = {len(x)}; at least {LEAST_SAMPLES} are needed"
            )
        seed = (
            int(np.random.default_rng().integers(2**62))
            if self.random_state is None
            else int(self.random_state)
        )
        self._usual = usual_distances(x, ends)
        visible = without_outliers(x, self._usual, ends)
        with as_value_error():
            posterior = segment_visible(visible, config, seed, ends, np.zeros(x.shape[1]))
        self.posterior_ = posterior
        self.n_features_in_ = x.shape[1]
        emissions = estimate(visible, ends, posterior, config)
        self.labels_ = posterior.labels.copy()
        self.changepoints_ = posterior.changepoints
        self.changepoint_probability_ = posterior.probability.copy()
        self.n_states_ = int(self.labels_.max()) + 1
        self.means_, self.covariances_, self.coefficients_ = emissions
        self.transitions_, self.startprob_ = mean_transitions(posterior, self.n_states_)
        self.dof_ = posterior.dof or np.inf
        self.r_hat_ = dict(zip(TRACE, posterior.r_hat.tolist(), strict=True))
        requested = config.r_hat if config.r_hat > 1.0 else USUAL_R_HAT
        self.converged_ = max(self.r_hat_.values()) <= requested
        for concern in self._concerns(x, visible, requested):
            warnings.warn(concern, SegmentationWarning, stacklevel=2)
        return self

    def fit_predict(self, X: Data, lengths: npt.ArrayLike | None = None, y: object = None) -> Ints:
        """Fit, and return the labels (T,); see `fit`."""
        return self.fit(X, lengths).labels_

    def predict(self, X: Data, lengths: npt.ArrayLike | None = None) -> Ints:
        """(T,) the most probable state of each sample given all of its sequence, that is the largest of `predict_proba`."""
        labels: Ints = self.predict_proba(X, lengths).argmax(axis=1).astype(np.int64)
        return labels

    def predict_proba(self, X: Data, lengths: npt.ArrayLike | None = None) -> Floats:
        """(T, K) posterior probability of each state, by forward-backward smoothing under the estimated parameters.

        A sample counts for `posterior_.weight`, as in the fit; what is NaN, or lies as far out as what the fit hid, is
        integrated out.

        Raises:
            EstimatorError: as `fit`, or another number of channels than in the fit.
        """
        return self._smooth(X, lengths, None)[0]

    def score(self, X: Data, lengths: npt.ArrayLike | None = None, y: object = None) -> float:
        """Mean log-likelihood of a sample under the estimated parameters, states integrated out; channels left out do not count.

        Samples count in full, as in a density they must, whatever they counted for in the fit.

        Raises:
            EstimatorError: as `predict_proba`.
        """
        proba, total = self._smooth(X, lengths, 1.0)
        return total / len(proba)

    def to_arviz(self) -> Any:
        """Return arviz.InferenceData: per chain and draw the five traces and the labels (-1: of a chain that was left out).

        Raises:
            ImportError: arviz is not installed.
        """
        self._check_fitted()
        try:
            import arviz
        except ImportError:
            raise ImportError(
                "to_arviz needs arviz, which is not installed: pip install arviz"
            ) from None
        posterior = self.posterior_
        draws = np.array(
            posterior.trace
            if posterior.trace
            else np.zeros((1, len(posterior.samples), len(TRACE)))
        )
        labels = np.full((len(draws), draws.shape[1], len(posterior.labels)), -1, np.int64)
        for chain in np.unique(posterior.chain):
            labels[chain] = posterior.samples[posterior.chain == chain]
        groups: dict[str, Any] = {
            "posterior": {
                **{name: draws[:, :, i] for i, name in enumerate(TRACE)},
                "labels": labels,
            }
        }
        options: dict[str, Any] = {
            "dims": {"labels": ["time"]},
            "coords": {"time": np.arange(len(posterior.labels))},
        }
        if int(arviz.__version__.split(".")[0]) > 0:  # from 1.0 on the groups are one argument
            return arviz.from_dict(groups, **options)
        return arviz.from_dict(**groups, **options)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the parameters by name."""
        return {name: getattr(self, name) for name in _parameters()}

    def set_params(self, **params: Any) -> Self:
        """Set parameters by name.

        Raises:
            EstimatorError: there is no parameter of that name.
        """
        for name, value in params.items():
            if name not in _parameters():
                raise EstimatorError(
                    f"StickyHDPHMM has no parameter {name!r}; it has {', '.join(_parameters())}"
                )
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        changed = {
            n: v
            for n, v in self.get_params().items()
            if v is not _parameters()[n] and v != _parameters()[n]
        }
        return f"StickyHDPHMM({', '.join(f'{name}={value!r}' for name, value in changed.items())})"

    def __sklearn_tags__(self) -> Any:
        """Return what scikit-learn asks its estimators: NaN is allowed, and no fit equals the one before."""
        from sklearn.utils import InputTags, Tags, TargetTags

        return Tags(
            "density_estimator", TargetTags(required=False), input_tags=InputTags(allow_nan=True)
        )

    def _config(self) -> SamplerConfig:
        """Check the parameters."""
        values = self.get_params()
        seed = values.pop("random_state")
        if seed is not None and (
            isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0
        ):
            raise EstimatorError(
                f"random_state is {seed!r}; it must be a whole number >= 0, or None"
            )
        plain = {
            name: value.item() if isinstance(value, np.generic) else value
            for name, value in values.items()
        }
        with as_value_error():
            return SamplerConfig(**plain)

    def _check_fitted(self) -> None:
        if not hasattr(self, "posterior_"):
            try:
                from sklearn.exceptions import NotFittedError as NotFitted
            except ImportError:
                NotFitted = NotFittedError
            raise NotFitted("This StickyHDPHMM instance is not fitted yet: call fit first")

    def _smooth(
        self, X: Data, lengths: npt.ArrayLike | None, weight: float | None
    ) -> tuple[Floats, float]:
        """(T, K) smoothed probabilities and the log-likelihood, samples counting for `weight` (None: as in the fit)."""
        self._check_fitted()
        x, ends = stacked(X, lengths)
        if x.shape[1] != self.n_features_in_:
            raise EstimatorError(
                f"X has {x.shape[1]} features, but StickyHDPHMM is expecting {self.n_features_in_} features as input"
            )
        used = self.posterior_.channels
        absent = np.isnan(self.means_).all(axis=0)
        visible = np.where(absent, 0.0, without_outliers(x, self._usual, ends))
        with as_value_error():
            problem, rows = regressed(visible, ends, self._config())
        hidden = hidden_channels(problem)[:, used]
        v = np.hstack(
            [problem.v[:, : problem.regressors], problem.v[:, problem.regressors + used]]
        )
        density = np.zeros((len(rows), self.n_states_))
        if len(used):
            states = zip(self.coefficients_, self.covariances_, strict=True)
            coef = np.stack(
                [whitened(a[used], covariance[np.ix_(used, used)]) for a, covariance in states]
            )
            counts = self.posterior_.weight if weight is None else weight
            log_densities(v, hidden, coef, counts, self.posterior_.dof, density)
        every = np.zeros((len(x), self.n_states_))
        every[rows] = density
        proba = np.empty_like(every)
        total = smooth(every, self.transitions_, self.startprob_, ends, proba, np.empty(len(x)))
        return proba, total

    def _concerns(self, x: Floats, visible: Floats, requested: float) -> list[str]:
        """What a user should know of the fit."""
        concerns = []
        if not self.converged_:
            far = ", ".join(
                f"{name} {value:.2f}" for name, value in self.r_hat_.items() if value > requested
            )
            ran, chains = len(self.posterior_.trace[0]) * 2, len(self.posterior_.trace)
            concerns.append(
                f"R-hat is above {requested:g} after {ran} sweeps of {chains} chain(s): {far}. What was sampled "
                "depends on where it began: raise `sweeps`, and compare the chains (`to_arviz`)"
            )
        if self.posterior_.full:
            concerns.append(
                f"all L = {self.posterior_.states} states were in use in more than a few samples: more may be needed; "
                + (
                    "raise `states`, or set it to 0"
                    if self.states
                    else "the series may have no states that recur"
                )
            )
        left = sorted(set(range(x.shape[1])) - set(self.posterior_.channels.tolist()))
        if left:
            concerns.append(
                "channels that say nothing of their own are left out: "
                + ", ".join(f"{i} ({why(x[:, i])})" for i in left)
            )
        hidden = np.argwhere(np.isnan(visible) & ~np.isnan(x))
        if len(hidden):
            at = ", ".join(f"sample {t} of channel {i}" for t, i in hidden[:3]) + (
                ", ..." if len(hidden) > 3 else ""
            )
            concerns.append(
                f"{len(hidden)} values far from those before and after them are taken for not measured: {at}"
            )
        return concerns


def _parameters() -> dict[str, Any]:
    """Names and defaults of the estimator's parameters."""
    signature = inspect.signature(StickyHDPHMM.__init__)
    return {name: value.default for name, value in signature.parameters.items() if name != "self"}


def why(column: Floats) -> str:
    """Say why a channel (T,) was left out."""
    seen = column[~np.isnan(column)]
    if len(seen) < 2:
        return "not measured"
    return (
        "does not vary"
        if np.ptp(seen) <= 1e-9 * np.abs(seen).max()
        else "follows from those before it"
    )


def stacked(X: Data, lengths: npt.ArrayLike | None) -> tuple[Floats, Ints]:
    """Return the sequences one after the other (T, D), and the index one past the last sample of each.

    Raises:
        EstimatorError: X is not (T, D) nor a list of (T_i, D), or the lengths do not add up to T.
    """
    if hasattr(X, "toarray"):
        raise TypeError("X is a sparse matrix; a dense array is needed: X.toarray()")
    if isinstance(X, list | tuple) and len(X) and np.ndim(X[0]) == 2:
        if lengths is not None:
            raise EstimatorError("X is a list of sequences, so `lengths` is not needed")
        parts = [matrix(part) for part in X]
        if len({part.shape[1] for part in parts}) > 1:
            raise EstimatorError(
                f"the sequences differ in their channels: {[part.shape[1] for part in parts]}"
            )
        return np.vstack(parts), np.cumsum([len(part) for part in parts])
    x = matrix(X)
    sizes = np.array([len(x)]) if lengths is None else np.asarray(lengths)
    if sizes.shape[:1] == (len(x),) and not (
        sizes.ndim == 1 and np.array_equal(sizes, np.ones(len(x)))
    ):
        sizes = np.array([len(x)])  # as long as X: no lengths, but a target
    if (
        sizes.ndim != 1
        or sizes.dtype.kind not in "iu"
        or (sizes < 1).any()
        or sizes.sum() != len(x)
    ):
        raise EstimatorError(
            f"lengths must be whole numbers >= 1 that add up to {len(x)} samples; they are {sizes.tolist()}"
        )
    return x, np.cumsum(sizes).astype(np.int64)


def matrix(X: npt.ArrayLike) -> Floats:
    """Return X as an array (T, D).

    Raises:
        EstimatorError: it has another shape, or a value is complex or infinite.
    """
    values = np.asarray(X)
    if values.dtype.kind == "c":
        raise EstimatorError(f"Complex data not supported: an array of shape {values.shape}")
    x = values.astype(np.float64)
    if x.ndim != 2:
        raise EstimatorError(
            f"X must be 2D (samples, channels), not of shape {x.shape}. Reshape your data, e.g. X.reshape(-1, 1)"
        )
    if x.shape[1] == 0:
        raise EstimatorError(
            f"found 0 feature(s) (shape={x.shape}) while a minimum of 1 is required."
        )
    if np.isinf(x).any():
        row, column = np.argwhere(np.isinf(x))[0]
        raise EstimatorError(
            f"X holds {x[row, column]} at sample {row}, channel {column}; put NaN where nothing was measured"
        )
    return x
