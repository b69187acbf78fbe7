# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""TFMessage by another type."""

from geometry_msgs.msg import TransformStamped as TFMessage

__all__ = ["TFMessage"]
