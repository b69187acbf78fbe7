# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tests of planners in certified scenarios (docs/closed_loop.md), without ROS."""
