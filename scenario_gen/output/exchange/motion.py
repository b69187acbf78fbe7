# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A scenario's motion at other instants, and one vehicle of it apart from the others."""

from dataclasses import replace

import numpy as np

from scenario_gen.numerics import Floats, Ints
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
    k = np.clip(np.searchsorted(scenario.time, time, side="right") - 1, 0, len(scenario.time) - 2)
    length = (scenario.time[k + 1] - scenario.time[k])[None, :]
    u = (time - scenario.time[k])[None, :] / length
    velocity = _velocity(scenario)
    h00, h10 = (1.0 + 2.0 * u) * (1.0 - u) * (1.0 - u), u * (1.0 - u) * (1.0 - u)
    h01, h11 = u * u * (3.0 - 2.0 * u), u * u * (u - 1.0)
    position = (
        h00[..., None] * scenario.position[:, k]
        + (h10 * length)[..., None] * velocity[:, k]
        + h01[..., None] * scenario.position[:, k + 1]
        + (h11 * length)[..., None] * velocity[:, k + 1]
    )

    def linear(values: Floats) -> Floats:
        return values[:, k] + u * (values[:, k + 1] - values[:, k])

    return replace(
        scenario,
        time=time,
        position=position,
        heading=linear(scenario.heading),
        speed=np.maximum(linear(scenario.speed), 0.0),
        acceleration=linear(scenario.acceleration),
        present=_presence(scenario, time),
    )


def _velocity(scenario: Scenario) -> Floats:
    """Return velocities (N, T, 2) [m/s] along the headings."""
    speed, heading = scenario.speed, scenario.heading
    return np.stack((speed * np.cos(heading), speed * np.sin(heading)), axis=-1)


def _presence(scenario: Scenario, time: Floats) -> Ints:
    """Return the presence (N, 2) at other instants (M,) [s]: those within the vehicle's own first and last."""
    ends = scenario.time[scenario.present]
    first = np.searchsorted(time, ends[:, 0] - EVEN)
    last = np.searchsorted(time, ends[:, 1] + EVEN, side="right") - 1
    return np.column_stack((first, last)).astype(np.int64)
