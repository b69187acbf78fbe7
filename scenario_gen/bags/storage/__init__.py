# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags of rosbag2 and ROS 1, whole or damaged, read within bounds; messages stay encoded."""
