# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Arrays, curves, exact arithmetic, compiled kernels: nothing of traffic."""

from scenario_gen.numerics.arrays import (
    Bools,
    canonical_heading,
    canonical_poses,
    Floats,
    frozen,
    frozen_ints,
    Ints,
    runs,
    wrap_angle,
)

__all__ = [
    "Bools", "Floats", "Ints", "canonical_heading", "canonical_poses", "frozen", "frozen_ints", "runs", "wrap_angle",
]  # fmt: skip
