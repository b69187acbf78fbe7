# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Geometric planners between two points: RRT*-Connect, and those of OMPL."""
