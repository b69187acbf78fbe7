# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Arrays, curves, compiled kernels, and `exact`, the one door to arithmetic that is the same on every CPU; nothing of traffic."""
