# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Message ⇄ domain type.

All messages are written and read here, directly between arrays and CDR bytes, without ROS.
"""
