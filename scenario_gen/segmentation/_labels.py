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

"""Labels of many samplings made one set: Hungarian matching and votes."""

import numpy as np

from scenario_gen.arrays import Ints
from scenario_gen.kernels import I, I1, I2, kernel, OUTI2


@kernel(inline=True)
def best_partners(overlap: Ints, partner: Ints) -> None:
    """Fill partner (n,): the column of each row of overlap (n, n) that together overlap most (Hungarian method).

    Shortest augmenting paths, one row after the other, with potentials that keep reduced costs from falling below 0.
    """
    n = len(partner)
    row_potential, column_potential = np.zeros(n + 1, np.int64), np.zeros(n + 1, np.int64)
    owner, way = np.zeros(n + 1, np.int64), np.zeros(n + 1, np.int64)  # counted from 1; column 0 holds the new row
    least = np.empty(n + 1, np.int64)
    reached = np.empty(n + 1, np.bool_)
    far = 4 * (np.sum(overlap) + 1)
    for new in range(1, n + 1):
        owner[0] = new
        column = 0
        least[:] = far
        reached[:] = False
        while owner[column] != 0:
            reached[column] = True
            row = owner[column]
            step, following = far, 0
            for j in range(1, n + 1):
                if not reached[j]:
                    cost = -overlap[row - 1, j - 1] - row_potential[row] - column_potential[j]
                    if cost < least[j]:
                        least[j] = cost
                        way[j] = column
                    if least[j] < step:
                        step, following = least[j], j
            for j in range(n + 1):
                if reached[j]:
                    row_potential[owner[j]] += step
                    column_potential[j] -= step
                else:
                    least[j] -= step
            column = following
        while column != 0:
            owner[column] = owner[way[column]]
            column = way[column]
    for j in range(1, n + 1):
        partner[owner[j] - 1] = j - 1


@kernel(I2, I1, I, OUTI2, OUTI2)
def match_and_vote(samples: Ints, reference: Ints, size: int, matched: Ints, votes: Ints) -> None:
    """Rename each row's labels to agree with `reference` in as many samples as possible, and count them.

    Args:
        samples: (S, T) labels below `size`.
        reference: (T,) labels below `size`.
        size: number of labels, n.
        matched: (S, T) output.
        votes: (n, T) output, how many rows give a sample that label.
    """
    overlap = np.empty((size, size), np.int64)
    partner = np.empty(size, np.int64)
    votes[:] = 0
    for s in range(samples.shape[0]):
        row = samples[s]
        overlap[:] = 0
        for t in range(len(row)):
            overlap[row[t], reference[t]] += 1
        best_partners(overlap, partner)
        for t in range(len(row)):
            label = partner[row[t]]
            matched[s, t] = label
            votes[label, t] += 1
