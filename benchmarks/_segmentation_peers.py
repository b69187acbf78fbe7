# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The peers, each by its own public functions; None where one is not installed (`pip install jax-moseq hmmlearn ruptures`)."""

import importlib.util
import os
import time
import warnings

import numpy as np

from scenario_gen.numerics.arrays import Floats, Ints


def installed(name: str) -> bool:
    """True if the peer can be imported."""
    return importlib.util.find_spec(name) is not None


def standardised(x: Floats) -> Floats:
    """Channels with mean 0 and variance 1."""
    return np.asarray((x - x.mean(axis=0)) / x.std(axis=0))


def jax_moseq(x: Floats, sweeps: int, states: int = 20) -> tuple[Ints, float] | None:
    """Labels, and CPU seconds without compilation, of jax-moseq's public sampler (arhmm.resample_model) with a plain Gaussian.

    The package has autoregressive emissions only; a prior that pins the regression on the past at 0 leaves the Gaussian
    (`init_model` takes all hyperparameters). Concentrations are fixed there.

    Args:
        x: (T, D).
        sweeps: timed ones; two more go before, which compile.
        states: L.
    """
    if not installed("jax_moseq"):
        return None
    os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")  # as ours: one thread
    import jax
    import jax.numpy as jnp
    import jax.random as jr
    from jax_moseq.models import arhmm

    jax.config.update("jax_enable_x64", True)
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
    model = arhmm.init_model(
        data, seed=jr.PRNGKey(0), hypparams={"trans_hypparams": transitions, "ar_hypparams": regression}, verbose=False
    )
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})  # idle threads of XLA spin on other cores, which counts as CPU time
    started = time.process_time()
    for sweep in range(sweeps + 2):
        if sweep == 2:
            jax.block_until_ready(model["states"]["z"])
            started = time.process_time()
        model = arhmm.resample_model(data, **model)
    labels = np.asarray(model["states"]["z"][0], dtype=np.int64)
    spent = time.process_time() - started
    os.sched_setaffinity(0, cores)
    return np.concatenate([np.repeat(labels[:1], len(x) - len(labels)), labels]), spent


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
                model = GaussianHMM(states, "full", n_iter=100, random_state=seed, min_covar=1e-3).fit(y)
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
