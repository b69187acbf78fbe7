# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The motion of vehicles on one clock; encounters and scenarios are motions."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Self, TYPE_CHECKING

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.road_users import TRAILER
from scenario_gen.numerics import Bools, canonical_heading, Floats, freeze, frozen, Ints, sealed
from scenario_gen.numerics.boxes import corners
from scenario_gen.numerics.hermite import fill_states
from scenario_gen.numerics.rounding import ROUNDING_S
from scenario_gen.types.vehicle import trailer_poses, Vehicle, Vehicles

ALWAYS: Ints = sealed(
    np.zeros((0, 2), dtype=np.int64)
)  # the default of a field `present`: everybody is there throughout


def canonical_presence(present: Ints, count: int, samples: int, name: str) -> Ints:
    """Return the presence (N, 2) of `count` vehicles over `samples` samples; expands `ALWAYS`.

    Args:
        present: (N, 2) first and last sample index of each vehicle, or `ALWAYS`.
        count: N.
        samples: T.
        name: what it belongs to, for the message.

    Raises:
        InputError: the shape is wrong, or they are no whole numbers, or a vehicle has fewer than
            two samples or lies outside of 0 … T - 1.
    """
    if np.shape(present) == (0, 2):
        return sealed(np.tile(np.array([0, samples - 1], dtype=np.int64), (count, 1)))
    if np.asarray(present).dtype.kind not in "iu":
        raise InputError(
            f"{name}: presence is of type {np.asarray(present).dtype}; whole numbers are needed"
        )
    rows = np.array(present, dtype=np.int64, order="C")
    if rows.shape != (count, 2):
        raise InputError(
            f"{name}: presence has shape {rows.shape}; "
            f"{count} rows of first and last sample are needed"
        )
    bad = np.flatnonzero((rows[:, 0] < 0) | (rows[:, 1] >= samples) | (rows[:, 0] >= rows[:, 1]))
    if len(bad):
        first, last = rows[bad[0]].tolist()
        raise InputError(
            f"{name}: row {bad[0]} is present from sample {first} to {last} of {samples}; "
            "at least two samples inside are needed"
        )
    return sealed(rows)


def at_ends(present: Ints, samples: int) -> Bools:
    """Return (N, 2) whether each vehicle is present at the first and the last of T `samples`."""
    return np.asarray(present == (0, samples - 1))


def always(present: Ints, samples: int) -> bool:
    """Return whether all vehicles (N, 2) are present at all T `samples`."""
    return all(row == [0, samples - 1] for row in present.tolist())


def held(values: Floats, present: Ints) -> Floats:
    """Return values (N, T, …) with the first or last one outside of the presence (N, 2)."""
    samples = values.shape[1]
    if always(present, samples):
        return values
    at = np.clip(np.arange(samples), present[:, :1], present[:, 1:])
    return frozen(values[np.arange(len(values))[:, None], at])


def mask(present: Ints, samples: int) -> Bools:
    """Return (N, T) whether each vehicle is present at each sample, of presence (N, 2)."""
    at = np.arange(samples)
    return np.asarray((at >= present[:, :1]) & (at <= present[:, 1:]))


def together(present: Ints, *rows: int) -> slice:
    """Return the samples at which all of these vehicles are present, possibly none."""
    firsts, lasts = zip(*(present[row].tolist() for row in rows), strict=True)
    first = max(firsts)
    return slice(first, max(min(lasts) + 1, first))


def cut(present: Ints, first: int, last: int) -> Ints:
    """Return the presence (N, 2) within samples first … last - 1; empty rows: first > last."""
    inside: Ints = np.column_stack(
        (np.maximum(present[:, 0] - first, 0), np.minimum(present[:, 1], last - 1) - first)
    )
    return inside


if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame, Series


