# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The bundled logs: recorded ones and invented ones, the paper's cases (V-A, Fig. 3) among them.

`resources/recorded/README.md` names the sources and licences of the recorded logs.
"""

from pathlib import Path

RECORDED = ("ngsim_left_turn", "ngsim_two_left_turns", "v2x_following")
CASES = ("a", "b", "c")
DRAWN = ("left_turn", "follower", "all_way_stop")  # drawn by docs/demo_encounters.py
RESOURCES = Path(__file__).resolve().parents[1] / "resources"


def bundled(case: str) -> Path:
    """Return the path of a bundled log: a table of `RECORDED` or `DRAWN`, or a bag of `CASES`.

    Raises:
        ValueError: there is no such log.
    """
    if case in RECORDED:
        return RESOURCES / "recorded" / f"{case}.csv"
    if case in DRAWN:
        return RESOURCES / "demo" / f"{case}.csv"
    if case in CASES:
        return RESOURCES / f"synthetic_{case}"
    names = ", ".join(RECORDED + CASES + DRAWN)
    raise ValueError(f"there is no bundled log {case!r}; choose one of {names}")
