# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One vehicle apart from the others: the slot of an ego, and both together again."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from scenario_gen.numerics import Floats, Ints
from scenario_gen.types.scenario import Scenario

_ROWS = ("position", "heading", "speed", "acceleration")


def split_off(scenario: Scenario, index: int) -> tuple[Scenario, Scenario]:
    """Return a scenario of all vehicles but one, and one of that one, both on the same clock."""
    rows = [n for n in range(len(scenario.vehicles)) if n != index]
    return _of(scenario, rows), _of(scenario, [index])


def with_witness(scenario: Scenario, index: int) -> Scenario:
    """Return the scenario without one vehicle, whose motion becomes the reference drive.

    It ends when the last of the other vehicles leaves.
    """
    others, witness = split_off(scenario, index)
    last = int(others.present[:, 1].max()) + 1
    arrays = {name: getattr(others, name)[:, :last] for name in _ROWS}
    return replace(others, time=others.time[:last], **arrays, reference_drive=witness)


def join_ego(scenario: Scenario) -> Scenario:
    """Return the scenario of all vehicles, that of the reference drive last, if there is one."""
    witness = scenario.reference_drive
    if witness is None:
        return scenario
    parts = (replace(scenario, reference_drive=None), witness)
    time = np.unique(
        np.concatenate([part.time for part in parts])
    )  # whole nanoseconds, so equal instants are equal
    vehicles = (*scenario.vehicles, *witness.vehicles)
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name)[:, _held(part, time)] for part in parts])
        for name in _ROWS
    }
    present = np.concatenate([np.searchsorted(time, part.time[part.present]) for part in parts])
    return replace(parts[0], vehicles=vehicles, time=time, **arrays, present=present)


def _held(part: Scenario, time: Floats) -> Ints:
    """Return the sample of a part at each time (T,) [s]; arbitrary where nobody is present."""
    return np.minimum(np.searchsorted(part.time, time), len(part.time) - 1)


def _of(scenario: Scenario, rows: Sequence[int]) -> Scenario:
    arrays = {name: getattr(scenario, name)[list(rows)] for name in (*_ROWS, "present")}
    return replace(scenario, vehicles=tuple(scenario.vehicles[n] for n in rows), **arrays)
