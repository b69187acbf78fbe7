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

"""k-means, from which labels start."""

import numpy as np

from scenario_gen.arrays import Floats, Ints
from scenario_gen.kernels import F2, I, kernel, OUT2, OUTI1
from scenario_gen.segmentation._random import State, uniform


@kernel(inline=True)
def distances(x: Floats, centres: Floats, used: int, out: Floats) -> None:
    """Fill out[:used] with squared distances from x (D,) to centres (D, K)."""
    for k in range(used):
        out[k] = 0.0
    for i in range(len(x)):
        c = x[i]
        row = centres[i]
        for k in range(used):
            out[k] += (c - row[k]) ** 2


@kernel(inline=True)
def spread_centres(state: State, x: Floats, centres: Floats) -> None:
    """Fill centres (D, K) with samples of x (T, D), each drawn by its squared distance to those before (k-means++)."""
    samples, d = x.shape
    far = np.full(samples, np.inf)
    for k in range(centres.shape[1]):
        chosen = int(uniform(state) * samples)
        if k > 0:
            total = 0.0
            for t in range(samples):
                total += far[t]
            left = uniform(state) * total
            chosen = 0
            while chosen < samples - 1 and left > far[chosen]:
                left -= far[chosen]
                chosen += 1
        for t in range(samples):
            square = 0.0
            for i in range(d):
                square += (x[t, i] - x[chosen, i]) ** 2
            far[t] = min(far[t], square)
        for i in range(d):
            centres[i, k] = x[chosen, i]


@kernel(F2, I, I, OUT2, OUTI1)
def kmeans(x: Floats, seed: int, rounds: int, centres: Floats, labels: Ints) -> None:
    """k-means with the starts of k-means++ (Arthur & Vassilvitskii 2007).

    Args:
        x: (T, D).
        seed: any integer.
        rounds: of assigning and averaging.
        centres: (D, K) output; where a cluster runs empty its centre stays.
        labels: (T,) output.
    """
    samples, d = x.shape
    states = centres.shape[1]
    state: State = np.empty(1, np.uint64)
    state[0] = np.uint64(seed)
    spread_centres(state, x, centres)
    near = np.empty(states)
    counts = np.empty(states)
    sums = np.empty((d, states))
    for _ in range(rounds):
        counts[:] = 0.0
        sums[:] = 0.0
        for t in range(samples):
            distances(x[t], centres, states, near)
            best = 0
            for k in range(1, states):
                if near[k] < near[best]:
                    best = k
            labels[t] = best
            counts[best] += 1.0
            for i in range(d):
                sums[i, best] += x[t, i]
        for k in range(states):
            if counts[k] > 0.0:
                for i in range(d):
                    centres[i, k] = sums[i, k] / counts[k]
