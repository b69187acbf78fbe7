# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Names of the rows of an evaluation: recording, generated set and references."""

RECORDING = "recording"
"""The recorded encounter itself."""
WITH, WITHOUT, UNIFORM = "with changepoints", "without changepoints", "uniform changepoints"
NARROW = "with changepoints, narrow"
REPLAY = "replay"
"""The recording as fitted to the road."""
