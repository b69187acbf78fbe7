# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of reading a log."""

from collections.abc import Sequence
from dataclasses import dataclass

from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.base.parameters import parameter, Parameters

FORMATS = ("auto", "spmd", "table", "bag", "argoverse2", "interaction", "ind", "highd", "commonroad")


@dataclass(frozen=True)
class LogConfig(Parameters):
    """How a log is read, cleaned and cut into encounters."""

    format: str = parameter(
        "auto", "source format; auto looks at the file's name and content", choices=FORMATS, group="scenario_gen.logs"
    )
    columns: str = parameter("", "columns of a table that its header does not name, e.g. vehicle=name,time=t_s,speed=v_kmh")
    topics: str = parameter("", "topics of a bag to read, separated by commas; empty reads all that can be used")
    vehicles: str = parameter("", "vehicles to keep, separated by commas; empty keeps all")
    start: float = parameter(0.0, "start of the time window, counted from the log's first stamp", unit="s", low=0.0)
    end: float = parameter(
        0.0, "end of the time window, counted from the log's first stamp; 0 means to the end", unit="s", low=0.0
    )
    origin: str = parameter("", "latitude,longitude of the local frame in degrees; empty takes the middle of the log's fixes")
    strict: bool = parameter(False, "refuse a log that has rows to repair instead of repairing and counting them")
    period: float = parameter(0.1, "period of the common clock", unit="s", low=0.01, high=1.0)
    longest_gap: float = parameter(1.0, "gaps up to this are bridged, longer ones cut", unit="s", low=0.0, high=10.0)
    length: float = parameter(4.8, "length of a vehicle whose log does not say", unit="m", low=0.5, high=30.0)
    width: float = parameter(1.9, "width of a vehicle whose log does not say", unit="m", low=0.3, high=4.0)
    position_noise: float = parameter(
        0.0, "standard deviation of a position; 0 estimates it per vehicle", unit="m", low=0.0, high=10.0
    )
    speed_noise: float = parameter(
        0.0, "standard deviation of a measured speed; 0 estimates it per vehicle", unit="m/s", low=0.0, high=10.0
    )
    jerk: float = parameter(0.5, "typical change of acceleration within one second", unit="m/s²", low=0.1, high=20.0)
    acceleration_limit: float = parameter(
        5.0, "hardest acceleration a vehicle is believed to do", unit="m/s²", low=1.0, high=20.0
    )
    braking_limit: float = parameter(8.0, "hardest braking a vehicle is believed to do", unit="m/s²", low=1.0, high=20.0)
    proximity: float = parameter(
        100.0, "vehicles nearer than this meet (the range of DSRC in the paper)", unit="m", low=1.0, high=2000.0
    )
    min_duration: float = parameter(5.0, "shortest encounter", unit="s", low=0.5, high=600.0, was="shortest")
    max_duration: float = parameter(
        60.0, "longest encounter; longer ones are cut in equal parts", unit="s", low=2.0, high=3600.0, was="longest"
    )
    travel: float = parameter(5.0, "distance that at least one vehicle of an encounter covers", unit="m", low=0.0, high=1000.0)
    standstill: float = parameter(10.0, "when all stand longer than this, the encounter is over", unit="s", low=1.0, high=600.0)
    max_vehicles: int = parameter(
        12, "largest number of vehicles in an encounter cut from a longer log", low=2, high=64, was="most_vehicles"
    )
    min_presence: float = parameter(
        3.0, "shortest time for which a vehicle is there that arrives late or leaves early", unit="s", low=0.5, high=600.0
    )
    whole: bool = parameter(False, "cut an encounter to the time in which all its vehicles are there")
    size_limit: int = parameter(256, "largest log that is read, counted decompressed", unit="MiB", low=1, high=1_000_000)
    row_limit: int = parameter(2_000_000, "most rows or messages of a log", low=1)
    vehicle_limit: int = parameter(10_000, "most vehicles of a log", low=2)
    tick_limit: int = parameter(2_000_000, "most ticks of the common clock, over all vehicles, from first to last stamp", low=1)


def listed(text: str) -> list[str]:
    """Return the parts of a text that are separated by commas, without those that are empty."""
    return [part.strip() for part in text.split(",") if part.strip()]


def picked(known: Sequence[str], config: LogConfig, where: str) -> list[str]:
    """Return the vehicles that the parameter `vehicles` names, all by default.

    Raises:
        InputError: one of them is not there; the message lists those that are.
    """
    names = listed(config.vehicles)
    for unknown in (name for name in names if name not in known):
        raise InputError(
            f"parameter vehicles: {where} has no vehicle {unknown!r}; it has {', '.join(known)}{did_you_mean(unknown, known)}"
        )
    return list(dict.fromkeys(names)) or list(known)
