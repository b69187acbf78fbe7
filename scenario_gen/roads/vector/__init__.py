# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Vector maps (Lanelet2, OpenDRIVE, CommonRoad), and placements of recordings on their lanes."""
