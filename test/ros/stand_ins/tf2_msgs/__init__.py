# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Stands for tf2_msgs, which is not among the Jazzy wheels: frames are published and heard as bytes, so any type does."""
