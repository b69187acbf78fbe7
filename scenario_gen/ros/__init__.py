# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""ROS 2: the nodes, and what they share; the only place that imports rclpy."""

import os
import sys

# The Jazzy wheels do not set it, and rcl finds nothing without it.
os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
