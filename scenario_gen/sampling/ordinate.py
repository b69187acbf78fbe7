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

"""The paper's own form of the sampler: y as a function of x, with a cubic mean (section III-C, preset `paper`).

For figures only: a function y(x) describes neither a vertical nor a time. What is published comes from `sample_scenarios`.
"""

from dataclasses import dataclass

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.errors import InputError
from scenario_gen.parameters import check, parameter
from scenario_gen.sampling.gp import Features, Observations, Posterior, Regression


@dataclass(frozen=True)
class OrdinateConfig:
    """The paper's values, in cells."""

    sigma: float = parameter(10.0, "σ_f of eq 14", unit="cells", low=0.0)
    length: float = parameter(100.0, "l of eq 14", unit="cells", low=1e-6)
    noise: float = parameter(10.0, "σ_ω, standard deviation at an interior anchor", unit="cells", low=1e-6)
    degree: int = parameter(3, "degree of the mean", low=0, high=5)

    def __post_init__(self) -> None:
        check(self)


def ordinate_posterior(anchors: Floats, x: Floats, config: OrdinateConfig | None = None) -> Posterior:
    """The posterior of y at x (m,) given one vehicle's anchors (A, 2), exact at the first and the last of them.

    The degree of the mean is lowered where there are too few anchors for it.

    Raises:
        InputError: fewer than two anchors, or all of them at the same x.
    """
    config = config or OrdinateConfig()
    _, first = np.unique(anchors[:, 0], return_index=True)
    ends = [0, len(anchors) - 1]
    keep = np.unique(np.concatenate([ends, [k for k in first.tolist() if anchors[k, 0] not in anchors[ends, 0]]])).astype(
        np.int64
    )
    seen_x, seen_y = anchors[keep].T
    low, high = min(seen_x.min(), x.min()), max(seen_x.max(), x.max())
    if len(keep) < 2 or seen_x[0] == seen_x[-1]:
        raise InputError("y as a function of x needs anchors at two different x; use the parametric form")
    noise = np.full(len(keep), config.noise)
    noise[[0, -1]] = 0.0
    features = Features(low, high, config.sigma, config.length, min(config.degree, len(keep) - 1))
    return Regression(features, Observations(seen_x, seen_y, noise)).predict(x)


def ordinate_samples(anchors: Floats, x: Floats, count: int, seed: int = 0, config: OrdinateConfig | None = None) -> Floats:
    """Curves (count, m) of y at x (m,) through one vehicle's anchors (A, 2)."""
    posterior = ordinate_posterior(anchors, x, config)
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed])))
    return posterior.sample(exact.standard_normal(generator, (count, posterior.factor.shape[1])))
