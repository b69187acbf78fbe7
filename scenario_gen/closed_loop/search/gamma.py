# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The gamma distribution's quantile, rounded so that it is the same on every CPU."""

from scipy import special

DIGITS = 9  # scipy's last ones depend on the C library


def gamma_quantile(mean: float, variance: float, share: float) -> float:
    """Return the quantile at a share of the gamma distribution with this mean and variance."""
    return float(f"{float(special.gammaincinv(mean * mean / variance, share)) * variance / mean:.{DIGITS}g}")
