# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""An example of everything that a package can add to scenario_gen, one file a kind."""
