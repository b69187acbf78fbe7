# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How far rounding moves a computed figure: processors differ by less.

A comparison that decides, and that a figure may meet exactly, allows for it. Proofs do not: they
use outward bounds.
"""

ROUNDING_M = 1e-9  # of lengths, and of speeds in m/s
ROUNDING_S = 1e-9  # times are whole nanoseconds
