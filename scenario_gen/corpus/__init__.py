# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Many encounters: archives mined for them, libraries of primitives, scenarios by the thousand, and how they are found again."""
