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

"""Standard normal numbers that are the same on every CPU."""

import numpy as np

from scenario_gen.arrays import Floats
from scenario_gen.exact.functions import ndtri


def standard_normal(generator: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """Return independent standard normal numbers of that shape, any shape, by inversion.

    numpy's own come from its ziggurat, whose tails call the C library's logarithm. Here the generator gives 53 random
    bits a number, exactly, and the rest is `ndtri`. The largest that can be drawn is 8.3.
    """
    return ndtri(generator.random(shape) + 0.5**54)
