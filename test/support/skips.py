# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The exceptions to the rule that in CI a skipped test has failed (conftest.py)."""

NO_LAUNCH = "launch and launch_testing, or this package as colcon builds it, are not here: source a Jazzy and install/setup.bash"
"""`launch` is not among the Jazzy wheels."""
NO_RECORDS = "recorded data not here"
"""The tests make data of their own; recorded ones are a second judge, where they are."""
NO_COMPILER = "no C++ compiler, or no headers of the messages beside Python's"
MAY_SKIP = (NO_LAUNCH, NO_RECORDS, NO_COMPILER)
