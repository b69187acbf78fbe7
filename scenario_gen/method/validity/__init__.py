# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The independent checker: valid at every instant, or refused with the cause (docs/validity.md)."""

from scenario_gen.method.validity.checker import Checker
from scenario_gen.method.validity.dynamics import control_points
from scenario_gen.method.validity.limits import Limits

__all__ = [
    "Checker", "Limits", "control_points",
]  # fmt: skip
