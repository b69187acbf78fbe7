# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounters and scenarios brought to one form, so that every metric treats the recorded and the generated alike."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Floats, frozen, frozen_ints, Ints
from scenario_gen.types import (
    ALWAYS,
    always,
    Encounter,
    mask,
    once_per_object,
    Scenario,
    together,
    Vehicle,
)

COMMON = 1.0
"""Seconds that two vehicles must be there together to be compared."""


@dataclass(frozen=True, eq=False)
class Motion:
    """N vehicles on a uniform clock.

    Attributes:
        vehicles: N identities and footprints.
        dt: sampling period [s].
        position: (N, T, 2) metres.
        heading: (N, T) rad, unwrapped.
        speed: (N, T) m/s.
        present: (N, 2) first and last instant at which each vehicle is there, at least two; default: everybody throughout.
    """

    vehicles: tuple[Vehicle, ...]
    dt: float
    position: Floats
    heading: Floats
    speed: Floats
    present: Ints = field(default_factory=lambda: ALWAYS)

    def __post_init__(self) -> None:
        if not len(self.present):
            object.__setattr__(
                self,
                "present",
                np.tile(np.array([0, self.speed.shape[1] - 1]), (len(self.speed), 1)),
            )

    @property
    def always(self) -> bool:
        """Whether every vehicle is there throughout."""
        return always(self.present, self.speed.shape[1])

    @property
    def is_present(self) -> Bools:
        """(N, T) whether each vehicle is there at each instant."""
        return mask(self.present, self.speed.shape[1])

    def own(self, n: int) -> slice:
        """The instants at which vehicle n is there."""
        return together(self.present, n, n)

    def together(self, a: int, b: int) -> slice:
        """The instants at which vehicles a and b are both there."""
        return together(self.present, a, b)

    @property
    def time(self) -> Floats:
        """(T,) seconds from the start."""
        return frozen(np.arange(self.speed.shape[1]) * self.dt)


@once_per_object
def at_period(source: Encounter | Scenario, dt: float) -> Motion:
    """Bring an encounter or a scenario to the period dt [s] (a tail shorter than dt is left out).

    What is on that clock already passes through untouched; the rest is interpolated linearly.

    Raises:
        InputError: it is shorter than dt.
    """
    count = int(np.floor(source.time[-1] / dt + 1e-6)) + 1
    if count < 2:
        name = (
            f"encounter {source.name!r}"
            if isinstance(source, Encounter)
            else f"scenario {source.index}"
        )
        raise InputError(
            f"{name} lasts {source.time[-1]:g} s, shorter than evaluation.period ({dt:g} s)"
        )
    return _motion(source, np.minimum(np.arange(count) * dt, source.time[-1]), dt)


def at_count(source: Encounter | Scenario, count: int) -> Motion:
    """Bring an encounter or a scenario to `count` instants spread evenly from its start to its end."""
    duration = float(source.time[-1])
    return _motion(source, np.linspace(0.0, duration, count), duration / (count - 1))


def at_common(source: Encounter | Scenario, pair: tuple[str, str], count: int) -> Motion | None:
    """Bring two vehicles, by their ids, to `count` instants spread evenly over the time in which both are there.

    None if that is less than COMMON seconds.
    """
    ids = [vehicle.id for vehicle in source.vehicles]
    rows = [ids.index(name) for name in pair]
    both = together(source.present, rows[0], rows[1])
    if both.stop - both.start < 2 or source.time[both.stop - 1] - source.time[both.start] < COMMON:
        return None
    first, last = source.time[both.start], source.time[both.stop - 1]
    return of_vehicles(
        _motion(source, np.linspace(first, last, count), float(last - first) / (count - 1)), rows
    )


def _motion(source: Encounter | Scenario, time: Floats, dt: float) -> Motion:
    if time.shape == source.time.shape and np.allclose(time, source.time, rtol=0.0, atol=1e-9):
        return Motion(
            source.vehicles, dt, source.position, source.heading, source.speed, source.present
        )

    def interpolated(values: Floats) -> Floats:
        return frozen([np.interp(time, source.time, row) for row in values])

    position = np.stack([interpolated(source.position[..., axis]) for axis in (0, 1)], axis=-1)
    heading, speed = interpolated(source.heading), interpolated(source.speed)
    present = ALWAYS
    if not source.all_present:
        there = source.time[source.present]
        first = np.minimum(np.searchsorted(time, there[:, 0] - 1e-9), len(time) - 2)
        last = np.searchsorted(time, there[:, 1] + 1e-9, side="right") - 1
        present = frozen_ints(np.column_stack([first, np.maximum(last, first + 1)]))
    return Motion(source.vehicles, dt, frozen(position), heading, speed, present)


def of_vehicles(motion: Motion, rows: Sequence[int]) -> Motion:
    """Return the motion of some vehicles, in that order."""
    if list(rows) == list(range(len(motion.vehicles))):
        return motion
    at = list(rows)
    names = tuple(motion.vehicles[n] for n in at)
    return Motion(
        names,
        motion.dt,
        motion.position[at],
        motion.heading[at],
        motion.speed[at],
        motion.present[at],
    )


def stacked(motions: Sequence[Motion]) -> tuple[Floats, Floats, Floats]:
    """Stack S motions of equal T: positions (S, N, T, 2) [m], speeds [m/s] and headings [rad], both (S, N, T)."""
    position, speed, heading = (
        [getattr(motion, name) for motion in motions] for name in ("position", "speed", "heading")
    )
    return np.stack(position), np.stack(speed), np.stack(heading)
