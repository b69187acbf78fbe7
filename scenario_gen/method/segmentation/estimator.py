# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sticky HDP-HMM as an estimator with scikit-learn's interface, without depending on it."""

from collections.abc import Iterator
from contextlib import contextmanager
import inspect
from typing import Any, Self
import warnings

import numpy as np
import numpy.typing as npt

from scenario_gen.base.errors import InputError
from scenario_gen.method.segmentation.estimates import (
    Emissions,
    estimate,
    log_densities,
    mean_transitions,
    regressed,
)
from scenario_gen.method.segmentation.hdp_hmm.chain import TRACE
from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.hdp_hmm.sample import (
    hide_outliers,
    sample_posterior,
    usual_distances,
)
from scenario_gen.method.segmentation.hdp_hmm.smoother import smooth
from scenario_gen.numerics import Floats, Ints

Data = Any  # an array (T, D), or data that numpy converts to one, or a list of them

DEFAULT = SamplerConfig()
CONVERGED_R_HAT_RATIO = 1.1  # required where `r_hat` = 1 demands all sweeps


class SegmentationWarning(UserWarning):
    """A fit that the user should check before relying on it."""


class EstimatorError(InputError, ValueError):
    """Unusable data or parameters; also a ValueError, which scikit-learn's users expect."""


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
    """A method that needs `fit` was called before it.

    Where scikit-learn is installed, its own NotFittedError is raised.
    """


