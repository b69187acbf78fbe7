# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A task for worker processes, in a module that loads next to nothing."""

from scenario_gen.base.errors import InputError


def refuse(name):
    if name == "b":
        raise InputError(f"{name} is none")
    if name == "c":
        raise KeyError(name)
