# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the sticky HDP-HMM."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.numerics import Floats

GAUSSIAN_DOF_COUNT = 1000.0  # degrees of freedom from which noise counts as Gaussian


@dataclass(frozen=True)
class SamplerConfig(Parameters):
    """The sticky HDP-HMM and its sampler; the defaults suit series with 1 to 24 channels."""

    emission: str = parameter(
        "gaussian",
        "distribution of the samples of a state",
        choices=("gaussian", "autoregressive"),
    )
    order: int = parameter(
        1, "past samples that an autoregressive emission regresses on", low=1, high=5
    )
    states: int = parameter(
        0,
        "weak-limit truncation L; 0: from the data, and more if all states are used",
        low=0,
        high=200,
    )
    chains: int = parameter(3, "independent chains with different starts", low=1, high=16)
    sweeps: int = parameter(
        600,
        "maximum Gibbs sweeps per chain; chains end earlier when they agree",
        low=10,
        high=100_000,
    )
    r_hat: float = parameter(
        1.1,
        "split R-hat below which, on every trace, chains agree; 1: run all sweeps",
        low=1.0,
        high=10.0,
    )
    moves: int = parameter(8, "split or merge moves per sweep", low=0, high=100)
    dof: float = parameter(
        0.0,
        "degrees of freedom of Student-t noise; 0: from the data; 1000 or more: Gaussian",
        low=0.0,
        high=1e9,
    )
    mean_weight: float = parameter(
        0.05,
        "prior samples that the regression of an autoregressive state is worth",
        low=1e-6,
        high=100.0,
    )
    weight: float = parameter(
        0.0,
        "weight of a sample, below 1 if neighbours are correlated; 0: from the data",
        low=0.0,
        high=1.0,
    )
    gamma_shape: float = parameter(1.0, "shape of γ's Gamma prior", low=1e-3)
    gamma_rate: float = parameter(1.0, "rate of γ's Gamma prior", low=1e-6)
    alpha_kappa_shape: float = parameter(1.0, "shape of the Gamma prior of α+κ", low=1e-3)
    alpha_kappa_rate: float = parameter(0.01, "rate of the Gamma prior of α+κ", low=1e-6)
    rho_a: float = parameter(40.0, "first parameter of ρ's Beta prior, ρ = κ/(α+κ)", low=1e-3)
    rho_b: float = parameter(1.0, "second parameter of ρ's Beta prior", low=1e-3)

    @property
    def hyper(self) -> Floats:
        """(6,) parameters of the hyperpriors, in the order of `transitions.HYPER`."""
        return np.array(
            [
                self.gamma_shape,
                self.gamma_rate,
                self.alpha_kappa_shape,
                self.alpha_kappa_rate,
                self.rho_a,
                self.rho_b,
            ]
        )
