# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The speed profile of a vehicle: its knots, the stops it keeps, and the quadratic program that finds it."""
