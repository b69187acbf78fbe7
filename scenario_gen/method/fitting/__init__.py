# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Changepoints -> the target road (paper III-A, eqs 7-9 put right)."""

from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.fit import fit_template, LostEncounterError

__all__ = [
    "FittingConfig", "LostEncounterError", "fit_template",
]  # fmt: skip
