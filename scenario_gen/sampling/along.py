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

"""Where along its route a vehicle passes its anchors: a Gaussian process over time, so that speeds stay a driver's."""

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.sampling.config import SamplingConfig
from scenario_gen.sampling.gp import Features, Observations, Regression

MOST_SHARE = 0.3  # an anchor moves by at most this share of the way to its neighbours


def along_factor(times: Floats, anchor: Floats, config: SamplingConfig) -> Floats:
    """Square root (D, r) of the covariance of the displacements [m] of the route's D distinct inner anchors.

    Independent displacements of anchors a second apart would jerk the speed; those of neighbours in time go together.

    Args:
        times: (K + 2,) seconds on the template's clock.
        anchor: (K + 2,) arc lengths [m]; the anchors of a dwell are one and the same.
        config: σ_s and the time over which displacements vary.
    """
    distinct, which = np.unique(anchor, return_inverse=True)
    if config.longitudinal_sigma == 0.0 or len(distinct) < 3:
        return np.zeros((max(len(distinct) - 2, 0), 0))
    middle = np.bincount(which, times) / np.bincount(which)
    ends = times[[0, -1]]
    features = Features(ends[0], ends[1], config.longitudinal_sigma, config.longitudinal_time)
    factor = Regression(features, Observations(ends, np.zeros(2), np.zeros(2))).predict(middle[1:-1]).factor
    return exact.compact(factor)


def displaced_anchors(anchor: Floats, factor: Floats, z: Floats) -> Floats:
    """Arc lengths (S, K + 2) of the anchors (K + 2,), displaced by factor·z for z (S, r); a dwell's move together."""
    distinct, which = np.unique(anchor, return_inverse=True)
    moved = np.broadcast_to(distinct, (len(z), len(distinct))).copy()
    if factor.size:
        gap = np.diff(distinct)
        most = MOST_SHARE * np.minimum(gap[:-1], gap[1:])
        moved[:, 1:-1] += np.clip(exact.matmul(z, factor.T), -most, most)
    return np.asarray(moved[:, which])
