# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings: the messages of the suite in bags, and their requests by `scenarios/info`."""

from scenario_gen.base.errors import needs

needs("bags", "lz4", "mcap", "rosbags", "zstandard")
