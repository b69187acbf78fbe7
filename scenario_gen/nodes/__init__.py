"""ROS 2 nodes: thin shells over the stage functions, and the only place that imports rclpy."""

import os
import sys

# The Jazzy wheels do not set it, and rcl finds nothing without it.
os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
