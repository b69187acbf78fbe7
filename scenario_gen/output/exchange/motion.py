# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A scenario's motion at other instants, and one vehicle of it apart from the others."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.plane import unit
from scenario_gen.types import Scenario

EVEN = 1e-9  # seconds by which steps may differ and still be one


def even_step(scenario: Scenario) -> float | None:
    """Return the one step [s] between the scenario's instants; None if there are several."""
    steps = np.diff(scenario.time)
    return float(np.round(steps[0], 9)) if np.ptp(steps) <= EVEN else None


def at_even_steps(scenario: Scenario, step: float) -> Scenario:
    """Return the scenario at 0, step, 2 step, … [s], as far as it lasts, by its own interpolation (`Scenario` defines it)."""
    count = int(np.floor(scenario.time[-1] / step + 1e-6)) + 1
    time = np.minimum(np.round(np.arange(count) * step, 9), scenario.time[-1])
    return at_times(scenario, time)


def at_times(scenario: Scenario, time: Floats) -> Scenario:
    """Return the scenario at instants (M,) [s] within it: cubic Hermite positions, linear headings, speeds and accelerations."""
    velocity = scenario.speed[..., None] * unit(scenario.heading)

    def linear(values: Floats) -> Floats:
        return np.stack([np.interp(time, scenario.time, row) for row in values])

    return replace(
        scenario,
        time=time,
        position=CubicHermiteSpline(scenario.time, scenario.position, velocity, axis=1)(time),
        heading=linear(scenario.heading),
        speed=linear(scenario.speed),
        acceleration=linear(scenario.acceleration),
        present=_presence(scenario, time),
    )


def _presence(scenario: Scenario, time: Floats) -> Ints:
    """Return the presence (N, 2) at other instants (M,) [s]: those within the vehicle's own first and last."""
    ends = scenario.time[scenario.present]
    first = np.searchsorted(time, ends[:, 0] - EVEN)
    last = np.searchsorted(time, ends[:, 1] + EVEN, side="right") - 1
    return np.column_stack((first, last)).astype(np.int64)
