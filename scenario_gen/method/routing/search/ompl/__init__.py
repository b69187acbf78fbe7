# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OMPL's planners, for users who choose one of them: apart, because OMPL takes half a second to import."""
