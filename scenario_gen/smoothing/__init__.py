# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The path and the motion of a vehicle, fitted to what was recorded of it."""
