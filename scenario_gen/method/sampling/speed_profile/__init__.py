# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The speed profile of a vehicle: knots, spline basis, mean and random deviations."""
