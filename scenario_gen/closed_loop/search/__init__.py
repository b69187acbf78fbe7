# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Failure search: the scenarios in which a planner fails, and the rate at which it does."""
