# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The peers, each by its own public functions; None where one is not installed (`pip install jax-moseq hmmlearn ruptures`)."""

import importlib.util
import time
from typing import Any
import warnings

import numpy as np

from scenario_gen.arrays import Floats, Ints


def installed(name: str) -> bool:
    """True if the peer can be imported."""
    return importlib.util.find_spec(name) is not None


def standardised(x: Floats) -> Floats:
    """Channels with mean 0 and variance 1."""
    return np.asarray((x - x.mean(axis=0)) / x.std(axis=0))


def jax_moseq(x: Floats, sweeps: int, *, compiled: bool, seed: int = 0, states: int = 20) -> tuple[Ints, float] | None:
    """Gaussian sticky HDP-HMM of jax-moseq's Gibbs steps (concentrations fixed): labels, and CPU seconds without compilation.

    Args:
        x: (T, D).
        sweeps: timed ones; two more go before, which compile.
        compiled: True: we compile each step as a whole, as fast as we could make them. False: the package's functions as they
            ship, called one after the other, each with what compilation it brings; log-likelihoods from the distribution
            that the package itself uses, mapped over the states.
        seed: of the sampler.
        states: L.
    """
    if not installed("jax_moseq"):
        return None
    import jax
    import jax.numpy as jnp
    import jax.random as jr
    from jax_moseq.models.arhmm.gibbs import _resample_regression_params
    from jax_moseq.utils.distributions import sample_hmm_stateseq
    from jax_moseq.utils.transitions import init_hdp_transitions, resample_hdp_transitions
    import tensorflow_probability.substrates.jax.distributions as tfd

    jax.config.update("jax_enable_x64", True)
    y = jnp.asarray(standardised(x))
    samples, d = y.shape
    ones, mask = jnp.ones((samples, 1)), jnp.ones((1, samples))
    s0 = jnp.asarray(0.75 * np.cov(np.asarray(y).T))
    concentrations = {"alpha": 5.7, "kappa": 100.0, "gamma": 1.0}
    prior = (d + 2.0, s0, jnp.zeros((d, 1)), 10.0 * jnp.eye(1))

    def state(args: Any) -> Any:
        return _resample_regression_params(ones, y, *prior, args)

    def log_prob(args: Any) -> Any:
        return tfd.MultivariateNormalFullCovariance(args[0][:, 0], args[1]).log_prob(y)

    def emissions(key: Any, z: Any) -> Any:
        keys, members = jr.split(key, states), jnp.eye(states)[:, z]
        if compiled:
            return jax.lax.map(state, (keys, members))
        return tuple(jnp.stack(part) for part in zip(*[state(pair) for pair in zip(keys, members, strict=True)], strict=True))

    def labels_given(key: Any, means: Any, covariances: Any, pi: Any) -> Any:
        over_states = jax.lax.map if compiled else lambda f, args: jax.vmap(f)(args)
        return sample_hmm_stateseq(key, pi, over_states(log_prob, (means, covariances)).T, mask[0])[1]

    if compiled:
        emissions, labels_given = jax.jit(emissions), jax.jit(labels_given)
    key = jr.PRNGKey(seed)
    betas, _ = init_hdp_transitions(key, num_states=states, **concentrations)
    z = jr.randint(key, (samples,), 0, states)
    started = time.process_time()
    for sweep in range(sweeps + 2):
        if sweep == 2:
            jax.block_until_ready(z)
            started = time.process_time()
        key, a, b, c = jr.split(key, 4)
        betas, pi = resample_hdp_transitions(a, z[None], mask, betas, **concentrations)
        means, covariances = emissions(b, z)
        z = labels_given(c, means, covariances, pi)
    jax.block_until_ready(z)
    return np.asarray(z, dtype=np.int64), time.process_time() - started


def jax_moseq_public(x: Floats, sweeps: int, states: int = 20) -> float | None:
    """CPU seconds, without compilation, of jax-moseq's public sampler, arhmm.resample_model (AR(1): it has no plain Gaussian)."""
    if not installed("jax_moseq"):
        return None
    import jax
    import jax.numpy as jnp
    import jax.random as jr
    from jax_moseq.models import arhmm

    jax.config.update("jax_enable_x64", True)
    y = jnp.asarray(standardised(x))[None]
    data = {"x": y, "mask": jnp.ones(y.shape[:2])}
    transitions = {"num_states": states, "alpha": 5.7, "kappa": 100.0, "gamma": 1.0}
    regression = {"latent_dim": y.shape[2], "nlags": 1, "S_0_scale": 0.75, "K_0_scale": 10.0}
    model = arhmm.init_model(data, seed=jr.PRNGKey(0), trans_hypparams=transitions, ar_hypparams=regression)
    started = time.process_time()
    for sweep in range(sweeps + 2):
        if sweep == 2:
            jax.block_until_ready(model["states"]["z"])
            started = time.process_time()
        model = arhmm.resample_model(data, **model)
    jax.block_until_ready(model["states"]["z"])
    return time.process_time() - started


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
