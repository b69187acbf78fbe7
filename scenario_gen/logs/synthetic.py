# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The bundled logs: the paper's three cases (V-A, Fig. 3), invented and called synthetic everywhere (docs/logs.md)."""

from pathlib import Path

CASES = ("a", "b", "c")
RESOURCES = Path(__file__).resolve().parents[1] / "resources"


def bundled(case: str) -> Path:
    """Return the path of the bundled bag of case "a", "b" or "c".

    Raises:
        ValueError: there is no such case.
    """
    if case not in CASES:
        raise ValueError(f"there is no case {case!r}; choose one of {', '.join(CASES)}")
    return RESOURCES / f"synthetic_{case}"
