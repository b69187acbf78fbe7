# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Readers of public recordings and perception bags, each with the source of its definition."""
