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

"""A plain (T, D) array -> posterior over its segmentations: the sticky HDP-HMM without any driving in it."""

from dataclasses import replace

import numpy as np

from scenario_gen.arrays import Floats, Ints
from scenario_gen.errors import InputError
from scenario_gen.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.segmentation.hdp_hmm.problem import Problem
from scenario_gen.segmentation.hdp_hmm.start import find_start, sample_weight, Start
from scenario_gen.segmentation.posterior import pool, Posterior


def segment_series(
    x: Floats,
    config: SamplerConfig = SamplerConfig(),
    seed: int = 0,
    *,
    ends: tuple[int, ...] | None = None,
    blur: Floats | None = None,
) -> Posterior:
    """Sample the segmentations of a series under the sticky HDP-HMM (Fox et al. 2011; priors chosen from the data).

    Args:
        x: (T, D), any units: what does not vary is left out, the rest is scaled to unit variance, or by `blur` if that is more.
        config: model and sampler.
        seed: same seed, same answer, bit for bit.
        ends: where several sequences stand one after the other, the index one past the last sample of each.
        blur: (D,) standard deviation, in x's units, below which differences in a channel mean nothing (None: 0).

    Raises:
        InputError: fewer than 4 samples, or a value that is not finite.
    """
    x = np.asarray(x, dtype=np.float64)
    if x.ndim == 1:
        x = x[:, None]
    if x.ndim != 2 or x.shape[0] < 4:
        raise InputError(f"a series to segment needs at least 4 samples in (T, D), not an array of shape {x.shape}")
    if not np.isfinite(x).all():
        row, column = np.argwhere(~np.isfinite(x))[0]
        raise InputError(
            f"the series to segment holds {x[row, column]} at sample {row}, channel {column}; fill or drop such samples"
        )
    stops = np.array([len(x)] if ends is None else ends, dtype=np.int64)
    if stops[-1] != len(x) or (np.diff(np.concatenate([[0], stops])) < 1).any():
        raise InputError(f"the ends of the sequences must rise to the number of samples, {len(x)}; they are {stops.tolist()}")
    spread = x.std(axis=0)
    varies = spread > 1e-9 * np.maximum(np.abs(x).max(axis=0), 1e-300)
    if not varies.any():
        return Posterior.constant(len(x))
    known = np.zeros(x.shape[1]) if blur is None else np.asarray(blur)
    unit = np.maximum(spread, known)[varies]  # what varies less than it is known shall not be blown up to look like the rest
    unknown = np.square(known[varies] / unit)
    scaled = (x[:, varies] - x[:, varies].mean(axis=0)) / unit
    first, *seeds = np.random.SeedSequence([seed]).spawn(config.chains + 1)
    problem = Problem.build(scaled, stops, config, unknown)
    ready = None
    if config.weight == 0.0:
        weight, start = sample_weight(problem, config, np.random.Generator(np.random.PCG64(first)))
        problem = replace(problem, weight=weight)
        ready = start if weight == 1.0 else None
    results = [_run(problem, config, index, stream, ready if index == 0 else None) for index, stream in enumerate(seeds)]
    return pool([labels for labels, _ in results], [trace for _, trace in results], stops, problem.lead)


def _run(
    problem: Problem, config: SamplerConfig, index: int, stream: np.random.SeedSequence, known: Start | None
) -> tuple[Ints, Floats]:
    """Run chain number `index`, from the start `known` if there is one; returns kept labels (S, T') and their trace (S, 5)."""
    rng = np.random.Generator(np.random.PCG64(stream))
    start = known or find_start(problem, config, index, rng)
    sweeps = max(config.sweeps - start.sweeps, 4)
    burn = sweeps // 3
    return problem.run(config, start.prior, start.labels, burn, sweeps - burn, int(rng.integers(2**62)))
