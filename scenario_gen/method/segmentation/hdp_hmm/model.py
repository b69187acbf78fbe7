# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Types of the kernels: T samples v = (z, y) of M = P + D numbers, L states."""

from typing import NamedTuple

from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import (
    F,
    F1,
    F2,
    I,
    I1,
    named,
    OUT1,
    OUT2,
    OUT3,
    OUTI1,
    OUTI2,
)


class Data(NamedTuple):
    """The samples.

    Attributes:
        v: (T, M) samples (z, y).
        vt: (M, T) the same, transposed.
        mass: (T,) initial masses, see `accumulate`; updated. Of a sample that was not observed, 0.
        ends: one past the index of the last sample of each sequence.
    """

    v: Floats
    vt: Floats
    mass: Floats
    ends: Ints


class Grid(NamedTuple):
    """Candidates for the prior of the emissions.

    Attributes:
        mean: (D, P) prior mean M of the regressions.
        precision: (P, P) their prior precision K is this times one of `worths`.
        within: (D, D) prior mean of the states' covariances; S0 is (ν0 - D - 1) times it.
        extras: (A,) what ν0 - D may be, all equally probable beforehand.
        worths: (B,) what K may be in units of `precision`.
        odds: (B,) logarithms of their prior probabilities.
    """

    mean: Floats
    precision: Floats
    within: Floats
    extras: Floats
    worths: Floats
    odds: Floats


class Hyper(NamedTuple):
    """Constants of a chain.

    Attributes:
        levels: (6,) parameters of the hyperpriors, see `transitions.HYPER`.
        weight: of a sample.
        dof: degrees of freedom of Student-t noise; 0: Gaussian.
        blur: (D,) variance of each channel's measurement error.
        moves: split or merge moves per sweep.
    """

    levels: Floats
    weight: float
    dof: float
    blur: Floats
    moves: int


class Start(NamedTuple):
    """Where a chain starts.

    Attributes:
        labels: (T,) 0 .. L - 1.
        top: (3 + L,) γ, α+κ, ρ and β; updated.
        chosen: (2,) indices of the current `extras` and `worths` of the grid; updated.
    """

    labels: Ints
    top: Floats
    chosen: Ints


class Out(NamedTuple):
    """The output of a chain: a row for each sweep.

    Attributes:
        samples: (S, T) labels of the last S sweeps.
        trace: (N, 5) of all N sweeps, see `chain.TRACE`.
        emissions: (L, D, M) `States.coef` of the last sweep.
    """

    samples: Ints
    trace: Floats
    emissions: Floats


class Joint(NamedTuple):
    """The current prior of the emissions.

    Attributes:
        g0: (M, M) G0, see `emission`.
        nu: degrees of freedom ν0.
        weight: of a sample; below 1 if neighbouring samples are correlated.
        blur: (D,) variance of each channel's measurement error.
    """

    g0: Floats
    nu: float
    weight: float
    blur: Floats


class States(NamedTuple):
    """The states' emissions.

    Attributes:
        coef: (L, D, M) maps of v to its whitened residual, see `draw_emission`.
        shape: (L, 2) log|Σ|^(-1/2) and tr(Σ⁻¹ blur).
    """

    coef: Floats
    shape: Floats


class Statistics(NamedTuple):
    """Statistics of the states, given the labels.

    Attributes:
        outer: (L, M, M) Σ mass v vᵀ; lower triangles.
        sums: (L, 2) observed samples and Σ mass.
        factors: (L, M, M) Cholesky factors of the posteriors.
        marginal: (L,) log marginal likelihood of each state's samples.
        n: (L + 1, L) transition counts.
    """

    outer: Floats
    sums: Floats
    factors: Floats
    marginal: Floats
    n: Ints


DATA = named(Data, F2, F2, OUT1, I1)
GRID = named(Grid, F2, F2, F2, F1, F1, F1)
HYPERS = named(Hyper, F1, F, F, F1, I)
START = named(Start, I1, OUT1, OUTI1)
OUTPUT = named(Out, OUTI2, OUT2, OUT3)
JOINT = named(Joint, F2, F, F, F1)
