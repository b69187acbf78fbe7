# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the sampler's kernels pass to each other. T samples v = (z, y) of M = P + D numbers, L states."""

from typing import NamedTuple

from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.kernels import (
    B2,
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
        v: (T, M) samples (z, y); what is hidden is drawn anew in every sweep.
        vt: (M, T) the same, transposed.
        gaps: (R,) samples with hidden channels, rising.
        hidden: (R, D) which channels were not observed.
        mass: (T,) see `accumulate`, to start from; updated. A sample of which nothing was observed has 0.
        ends: index one past the last sample of each sequence.
    """

    v: Floats
    vt: Floats
    gaps: Ints
    hidden: Bools
    mass: Floats
    ends: Ints


class Grid(NamedTuple):
    """What the prior of the emissions may be.

    Attributes:
        mean: (D, P) prior mean M of the regressions.
        precision: (P, P) their prior precision K is this times one of `worths`.
        within: (D, D) prior mean of the states' covariances; S0 is (ν0 - D - 1) times it.
        extras: (A,) what ν0 - D may be, all equally probable beforehand.
        worths: (B,) what K may be in units of `precision`.
        odds: (B,) logarithms of how probable each is beforehand.
    """

    mean: Floats
    precision: Floats
    within: Floats
    extras: Floats
    worths: Floats
    odds: Floats


class Hyper(NamedTuple):
    """What stays as it is in a chain.

    Attributes:
        levels: (6,) parameters of the hyperpriors, see `transitions.HYPER`.
        weight: what a sample counts for.
        dof: degrees of freedom of Student-t noise; 0: Gaussian.
        blur: (D,) variance to which each channel is known at all.
        moves: split or merge moves that are tried in a sweep.
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
        chosen: (2,) which of the grid's `extras` and `worths` hold; updated.
    """

    labels: Ints
    top: Floats
    chosen: Ints


class Out(NamedTuple):
    """What a chain writes: a row for each sweep.

    Attributes:
        samples: (S, T) labels of the last S sweeps.
        trace: (N, 5) of all N sweeps, see `chain.TRACE`.
        emissions: (L, D, M) `States.coef` of the last sweep.
    """

    samples: Ints
    trace: Floats
    emissions: Floats


class Joint(NamedTuple):
    """The prior of the emissions that holds now.

    Attributes:
        g0: (M, M) G0, see `emission`.
        nu: degrees of freedom ν0.
        weight: what a sample counts for (1: all of it; less where neighbouring samples repeat each other).
        blur: (D,) variance to which a sample's channels are known at all.
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
    """All that the labels say of the states.

    Attributes:
        outer: (L, M, M) Σ mass v vᵀ; lower triangles.
        sums: (L, 2) observed samples and Σ mass.
        factors: (L, M, M) Cholesky factors of the posteriors.
        own: (L,) log marginal likelihood of each state's samples.
        n: (L + 1, L) transition counts.
    """

    outer: Floats
    sums: Floats
    factors: Floats
    own: Floats
    n: Ints


DATA = named(Data, OUT2, OUT2, I1, B2, OUT1, I1)
GRID = named(Grid, F2, F2, F2, F1, F1, F1)
HYPERS = named(Hyper, F1, F, F, F1, I)
START = named(Start, I1, OUT1, OUTI1)
OUTPUT = named(Out, OUTI2, OUT2, OUT3)
JOINT = named(Joint, F2, F, F, F1)
