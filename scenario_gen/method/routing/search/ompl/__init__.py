# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OMPL's planners, as an option: a package of their own, since importing OMPL is slow."""
