# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The bundled synthetic logs: the paper's three cases (V-A, Fig. 3) and the demo's encounters."""

from pathlib import Path

CASES = ("a", "b", "c")
DEMO = ("left_turn", "follower", "all_way_stop")  # drawn by docs/demo_encounters.py
RESOURCES = Path(__file__).resolve().parents[1] / "resources"


def bundled(case: str) -> Path:
    """Return the path of a bundled log: the bag of one of `CASES`, or the table of one of `DEMO`.

    Raises:
        ValueError: there is no such case.
    """
    if case not in CASES + DEMO:
        raise ValueError(f"there is no case {case!r}; choose one of {', '.join(CASES + DEMO)}")
    if case in DEMO:
        return RESOURCES / "demo" / f"{case}.csv"
    return RESOURCES / f"synthetic_{case}"
