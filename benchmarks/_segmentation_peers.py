# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The peers, each by its own public functions; None where one is not installed (`pip install hmmlearn ruptures`)."""

import importlib.util
import warnings

import numpy as np

from scenario_gen.numerics.arrays import Floats, Ints


def installed(name: str) -> bool:
    """True if the peer can be imported."""
    return importlib.util.find_spec(name) is not None


def standardised(x: Floats) -> Floats:
    """Channels with mean 0 and variance 1."""
    return np.asarray((x - x.mean(axis=0)) / x.std(axis=0))


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
