# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Made encounters with known speeds."""

from collections.abc import Callable

import numpy as np
import pytest

from scenario_gen.types import Encounter, Vehicle


def straight_encounter(speeds: np.ndarray, noise: float = 0.0, seed: int = 0) -> Encounter:
    """Vehicles that drive straight east with the given speeds (N, T)."""
    rng = np.random.default_rng(seed)
    speeds = np.asarray(speeds, dtype=float)
    x = np.cumsum(speeds, axis=1) * 0.1
    position = np.stack([x, np.arange(len(speeds))[:, None] * 10.0 + np.zeros_like(x)], axis=2)
    position += rng.normal(size=position.shape) * noise
    measured = np.maximum(speeds + rng.normal(size=speeds.shape) * noise, 0.0)
    vehicles = tuple(Vehicle(str(i)) for i in range(len(speeds)))
    return Encounter.sampled(vehicles, 0.1, position, np.zeros_like(speeds), measured, "made")


@pytest.fixture(scope="session")
def encounter_of() -> Callable[..., Encounter]:
    """Vehicles that drive straight east with the given speeds (N, T)."""
    return straight_encounter
