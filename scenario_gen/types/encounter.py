# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A recorded encounter: N vehicles near each other on one clock (paper II-A, eqs 1-2)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
import re
from typing import Self

import numpy as np

from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.numerics import Floats, freeze
from scenario_gen.types.decision import Decision
from scenario_gen.types.html import html_table
from scenario_gen.types.motion import Motion
from scenario_gen.types.traffic_light import TrafficLight

MAX_UNEVEN_S = 1e-6  # a time may differ by this from a whole multiple of the period


@dataclass(frozen=True)
class Recorded:
    """Source of an encounter: its vehicles were recorded together."""


@dataclass(frozen=True)
class Decided:
    """Source of an encounter: two recorded vehicles with the outcome of a decision.

    Attributes:
        encounter: name of the recorded encounter.
        decision: its outcome here, as recorded or another one.
        recorded: the recorded encounter, if it is known.
    """

    encounter: str
    decision: Decision
    recorded: "Encounter | None" = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, eq=False)
class Encounter(Motion):
    """The evenly sampled, finite motion of N >= 2 vehicles in a local east-north frame.

    Attributes:
        name: where it comes from, for people.
        start_ns: stamp of the first sample, nanoseconds on the log's clock.
        origin: (latitude, longitude) in degrees of the frame's origin, or None if the log is in
            metres.
        source: whether its vehicles were recorded together.
        lights: traffic lights whose states were recorded, in the encounter's frame.

    Raises:
        InputError: shapes disagree, a value is not finite, a speed is negative, ids repeat, the
            sampling is uneven, or no vehicle is present at the first or at the last sample.
    """

    name: str
    start_ns: int = 0
    origin: tuple[float, float] | None = None
    source: Recorded | Decided = Recorded()
    lights: tuple[TrafficLight, ...] = ()

    def __post_init__(self) -> None:
        _check_arrays(self)
        times = np.arange(len(self.time)) * (self.dt_ns * 1e-9)
        if np.abs(self.time - times).max() > MAX_UNEVEN_S:
            raise InputError(f"{self.title}: its samples are not evenly spaced from 0 s on")
        freeze(self, time=times)
        super().__post_init__()
        if self.present[:, 0].min() > 0 or self.present[:, 1].max() < len(self.time) - 1:
            raise InputError(
                f"{self.title}: nobody is present at its first or at its last sample; "
                "cut it to its vehicles"
            )

    def __repr__(self) -> str:
        return f"Encounter({self.name!r}, {len(self.vehicles)} vehicles, {self.duration:.1f} s)"

    def _repr_html_(self) -> str:
        """Return a table of the vehicles for a notebook."""
        rows = [("vehicle", "type", "size", "present", "mean speed")]
        for k, (vehicle, present) in enumerate(zip(self.vehicles, self.present, strict=True)):
            first, last = self.time[present]
            speed = self.speed[k, self.present_slice(k)].mean()
            rows.append(
                (
                    vehicle.id,
                    vehicle.type,
                    f"{vehicle.length:g} x {vehicle.width:g} m",
                    f"{first:.1f} to {last:.1f} s",
                    f"{speed:.1f} m/s",
                )
            )
        return html_table(repr(self), rows)

    @property
    def title(self) -> str:
        """Its name in messages."""
        return f"encounter {self.name}"

    @property
    def reactions(self) -> tuple[str, ...]:
        """Who reacts to whom, in sentences."""
        import scenario_gen

        return scenario_gen.Situation.of(self).reactions.sentences(self.vehicles)

    @property
    def kind(self) -> str:
        """What its first two vehicles do, e.g. "left_turn", a value of `EncounterKind`.

        `scenario_gen.Situation.of(encounter).kind(a, b)` returns the kind of any two.
        """
        import scenario_gen

        return str(scenario_gen.Situation.of(self).kind(0, 1))

    @property
    def decision(self) -> Decision | None:
        """The decision with which it was made; None unless its source is `Decided`."""
        return self.source.decision if isinstance(self.source, Decided) else None

    @property
    def recording(self) -> str:
        """Name of the recorded encounter that it is an outcome of; else its own name."""
        return self.source.encounter if isinstance(self.source, Decided) else self.name

    @property
    def made(self) -> str:
        """How its motion came about: "recorded", or "decided" if its decision changed it."""
        return "recorded" if self.name == self.recording else "decided"

    @property
    def dt_ns(self) -> int:
        """Sampling period in nanoseconds (100_000_000 for 10 Hz)."""
        return round(float(self.time[-1]) * 1e9 / (len(self.time) - 1))

    def select(self, rows: Sequence[int], first: int = 0, last: int | None = None) -> Self:
        """Return some vehicles between two samples, as `Motion.select` does."""
        start_ns = self.start_ns + first * self.dt_ns
        by = -float(self.time[first])
        lights = tuple(light.retimed(lambda times: times + by) for light in self.lights)
        return replace(super().select(rows, first, last), start_ns=start_ns, lights=lights)


def _check_arrays(encounter: Encounter) -> None:
    """Refuse arrays that are not those of an encounter."""
    n, t = np.shape(encounter.speed)
    if n < 2 or t < 2:
        raise InputError(
            f"{encounter.title} has {n} vehicle(s) and {t} sample(s); "
            "at least 2 of each are needed"
        )
    shapes = (np.shape(encounter.position), np.shape(encounter.heading), np.shape(encounter.time))
    if shapes != ((n, t, 2), (n, t), (t,)) or len(encounter.vehicles) != n:
        raise InputError(f"{encounter.title}: arrays disagree in shape")
    arrays: tuple[Floats, ...] = (encounter.position, encounter.heading, encounter.speed)
    if not all(np.isfinite(values).all() for values in arrays):
        raise InputError(f"{encounter.title} holds a value that is not finite")
    if (np.asarray(encounter.speed) < 0.0).any():
        raise InputError(f"{encounter.title} holds a negative speed")
    ids = encounter.ids
    if len(set(ids)) != n:
        raise InputError(f"{encounter.title}: vehicle ids are not unique: {', '.join(ids)}")


def token(vehicle_id: str) -> str:
    """Return `vehicle_id` as a ROS name token: other characters become one underscore.

    Raises:
        InputError: nothing is left of the id.
    """
    escaped = re.sub(r"_+", "_", re.sub(r"[^0-9A-Za-z_]", "_", vehicle_id)).strip("_")
    if not escaped:
        raise InputError(
            f"vehicle id {vehicle_id!r} holds no letter or digit, so no ROS name can be made of it"
        )
    return escaped


def tokens(vehicle_ids: Iterable[str]) -> tuple[str, ...]:
    """Return the tokens of several ids.

    Raises:
        InputError: two ids become the same token.
    """
    owner: dict[str, str] = {}
    for vehicle_id in vehicle_ids:
        other = owner.setdefault(token(vehicle_id), vehicle_id)
        if other != vehicle_id:
            raise InputError(
                f"vehicle ids {other!r} and {vehicle_id!r} are both {token(vehicle_id)!r} "
                "as ROS names; rename one"
            )
    return tuple(owner)


def vehicle_index(encounter: Encounter, name: str, parameter: str) -> int:
    """Return the index of the vehicle with the id `name`, written as in the log or as a ROS name.

    Raises:
        InputError: there is no such vehicle; the message names `parameter` and lists the ids.
    """
    ids = encounter.ids
    for known in (ids, list(tokens(ids))):
        if name in known:
            return known.index(name)
    raise InputError(
        f"{parameter}: no vehicle {name!r} in {encounter.name}; "
        f"there are: {', '.join(ids)}{did_you_mean(name, ids)}"
    )
