# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of reading a log."""

from collections.abc import Sequence
from dataclasses import dataclass

from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.logs.quality import ALLOWED

POINTS = {"centre": 0.0, "front": -0.5, "rear": 0.5, "rear_axle": 0.3}
"""Recorded points of a vehicle, and how many lengths its centre is ahead of them.

The rear overhang of a car is a fifth of its length.
"""


@dataclass(frozen=True)
class LogConfig(Parameters):
    """How a log is read, cleaned and cut into encounters."""

    format: str = parameter(
        "auto",
        "source format (docs/logs.md); auto looks at the file's name and content",
    )
    columns: str = parameter(
        "",
        "columns of a table, e.g. vehicle=who,speed=v:kmh; y=-y flips an axis; point=front, rear "
        "or rear_axle: the recorded point of a vehicle",
    )
    topics: str = parameter(
        "", "topics of a bag to read, separated by commas; empty: all that can be used"
    )
    stamps: str = parameter(
        "header",
        "stamps of a bag's messages: those of their headers, or the time of reception",
        choices=("header", "received"),
    )
    vehicles: str = parameter("", "vehicles to keep, separated by commas; empty: all")
    types: str = parameter(
        "",
        "types of road users to keep, e.g. car,van,truck,bus; other: unknown type; empty: all",
    )
    signals: str = parameter(
        "recorded",
        "states of traffic lights in a log: read, or ignored",
        choices=("recorded", "ignored"),
    )
    start: float = parameter(
        0.0, "start of the time window, counted from the log's first stamp", unit="s", low=0.0
    )
    end: float = parameter(
        0.0,
        "end of the time window, counted from the log's first stamp; 0: to the end",
        unit="s",
        low=0.0,
    )
    origin: str = parameter(
        "",
        "latitude,longitude of the local frame's origin, degrees; empty: the middle of the fixes",
    )
    strict: bool = parameter(
        False, "refuse a log with rows that need repair, instead of repairing and counting them"
    )
    allow: str = parameter(
        "",
        "doubt: read a log although the result contradicts its data; empty: stop and say so",
        choices=("", ALLOWED),
    )
    period: float = parameter(0.1, "period of the common clock", unit="s", low=0.01, high=1.0)
    longest_gap: float = parameter(
        1.0,
        "longest gap that is bridged; a track is cut at longer ones",
        unit="s",
        low=0.0,
        high=10.0,
    )
    length: float = parameter(
        4.8, "length of a vehicle, if the log does not have it", unit="m", low=0.5, high=30.0
    )
    width: float = parameter(
        1.9, "width of a vehicle, if the log does not have it", unit="m", low=0.3, high=4.0
    )
    position_noise: float = parameter(
        0.0,
        "standard deviation of positions; 0: estimated for each vehicle",
        unit="m",
        low=0.0,
        high=10.0,
    )
    speed_noise: float = parameter(
        0.0,
        "standard deviation of measured speeds; 0: estimated for each vehicle",
        unit="m/s",
        low=0.0,
        high=10.0,
    )
    jerk: float = parameter(
        0.5, "typical change of acceleration within one second", unit="m/s²", low=0.1, high=20.0
    )
    acceleration_limit: float = parameter(
        5.0, "largest acceleration of a vehicle", unit="m/s²", low=1.0, high=20.0
    )
    braking_limit: float = parameter(
        8.0, "largest deceleration of a vehicle", unit="m/s²", low=1.0, high=20.0
    )
    proximity: float = parameter(
        100.0,
        "vehicles closer than this can form an encounter (the range of DSRC in the paper)",
        unit="m",
        low=1.0,
        high=2000.0,
    )
    min_duration: float = parameter(5.0, "shortest encounter", unit="s", low=0.5, high=600.0)
    max_duration: float = parameter(
        60.0,
        "longest encounter; longer ones are cut into equal parts",
        unit="s",
        low=2.0,
        high=3600.0,
    )
    travel: float = parameter(
        5.0,
        "minimum distance that one vehicle of an encounter drives",
        unit="m",
        low=0.0,
        high=1000.0,
    )
    standstill: float = parameter(
        10.0,
        "an encounter ends when all vehicles stand still for longer than this",
        unit="s",
        low=1.0,
        high=600.0,
    )
    max_vehicles: int = parameter(
        12, "largest number of vehicles in an encounter cut from a longer log", low=2, high=64
    )
    min_presence: float = parameter(
        3.0,
        "shortest presence of a vehicle that arrives late or leaves early",
        unit="s",
        low=0.5,
        high=600.0,
    )
    whole: bool = parameter(
        False, "cut an encounter to the time in which all its vehicles are recorded"
    )
    size_limit: int = parameter(
        256, "largest log that is read, after decompression", unit="MiB", low=1, high=1_000_000
    )
    row_limit: int = parameter(2_000_000, "most rows or messages of a log", low=1)
    vehicle_limit: int = parameter(10_000, "most vehicles of a log", low=2)
    tick_limit: int = parameter(
        2_000_000,
        "most ticks of the common clock, over all vehicles, from first to last stamp",
        low=1,
    )


def listed(text: str) -> list[str]:
    """Return the non-empty parts of a text that commas separate."""
    return [part.strip() for part in text.split(",") if part.strip()]


def points_ahead(config: LogConfig) -> float:
    """Return how far the centre of a vehicle is ahead of its recorded point, in vehicle lengths.

    Raises:
        InputError: the parameter `columns` names an unknown point.
    """
    point = "centre"
    for part in listed(config.columns):
        name, _, value = part.partition("=")
        if name.strip() == "point":
            point = value.strip()
    if point not in POINTS:
        raise InputError(f"parameter columns: point is one of {', '.join(POINTS)}, not {point!r}")
    return POINTS[point]


def chosen_vehicles(known: Sequence[str], config: LogConfig, log: str) -> list[str]:
    """Return the vehicles that the parameter `vehicles` names; all if it is empty.

    Raises:
        InputError: the log does not have one of them; the message lists those that it has.
    """
    names = listed(config.vehicles)
    for name in names:
        if name not in known:
            raise InputError(
                f"parameter vehicles: {log} has no vehicle {name!r}; it has {', '.join(known)}"
                f"{did_you_mean(name, known)}"
            )
    return list(dict.fromkeys(names)) or list(known)
