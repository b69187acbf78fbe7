# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Vector maps: Lanelet2, OpenDRIVE and CommonRoad, each read into a `LaneNetwork`; and the grid that is drawn from it."""
