# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The independent checker: valid at every instant, or refused with the cause."""

from scenario_gen.method.validity.checker import Checker
from scenario_gen.method.validity.collision import first_contacts
from scenario_gen.method.validity.containment import first_exits, Ground
from scenario_gen.method.validity.cubic import Proof
from scenario_gen.method.validity.limits import Limits
from scenario_gen.method.validity.template_checks import allowed_gap

__all__ = ["Checker", "Ground", "Limits", "Proof", "allowed_gap", "first_contacts", "first_exits"]
