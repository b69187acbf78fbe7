# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sources stay within the budget of counts.py."""

from counts import BUDGET, totals


def test_the_budget_holds():
    found = totals()
    over = {
        name: f"{found[name]:,} of {most:,}" for name, most in BUDGET.items() if found[name] > most
    }
    assert not over, (
        f"{over}: delete as much as the change adds, or raise BUDGET in counts.py and say why in the commit"
    )