class StickyHDPHMM:
    """Segmentation into recurring states, whose number is inferred, by a sticky HDP-HMM.

    Source: Fox, Sudderth, Jordan, Willsky 2011.

    Args:
        emission: "gaussian", or "autoregressive": a vector autoregression per state.
        order: number of past samples that an autoregressive emission regresses on.
        states: weak-limit truncation L; 0: chosen from the data.
        chains: number of independent chains.
        sweeps: maximum number of Gibbs sweeps per chain.
        r_hat: split R-hat at which the chains stop; 1: all sweeps are run.
        moves: split or merge moves per sweep.
        dof: degrees of freedom of Student-t noise; 0: from the data; 1000 or more: Gaussian.
        mean_weight: prior samples that the regression of an autoregressive state is worth.
        weight: weight of a sample in (0, 1]; 0: from the data.
        gamma_shape: shape of the Gamma prior of the concentration gamma.
        gamma_rate: rate of the Gamma prior of the concentration gamma.
        alpha_kappa_shape: shape of the Gamma prior of alpha + kappa.
        alpha_kappa_rate: rate of the Gamma prior of alpha + kappa.
        rho_a: first parameter of the Beta prior of rho = kappa / (alpha + kappa).
        rho_b: second parameter of the Beta prior of rho.
        random_state: seed; None: a different one for every fit.

    Attributes:
        labels_: (T,) state of each sample, 0 .. K - 1 in order of first appearance. Several
            sequences are concatenated.
        changepoints_: indices of samples, over all sequences, whose state differs from the
            previous one; the start of a sequence is none.
        changepoint_probability_: (T,) posterior probability of a changepoint at each sample.
        n_states_: K.
        n_features_in_: D.
        means_: (K, D) mean of each state's samples, in X's units.
        covariances_: (K, D, D) covariance of each state's noise. Under Student-t noise it is the
            scale matrix; the covariance is `dof_` / (`dof_` - 2) times that.
        coefficients_: (K, D, P) regression on z = 1, or on z = (1, previous x, ...).
        transitions_: (K, K) transition probabilities.
        startprob_: (K,) probability of a sequence's first state.
        dof_: degrees of freedom of the noise; inf: Gaussian.
        r_hat_: split R-hat of each trace, by its name.
        converged_: whether every R-hat is as low as required.
        posterior_: the sampled segmentations.

    Examples:
        >>> import numpy as np
        >>> rng = np.random.default_rng(0)
        >>> X = np.concatenate([rng.normal(0, 1, (100, 2)), rng.normal(5, 1, (100, 2))])
        >>> model = StickyHDPHMM(random_state=0).fit(X)
        >>> model.n_states_
        2
        >>> model.changepoints_
        array([100])
    """

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
        """Store the parameters; `fit` validates them."""
        self.emission = emission
        self.order = order
        self.states = states
        self.chains = chains
        self.sweeps = sweeps
        self.r_hat = r_hat
        self.moves = moves
        self.dof = dof
        self.mean_weight = mean_weight
        self.weight = weight
        self.gamma_shape = gamma_shape
        self.gamma_rate = gamma_rate
        self.alpha_kappa_shape = alpha_kappa_shape
        self.alpha_kappa_rate = alpha_kappa_rate
        self.rho_a = rho_a
        self.rho_b = rho_b
        self.random_state = random_state

    def fit(self, X: Data, lengths: npt.ArrayLike | None = None, y: object = None) -> Self:
        """Sample the segmentations of X, and estimate each state's parameters from them.

        Args:
            X: (T, D), or a list of sequences (T_i, D), finite.
            lengths: length of each sequence if X concatenates several. An array with one entry
                per sample is ignored: pipelines pass targets in this position.
            y: ignored; present for API consistency.

        Returns:
            The fitted estimator.

        Warns:
            SegmentationWarning: chains disagree, all states were in use, channels are left out,
                or outliers are ignored.

        Raises:
            EstimatorError: fewer than 4 samples, NaN or infinity, or an invalid parameter.
        """
        x, ends = stacked(X, lengths)
        config = self._config()
        seed = self.random_state
        if seed is None:
            seed = int(np.random.default_rng().integers(2**62))
        with as_value_error():
            self._usual = usual_distances(x, ends)
            visible = hide_outliers(x, self._usual, ends)
            posterior = sample_posterior(visible, config, int(seed), ends, np.zeros(x.shape[1]))
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
        requested = config.r_hat if config.r_hat > 1.0 else CONVERGED_R_HAT_RATIO
        self.converged_ = max(self.r_hat_.values()) <= requested
        for concern in self._concerns(x, visible, requested):
            warnings.warn(concern, SegmentationWarning, stacklevel=2)
        return self

    def fit_predict(self, X: Data, lengths: npt.ArrayLike | None = None, y: object = None) -> Ints:
        """Fit, and return the labels (T,); see `fit`."""
        return self.fit(X, lengths).labels_

    def predict(self, X: Data, lengths: npt.ArrayLike | None = None) -> Ints:
        """Return the most probable state (T,) of each sample; see `predict_proba`."""
        labels: Ints = self.predict_proba(X, lengths).argmax(axis=1).astype(np.int64)
        return labels

    def predict_proba(self, X: Data, lengths: npt.ArrayLike | None = None) -> Floats:
        """Return the posterior probability (T, K) of each state, by forward-backward smoothing.

        The parameters are the estimated ones, and a sample has the weight `posterior_.weight`, as
        in the fit. Outliers by the rule of the fit are interpolated.

        Raises:
            EstimatorError: as `fit`, or another number of channels than in the fit.
        """
        return self._smooth(X, lengths, None)[0]

    def score(self, X: Data, lengths: npt.ArrayLike | None = None, y: object = None) -> float:
        """Return the mean log-likelihood per sample under the estimated parameters.

        States are integrated out; channels that were left out do not count. Samples have weight
        1, whatever weight they had in the fit, since the result is a density.

        Raises:
            EstimatorError: as `predict_proba`.
        """
        proba, total = self._smooth(X, lengths, 1.0)
        return total / len(proba)

    def to_arviz(self) -> Any:
        """Return arviz.InferenceData: the five traces and the labels of each chain and draw.

        Labels of chains that were left out are -1.

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
        no_draws = np.zeros((1, len(posterior.samples), len(TRACE)))
        draws = np.array(posterior.trace or no_draws)
        labels = np.full((len(draws), draws.shape[1], len(posterior.labels)), -1, np.int64)
        for chain in np.unique(posterior.chain):
            labels[chain] = posterior.samples[posterior.chain == chain]
        traces = {name: draws[:, :, i] for i, name in enumerate(TRACE)}
        groups: dict[str, Any] = {"posterior": traces | {"labels": labels}}
        options: dict[str, Any] = {
            "dims": {"labels": ["time"]},
            "coords": {"time": np.arange(len(posterior.labels))},
        }
        if int(arviz.__version__.split(".")[0]) > 0:  # from 1.0 on the groups are one argument
            return arviz.from_dict(groups, **options)
        return arviz.from_dict(**groups, **options)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the parameters of this estimator.

        Args:
            deep: ignored, since no parameter is an estimator; present for API consistency.
        """
        return {name: getattr(self, name) for name in _default_params()}

    def set_params(self, **params: Any) -> Self:
        """Set parameters of this estimator, and return it.

        Raises:
            EstimatorError: there is no parameter of that name.
        """
        known = _default_params()
        for name, value in params.items():
            if name not in known:
                raise EstimatorError(
                    f"invalid parameter {name!r} for StickyHDPHMM; valid parameters are "
                    f"{', '.join(known)}"
                )
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        defaults = _default_params()
        changed = [
            f"{name}={value!r}"
            for name, value in self.get_params().items()
            if value is not defaults[name] and value != defaults[name]
        ]
        return f"StickyHDPHMM({', '.join(changed)})"

    def __sklearn_tags__(self) -> Any:
        """Return scikit-learn's tags: a density estimator."""
        from sklearn.utils import Tags, TargetTags

        return Tags("density_estimator", TargetTags(required=False))

    def _config(self) -> SamplerConfig:
        """Validate the parameters."""
        values = self.get_params()
        seed = values.pop("random_state")
        is_whole = isinstance(seed, int | np.integer) and not isinstance(seed, bool)
        if seed is not None and not (is_whole and seed >= 0):
            raise EstimatorError(
                f"random_state is {seed!r}; it must be a whole number >= 0, or None"
            )
        for name, value in values.items():
            if isinstance(value, np.generic):
                values[name] = value.item()
        with as_value_error():
            return SamplerConfig(**values)

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
        """Return smoothed probabilities (T, K) and the log-likelihood.

        Samples have this weight; None: that of the fit.
        """
        self._check_fitted()
        x, ends = stacked(X, lengths)
        if x.shape[1] != self.n_features_in_:
            raise EstimatorError(
                f"X has {x.shape[1]} features, but StickyHDPHMM is expecting "
                f"{self.n_features_in_} features as input"
            )
        with as_value_error():
            problem, rows = regressed(hide_outliers(x, self._usual, ends), ends, self._config())
        if weight is None:
            weight = self.posterior_.weight
        emissions = Emissions(self.coefficients_, self.covariances_)
        log_density = np.zeros((len(x), self.n_states_))
        log_density[rows] = log_densities(problem, emissions, self.posterior_, weight)
        proba = np.empty_like(log_density)
        changed = np.empty(len(x))
        total = smooth(log_density, self.transitions_, self.startprob_, ends, proba, changed)
        return proba, total

    def _concerns(self, x: Floats, visible: Floats, requested: float) -> list[str]:
        """Return the warnings about the fit of x (T, D), of which `visible` was used."""
        posterior, concerns = self.posterior_, list[str]()
        if not self.converged_:
            high = [f"{name} {r:.2f}" for name, r in self.r_hat_.items() if r > requested]
            sweeps, chains = len(posterior.trace[0]) * 2, len(posterior.trace)
            concerns.append(
                f"R-hat is above {requested:g} after {sweeps} sweeps of {chains} chain(s): "
                f"{', '.join(high)}. The result depends on the starting points: raise `sweeps`, "
                "and compare the chains (`to_arviz`)"
            )
        if posterior.full:
            remedy = "the series may have no recurring states"
            if self.states:
                remedy = "raise `states`, or set it to 0"
            concerns.append(
                f"all L = {posterior.states} states were in use in more than a few samples: more "
                f"may be needed; {remedy}"
            )
        left_out = sorted(set(range(x.shape[1])) - set(posterior.channels.tolist()))
        if left_out:
            reasons = ", ".join(f"{i} ({_why_left_out(x[:, i])})" for i in left_out)
            concerns.append(f"channels without information of their own are left out: {reasons}")
        outliers = np.argwhere(np.isnan(visible))
        if len(outliers):
            places = [f"sample {t} of channel {i}" for t, i in outliers[:3]]
            places += ["..."] * (len(outliers) > 3)
            concerns.append(
                f"{len(outliers)} values far from their neighbours are interpolated: "
                f"{', '.join(places)}"
            )
        return concerns


