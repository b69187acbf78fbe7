# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The peers, each by its own public functions; None where one is not installed (`pip install jax-moseq hmmlearn ruptures`)."""

from collections.abc import Callable
from dataclasses import dataclass
import importlib.util
import os
import time
from typing import Any
import warnings

import numpy as np

from scenario_gen.method.segmentation import Posterior, SegmentationConfig
from scenario_gen.method.segmentation.features import driving_features, without_outliers
from scenario_gen.method.segmentation.segmenter import sample_features
from scenario_gen.numerics.arrays import Floats, Ints
from scenario_gen.types.encounter import Encounter


def installed(name: str) -> bool:
    """True if the peer can be imported."""
    return importlib.util.find_spec(name) is not None


def standardised(x: Floats) -> Floats:
    """Channels with mean 0 and variance 1."""
    return np.asarray((x - x.mean(axis=0)) / x.std(axis=0))


def sweeps_run(found: Posterior) -> int:
    """Return the sweeps of all chains, burn-in included; those before a restart with more states are not counted."""
    return 2 * int(np.sum([len(trace) for trace in found.trace]))


def posterior_of(
    encounter: Encounter, config: SegmentationConfig, seed: int
) -> tuple[Floats, Posterior]:
    """Return the features (T, D) of an encounter, and the posterior that `segment` draws from them with this seed."""
    clean = without_outliers(encounter)
    features, noise = driving_features(
        clean, config.speed_window, config.turn_window, config.speed_noise, config.turn_noise
    )
    return features, sample_features(features, noise, config.sampler, seed)


@dataclass(frozen=True, eq=False)
class Chain:
    """What a peer's sampler came to.

    Attributes:
        labels: (T,) after the last sweep.
        seconds: CPU time of the sweeps, without compilation.
        sweeps: how many were timed.
    """

    labels: Ints
    seconds: float
    sweeps: int


def jax_moseq(
    x: Floats,
    sweeps: int,
    states: int = 20,
    *,
    done: Callable[[Ints], bool] | None = None,
    every: int = 10,
    most: float = np.inf,
) -> Chain | None:
    """Run jax-moseq's public sampler (arhmm.resample_model) with a plain Gaussian; None if it is not installed.

    The package has autoregressive emissions only; a prior that pins the regression on the past at 0 leaves the Gaussian
    (`init_model` takes all hyperparameters). Concentrations are fixed there.

    Args:
        x: (T, D).
        sweeps: timed ones, at most; two more go before, which compile.
        states: L.
        done: whether labels (T,) are good enough to stop; its own time is not counted.
        every: sweeps between two calls of `done`.
        most: CPU seconds after which no further `every` sweeps are begun.
    """
    if not installed("jax_moseq"):
        return None
    os.environ.setdefault(
        "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    )  # as ours: one thread
    import jax

    jax.config.update("jax_enable_x64", True)
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(
        0, {min(cores)}
    )  # idle threads of XLA spin on other cores, which counts as CPU time
    try:
        return _timed(*_gaussian(x, states), len(x), sweeps, done, every, most)
    finally:
        os.sched_setaffinity(0, cores)


def _gaussian(x: Floats, states: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return jax-moseq's data and initial model."""
    import jax.numpy as jnp
    import jax.random as jr
    from jax_moseq.models import arhmm

    y = jnp.asarray(standardised(x))[None]
    d = y.shape[2]
    data = {"x": y, "mask": jnp.ones(y.shape[:2])}
    transitions = {"num_states": states, "alpha": 5.7, "kappa": 100.0, "gamma": 1.0}
    regression = {
        "latent_dim": d,
        "nlags": 1,
        "num_states": states,
        "nu_0": d + 2,
        "S_0": jnp.asarray(0.75 * np.atleast_2d(np.cov(np.asarray(y[0]).T))),
        "M_0": jnp.zeros((d, d + 1)),
        "K_0": jnp.diag(jnp.asarray([1e-6] * d + [10.0])),
    }
    hyper = {"trans_hypparams": transitions, "ar_hypparams": regression}
    return data, arhmm.init_model(data, seed=jr.PRNGKey(0), hypparams=hyper, verbose=False)


def _timed(
    data: dict[str, Any],
    model: dict[str, Any],
    samples: int,
    sweeps: int,
    done: Callable[[Ints], bool] | None,
    every: int,
    most: float,
) -> Chain:
    """Two sweeps that compile, then timed ones, `every` at a time if they may end early."""
    from jax_moseq.models import arhmm

    def run(count: int) -> Ints:
        nonlocal model
        for _ in range(count):
            model = arhmm.resample_model(data, **model)
        labels = np.asarray(model["states"]["z"][0], dtype=np.int64)  # waits for the last sweep
        return np.concatenate([np.repeat(labels[:1], samples - len(labels)), labels])

    labels = run(2)
    spent, ran = 0.0, 0
    while ran < sweeps and spent < most:
        count = sweeps - ran if done is None else min(every, sweeps - ran)
        started = time.process_time()
        labels = run(count)
        spent, ran = spent + time.process_time() - started, ran + count
        if done is not None and done(labels):
            break
    return Chain(labels, spent, ran)


def hmmlearn(x: Floats, states: int, starts: int = 10) -> Ints | None:
    """Gaussian HMM by EM with the true number of states, the likeliest of several starts."""
    if not installed("hmmlearn"):
        return None
    import logging

    from hmmlearn.hmm import GaussianHMM

    logging.getLogger("hmmlearn").setLevel(logging.CRITICAL)
    y = standardised(x)
    best: tuple[float, Ints] | None = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for seed in range(starts):
            try:
                model = GaussianHMM(
                    states, "full", n_iter=100, random_state=seed, min_covar=1e-3
                ).fit(y)
                score = float(model.score(y))
            except ValueError:
                continue
            if best is None or score > best[0]:
                best = (score, np.asarray(model.predict(y), dtype=np.int64))
    return None if best is None else best[1]


def ruptures(x: Floats) -> Ints | None:
    """Changepoints by PELT with a normal cost and a BIC penalty."""
    if not installed("ruptures"):
        return None
    import ruptures as rpt

    y = standardised(x)
    samples, d = y.shape
    penalty = (d + d * (d + 1) / 2 + 1) * np.log(samples)
    found = rpt.Pelt(model="normal", min_size=max(d + 2, 5), jump=2).fit(y).predict(pen=penalty)
    return np.array(found[:-1], dtype=np.int64)
