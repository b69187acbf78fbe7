# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sources stay within the budget of counts.py."""

from counts import BUDGET, totals


def test_the_budget_holds():
    counts = totals()
    over = {
        name: f"{counts[name]:,} of {most:,}"
        for name, most in BUDGET.items()
        if counts[name] > most
    }
    assert not over, f"{over}: remove as much as the change adds, or raise BUDGET and say why"
