# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios for other software: CommonRoad, OpenSCENARIO with OpenDRIVE, and Autoware; and their trajectories back as a log."""
