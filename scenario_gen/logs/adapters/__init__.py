# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Public recordings and perception bags: one table of columns and units per format, with the source of its definition."""
