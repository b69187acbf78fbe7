# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Names of the rows of an evaluation: the recording, what was generated, and what it is measured against."""

from scenario_gen.base.renaming import warn_renamed

RECORDING = "recording"
"""The recorded encounter itself."""
WITH, WITHOUT, UNIFORM = "with changepoints", "without changepoints", "uniform changepoints"
NARROW = "with changepoints, narrow"
REPLAY = "replay"
"""The recording as fitted to the road."""
FORMER = {"oracle": REPLAY, "template": RECORDING}  # names of rows before version 0.7


def row_name(name: str) -> str:
    """Return the name of a row; of one that had another name in an earlier version the new one, with a warning."""
    if name in FORMER:
        warn_renamed(f"row {name!r} of an evaluation", repr(FORMER[name]), stacklevel=3)
    return FORMER.get(name, name)
