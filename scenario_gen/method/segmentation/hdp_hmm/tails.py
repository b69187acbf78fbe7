# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Heavy-tailed noise.

Student-t noise is Gaussian noise whose precision is scaled by a mass per sample, Gamma(ν/2, ν/2)
(Andrews & Mallows 1974). Labels are drawn with the masses integrated out, then masses given
labels. A sample that was not observed has mass 0.
"""

import numpy as np

from scenario_gen.method.segmentation.hdp_hmm.emission import square
from scenario_gen.method.segmentation.hdp_hmm.model import Data, Hyper, States
from scenario_gen.method.segmentation.hdp_hmm.random import log_gamma_draw, State
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import kernel


@kernel(inline=True)
def draw_masses(state: State, data: Data, labels: Ints, emitted: States, hyper: Hyper) -> None:
    """Draw the samples' masses given labels (T,) and emissions; those of 0 do not change."""
    mass, weight, dof = data.mass, hyper.weight, hyper.dof
    shape = 0.5 * (dof + weight * len(hyper.blur))
    for t in range(len(mass)):
        if mass[t] > 0.0:
            k = labels[t]
            total = square(emitted.coef[k], data.v[t]) + emitted.shape[k, 1]
            mass[t] = np.exp(log_gamma_draw(state, shape)) / (0.5 * (dof + weight * total))


@kernel(inline=True)
def log_masses(mass: Floats, power: float, dof: float) -> float:
    """Return the log density of mass (T,) plus Σ ½ power log mass, up to a constant."""
    value = 0.0
    for t in range(len(mass)):
        if mass[t] > 0.0:
            value += (0.5 * (power + dof) - 1.0) * np.log(mass[t]) - 0.5 * dof * mass[t]
    return value