def _default_params() -> dict[str, Any]:
    """Return the estimator's parameters and their defaults, from its signature."""
    signature = inspect.signature(StickyHDPHMM.__init__)
    return {name: value.default for name, value in signature.parameters.items() if name != "self"}


def _why_left_out(column: Floats) -> str:
    """Return why a channel (T,) was left out."""
    if np.ptp(column) <= 1e-9 * np.abs(column).max():
        return "does not vary"
    return "follows from those before it"


def stacked(X: Data, lengths: npt.ArrayLike | None) -> tuple[Floats, Ints]:
    """Return the concatenated sequences (T, D), and one past the index of the last sample of each.

    Raises:
        EstimatorError: X is not (T, D) nor a list of (T_i, D), or the lengths do not add up to T.
    """
    if hasattr(X, "toarray"):
        raise TypeError("X is a sparse matrix; a dense array is needed: X.toarray()")
    if isinstance(X, list | tuple) and len(X) and np.ndim(X[0]) == 2:
        if lengths is not None:
            raise EstimatorError("X is a list of sequences, so `lengths` is not needed")
        parts = [matrix(part) for part in X]
        widths = [part.shape[1] for part in parts]
        if len(set(widths)) > 1:
            raise EstimatorError(f"the sequences differ in their channels: {widths}")
        return np.vstack(parts), np.cumsum([len(part) for part in parts])
    x = matrix(X)
    return x, _ends(lengths, len(x))


