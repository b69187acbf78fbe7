# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner under test among the vehicles of a certified scenario (docs/closed_loop.md); no ROS."""