class States(NamedTuple):
    """The states of N vehicles at M times, or, without the axis M, at one time.

    Attributes:
        position: (N, M, 2) metres.
        heading: (N, M) rad.
        speed: (N, M) m/s.
        is_present: (N, M) whether the vehicle is present.
    """

    position: Floats
    heading: Floats
    speed: Floats
    is_present: Bools

    @property
    def poses(self) -> Floats:
        """(N, M, 3) x, y [m], heading [rad]."""
        return np.concatenate([self.position, self.heading[..., None]], axis=-1)


@dataclass(frozen=True, eq=False)
class Motion:
    """N vehicles over T >= 2 samples.

    The motion is defined between two samples, too: position is the cubic Hermite interpolant of
    the two positions and velocity vectors (speed along heading); heading and speed are linear.
    The validity checker proves that motion.

    Attributes:
        vehicles: N identities and footprints.
        time: (T,) seconds, strictly increasing, rounded to nanoseconds.
        position: (N, T, 2) metres, of the footprints' centres.
        heading: (N, T) rad, counter-clockwise from x, continuous in time (unwrapped).
        speed: (N, T) m/s, >= 0.
        present: (N, 2) first and last sample at which each vehicle is present. The rows of the
            arrays hold their first or last value outside of it. Default: always present.

    Example:
        >>> import numpy as np
        >>> position = np.array([[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]])
        >>> heading, speed = np.zeros((1, 3)), np.full((1, 3), 10.0)
        >>> motion = Motion.sampled((Vehicle("a"),), 0.1, position, heading, speed)
        >>> motion.at(0.15).position.round(3)
        array([[1.5, 0. ]])
    """

    vehicles: tuple[Vehicle, ...]
    time: Floats
    position: Floats
    heading: Floats
    speed: Floats
    present: Ints = field(default_factory=lambda: ALWAYS, kw_only=True)

    @classmethod
    def sampled(
        cls,
        vehicles: tuple[Vehicle, ...],
        period: float,
        position: Floats,
        heading: Floats,
        speed: Floats,
        *args: Any,
        **fields: Any,
    ) -> Self:
        """Return a motion that is sampled every `period` [s] from 0 s on."""
        time = frozen(np.arange(np.shape(speed)[-1]) * period)
        return cls(vehicles, time, position, heading, speed, *args, **fields)

    def __post_init__(self) -> None:
        present = canonical_presence(self.present, len(self.vehicles), len(self.time), self.title)
        freeze(
            self,
            vehicles=Vehicles(self.vehicles),
            time=frozen(np.round(self.time, 9)),
            position=held(frozen(self.position), present),
            heading=held(canonical_heading(self.heading), present),
            speed=held(frozen(self.speed), present),
            present=present,
        )

    @property
    def title(self) -> str:
        """Its name in messages."""
        return "motion"

    @property
    def dt(self) -> float:
        """Seconds between the first two samples: the period of an evenly sampled motion."""
        return float(self.time[1] - self.time[0])

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.time[-1] - self.time[0])

    @property
    def ids(self) -> tuple[str, ...]:
        """The ids of the vehicles."""
        return tuple(vehicle.id for vehicle in self.vehicles)

    @property
    def all_present(self) -> bool:
        """Whether every vehicle is always present."""
        return always(self.present, len(self.time))

    @cached_property
    def is_present(self) -> Bools:
        """(N, T) whether each vehicle is present at each sample."""
        return mask(self.present, len(self.time))

    @property
    def poses(self) -> Floats:
        """(N, T, 3) x, y [m], heading [rad]."""
        return np.concatenate([self.position, self.heading[..., None]], axis=-1)

    def present_slice(self, *rows: int) -> slice:
        """Return the samples at which all of these vehicles are present, possibly none."""
        return together(self.present, *rows)

    def at(self, time: Floats | float) -> States:
        """Return the states of all vehicles at times (M,) or at one time [s].

        A vehicle that is not present has its first or last state.
        """
        times = np.atleast_1d(np.asarray(time, dtype=np.float64))
        out = np.empty((len(self.vehicles), len(times), 4))
        arrays = (self.position, self.heading, self.speed)
        fill_states(self.time, *arrays, self.present, times, out)
        first, last = self.time[self.present].T
        is_present = (times >= first[:, None] - ROUNDING_S) & (times <= last[:, None] + ROUNDING_S)
        if np.ndim(time) == 0:
            out, is_present = out[:, 0], is_present[:, 0]
        return States(out[..., :2], out[..., 2], out[..., 3], is_present)

    def resampled(self, dt: float) -> Self:
        """Return the motion sampled every `dt` [s]; a last part shorter than dt is dropped.

        Raises:
            InputError: the motion is shorter than dt.
        """
        count = int(np.floor(self.duration / dt + 1e-6)) + 1
        if count < 2:
            raise InputError(
                f"{self.title} lasts {self.duration:g} s, "
                f"shorter than the sampling period of {dt:g} s"
            )
        return self.at_times(np.minimum(self.time[0] + np.arange(count) * dt, self.time[-1]))

    def with_samples(self, count: int) -> Self:
        """Return the motion at `count` times spread evenly from its start to its end."""
        return self.at_times(np.linspace(self.time[0], self.time[-1], count))

    def at_times(self, time: Floats) -> Self:
        """Return the motion sampled at other times (M,) [s] within it; M >= 2.

        A vehicle has two samples at least, be its presence ever so short.
        """
        is_same = self.time.shape == time.shape
        if is_same and np.abs(time - self.time).max() <= ROUNDING_S:
            return self
        ends = self.time[self.present]
        first = np.searchsorted(time, ends[:, 0] - ROUNDING_S)
        last = np.searchsorted(time, ends[:, 1] + ROUNDING_S, side="right") - 1
        first = np.minimum(first, len(time) - 2)
        present = np.column_stack([first, np.maximum(last, first + 1)])
        return replace(self, time=time, present=present, **self._arrays_at(time))

    def _arrays_at(self, time: Floats) -> dict[str, Any]:
        """Return the arrays at times (M,) [s], by field."""
        states = self.at(time)
        return {"position": states.position, "heading": states.heading, "speed": states.speed}

    def between(self, first: int, last: int) -> Self:
        """Return the motion from sample `first` to sample `last`, as `select` does."""
        return self.select(range(len(self.vehicles)), first, last)

    def select(self, rows: Sequence[int], first: int = 0, last: int | None = None) -> Self:
        """Return some vehicles, in this order, from sample `first` to `last` (default: the end).

        The clock of the result starts at 0 s.

        Raises:
            InputError: a vehicle has less than two samples there.
        """
        last = len(self.time) - 1 if last is None else last
        chosen, part = list(rows), slice(first, last + 1)
        return replace(
            self,
            vehicles=tuple(self.vehicles[n] for n in chosen),
            time=self.time[part] - self.time[first],
            present=np.clip(self.present[chosen] - first, 0, last - first),
            **{name: getattr(self, name)[chosen, part] for name in self.array_names},
        )

    def of_vehicles(self, rows: Sequence[int]) -> "Motion":
        """Return the motion of some vehicles, in this order, on the same clock."""
        chosen = list(rows)
        vehicles = tuple(self.vehicles[n] for n in chosen)
        arrays = (self.position[chosen], self.heading[chosen], self.speed[chosen])
        return Motion(vehicles, self.time, *arrays, present=self.present[chosen])

    def pair(self, i: int, j: int) -> "Motion":
        """Return the motion of two vehicles while both are present, on the same clock.

        Raises:
            InputError: they have less than two common samples.
        """
        both = self.present_slice(i, j)
        rows = [i, j]
        return Motion(
            (self.vehicles[i], self.vehicles[j]),
            self.time[both],
            self.position[rows, both],
            self.heading[rows, both],
            self.speed[rows, both],
        )

    @property
    def array_names(self) -> tuple[str, ...]:
        """The names of the arrays (N, T, ...)."""
        return ("position", "heading", "speed")

    def with_trailers(self) -> Self:
        """Return the motion in which every trailer is a vehicle, too, after all others.

        A trailer begins straight behind the vehicle that tows it.
        """
        towing = [
            n
            for n, vehicle in enumerate(self.vehicles)
            if vehicle.trailer is not None and vehicle.trailer.id not in self.ids
        ]
        if not towing:
            return self
        trailers, towed = zip(*(_trailer_motion(self, n) for n in towing), strict=True)
        arrays = {}
        for name in self.array_names:
            rows = getattr(self, name)
            added = [values.get(name, rows[n]) for n, values in zip(towing, towed, strict=True)]
            arrays[name] = np.concatenate([rows, added])
        present = np.concatenate([self.present, self.present[towing]])
        return replace(self, vehicles=self.vehicles + trailers, present=present, **arrays)

    @property
    def owners(self) -> tuple[int, ...]:
        """The index of each vehicle itself, or for a trailer, of the vehicle that tows it."""
        towing = {v.trailer.id: n for n, v in enumerate(self.vehicles) if v.trailer}
        return tuple(towing.get(name, n) for n, name in enumerate(self.ids))

    @property
    def towed(self) -> list[tuple[int, int]]:
        """The index of each trailer, and of the vehicle that tows it."""
        return [(n, owner) for n, owner in enumerate(self.owners) if owner != n]

    def footprints(self, k: int) -> Floats:
        """Return the corners (N, 4, 2) [m] of all vehicles at sample k.

        They are in counter-clockwise order from the front left one.
        """
        poses = self.poses[:, k]
        return np.concatenate(
            [
                corners(pose[None], vehicle.length, vehicle.width)
                for pose, vehicle in zip(poses, self.vehicles, strict=True)
            ]
        )

    def columns(self) -> dict[str, Any]:
        """Return the columns of its table: a row for each vehicle and sample with it present."""
        row, sample = np.nonzero(self.is_present)
        ids = np.array(self.ids, dtype=object)
        return {
            "vehicle": ids[row],
            "time": self.time[sample],
            "x": self.position[row, sample, 0],
            "y": self.position[row, sample, 1],
            "heading": self.heading[row, sample],
            "speed": self.speed[row, sample],
        }

    def to_dataframe(self) -> "DataFrame":
        """Return a table with a row for each vehicle and each sample at which it is present.

        Columns: vehicle (id), time [s], x, y [m], heading [rad], speed [m/s]. `read_log` reads
            such tables.
        """
        import pandas as pd

        return pd.DataFrame(self.columns())

    def __getitem__(self, vehicle: str | int) -> "DataFrame":
        """Return the rows of `to_dataframe` of one vehicle, by its id or index.

        Raises:
            InputError: there is no such vehicle.
            IndexError: there is no vehicle with this index.
        """
        table = self.to_dataframe()
        rows = table.vehicle == Vehicles(self.vehicles)[vehicle].id
        return table[rows].reset_index(drop=True)

    def measures(self) -> "Series[float]":
        """Return how critical it is, with the columns of `scenario_gen.measures` as names."""
        import scenario_gen

        return scenario_gen.measures([self]).iloc[0]

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the vehicles' paths, as `scenario_gen.plot` does.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        import scenario_gen

        return scenario_gen.plot(self, ax)


def _trailer_motion(motion: Motion, n: int) -> tuple[Vehicle, dict[str, Floats]]:
    """Return the trailer of vehicle n, and its arrays (T, ...) by field."""
    trailer = motion.vehicles[n].trailer
    assert trailer is not None
    poses = trailer_poses(motion.poses[n], trailer)
    bend = motion.heading[n] - poses[:, 2]
    sideways = trailer.hitch * np.gradient(motion.heading[n], motion.time) * np.sin(bend)
    towed = {
        "position": poses[:, :2],
        "heading": poses[:, 2],
        "speed": np.maximum(motion.speed[n] * np.cos(bend) + sideways, 0.0),
    }
    return Vehicle(trailer.id, trailer.length, trailer.width, TRAILER), towed
