# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Standard normal numbers that are the same on every CPU."""

import numpy as np

from scenario_gen.numerics.arrays import Floats
from scenario_gen.numerics.exact.functions import ndtri


def standard_normal(generator: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """Return independent standard normal numbers of that shape, any shape, by inversion.

    numpy's own come from its ziggurat, whose tails call the C library's logarithm. Here the generator gives 53 random
    bits a number, exactly, and the rest is `ndtri`. The largest that can be drawn is 8.3.
    """
    return ndtri(generator.random(shape) + 0.5**54)