def _ends(lengths: npt.ArrayLike | None, samples: int) -> Ints:
    """Return one past the index of the last sample of each sequence."""
    sizes = np.array([samples]) if lengths is None else np.asarray(lengths)
    is_ones = sizes.ndim == 1 and np.array_equal(sizes, np.ones(samples))
    if sizes.shape[:1] == (samples,) and not is_ones:
        sizes = np.array([samples])  # a target, not lengths
    is_valid = sizes.ndim == 1 and sizes.dtype.kind in "iu" and (sizes >= 1).all()
    if not is_valid or sizes.sum() != samples:
        raise EstimatorError(
            f"lengths must be whole numbers >= 1 that add up to {samples} samples; they are "
            f"{sizes.tolist()}"
        )
    return np.cumsum(sizes).astype(np.int64)


def matrix(X: npt.ArrayLike) -> Floats:
    """Return X as an array (T, D).

    Raises:
        EstimatorError: it has another shape, or a value is complex or not finite.
    """
    values = np.asarray(X)
    if values.dtype.kind == "c":
        raise EstimatorError(f"Complex data not supported: an array of shape {values.shape}")
    x = values.astype(np.float64)
    if x.ndim != 2:
        raise EstimatorError(
            f"X must be 2D (samples, channels), not of shape {x.shape}. Reshape your data, "
            "e.g. X.reshape(-1, 1)"
        )
    if x.shape[1] == 0:
        raise EstimatorError(
            f"found 0 feature(s) (shape={x.shape}) while a minimum of 1 is required."
        )
    if not np.isfinite(x).all():
        row, column = np.argwhere(~np.isfinite(x))[0]
        raise EstimatorError(
            f"X holds NaN or inf: {x[row, column]} at sample {row}, channel {column}; "
            "interpolate what is missing, or split the series there"
        )
    return x
