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

"""Moving averages."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.arrays import Floats


def moving_mean(x: Floats, width: int) -> Floats:
    """Mean over `width` samples around each sample of x (T, ...); before the first and after the last one those repeat."""
    before = width // 2
    edges = [(before, width - 1 - before)] + [(0, 0)] * (x.ndim - 1)
    return np.asarray(sliding_window_view(np.pad(x, edges, mode="edge"), width, axis=0).mean(axis=-1))
