# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Arrays, curves, compiled kernels; nothing of traffic."""

from scenario_gen.numerics.arrays import (
    Bools,
    canonical_heading,
    canonical_poses,
    Counts,
    Floats,
    freeze,
    frozen,
    frozen_bools,
    frozen_ints,
    Ints,
    NS_PER_S,
    running_sum,
    runs,
    sealed,
    wrap_angle,
)

__all__ = [
    "NS_PER_S",
    "Bools",
    "Counts",
    "Floats",
    "Ints",
    "canonical_heading",
    "canonical_poses",
    "freeze",
    "frozen",
    "frozen_bools",
    "frozen_ints",
    "running_sum",
    "runs",
    "sealed",
    "wrap_angle",
]
