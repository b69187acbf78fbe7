# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Names and checks that nodes and launch files share; `ros2 launch` has no numba."""

import re

from scenario_gen.base.errors import InputError

ROAD_NAMES = (
    "straight",
    "curve",
    "t_intersection",
    "four_way",
    "merge",
    "roundabout",
    "corridor",
)


def check_topics(expression: str) -> None:
    """Raise InputError if the parameter `topics` is no regular expression that matches fast."""
    try:
        re.compile(expression)
    except re.error as error:
        raise InputError(f"parameter topics is no regular expression: {error}") from None
    if re.search(r"\([^()]*[*+}][^()]*\)[*+{]", expression):
        raise InputError(
            "parameter topics repeats a repetition, as in (a+)+: matching may take hours; "
            "write it with one repetition"
        )
