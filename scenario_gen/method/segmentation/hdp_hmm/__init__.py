# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sticky HDP-HMM with autoregressive emissions, for any series of numbers."""
