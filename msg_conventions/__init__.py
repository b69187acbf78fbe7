# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Message ⇄ domain type: the one place where a message is made or read, straight between arrays and CDR bytes, without ROS."""
