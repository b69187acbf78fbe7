# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The nodes by name. `nodes/` has a file for each, and pyproject.toml an executable for each.

Subscribers start before publishers. This module needs no ROS: launch files and tests import it.
"""

GENERATORS = ("gp_sampler", "planner", "segmenter", "road_server", "log_player")
"""The nodes that generate scenarios from a log."""

SUITE = ("recorder", "evaluator", "preview", *GENERATORS)
"""The nodes that run together."""

COMPOSABLE = (*SUITE, "player")
"""The nodes that `suite --nodes` can run in one process."""

ALL = (*COMPOSABLE, "traffic")
"""Every node."""

RECORDER_END_S = 35.0
"""In which a recorder closes its bag; launch must not end it before."""
