"""What drivers do to each other: waits, conflicts, and who goes first (definitions of docs/method.md)."""

from dataclasses import dataclass

from scenario_gen.arrays import Floats
from scenario_gen.encounter import Encounter, Vehicle


@dataclass(frozen=True)
class Wait:
    """Vehicle `vehicle` stands from `start` to `end` [s]: smoothed speed below 0.5 m/s for at least 1 s."""

    vehicle: int
    start: float
    end: float


@dataclass(frozen=True)
class Conflict:
    """The swept footprints of two vehicles' paths intersect (crossing, merging, following).

    `first` and `second` are vehicle indices in order of entry into the shared area (in following: leader, follower);
    `entry_first`, `entry_second` the times [s] of entry, `exit_first` when the first one has left it.
    """

    first: int
    second: int
    following: bool
    entry_first: float
    exit_first: float
    entry_second: float


def find_waits(encounter: Encounter) -> tuple[Wait, ...]:
    """Return the waits of every vehicle, in order of vehicle and time."""
    raise NotImplementedError


def find_conflicts(vehicles: tuple[Vehicle, ...], time: Floats, position: Floats, heading: Floats) -> tuple[Conflict, ...]:
    """Return one conflict per pair of vehicles whose swept footprints intersect, ordered by pair.

    Args:
        vehicles: N footprints.
        time: (T,) seconds.
        position: (N, T, 2) metres.
        heading: (N, T) rad.
    """
    raise NotImplementedError
