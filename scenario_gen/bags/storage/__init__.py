# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags of rosbag2, MCAP and SQLite, whole and damaged, read with bounds; no message is decoded here."""
