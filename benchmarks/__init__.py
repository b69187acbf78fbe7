# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Benchmarks of each stage beside the best installable peer, measured in the same run, in CPU time, as ratios."""
