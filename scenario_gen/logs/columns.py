# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The columns of a table by quantity, with their units: by option, or by name and suffix."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
import math
from pathlib import Path
import re

from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.logs.config import listed
from scenario_gen.logs.raw import UnknownFormatError

# Column names of each quantity, the preferred first. Clocks that all files share come before those that start with the file.
NAMES: dict[str, tuple[str, ...]] = {
    "time": ("utc", "stamp", "unix", "gentime", "clock", "t", "time", "timestamp", "global_time"),
    "vehicle": (
        *(
            "vehicle",
            "vehicle_id",
            "vehicle_name",
            "txdevice",
            "track_id",
            "id",
            "name",
            "agent_id",
            "object_id",
            "car",
        ),
        *("car_id", "veh", "veh_id", "trackid", "actor_id", "obj_id"),
    ),
    "lat": ("lat", "latitude"),
    "lon": ("lon", "lng", "longitude"),
    "x": ("x", "e", "east", "easting", "pos_x", "position_x"),
    "y": ("y", "n", "north", "northing", "pos_y", "position_y"),
    "speed": ("speed", "v", "velocity", "vel"),
    "heading": ("heading", "yaw", "theta", "course", "bearing"),
    "length": ("length", "len", "vehicle_length"),
    "width": ("width", "vehicle_width"),
    "kind": (
        *(
            "type",
            "kind",
            "class",
            "vehicle_type",
            "object_type",
            "agent_type",
            "actor_type",
            "obj_type",
            "category",
        ),
        *("classification", "vehicle_class", "object_class", "road_user", "road_user_type"),
    ),
}
# Factors to seconds, metres, m/s, radians, or degrees (lat, lon); a column without a unit suffix has the first unit.
PLACES = {"m": 1.0, "km": 1e3, "ft": 0.3048, "cm": 0.01}
SIZES = {"m": 1.0, "ft": 0.3048, "cm": 0.01, "mm": 0.001}
DEGREES = {
    "deg": 1.0,
    "rad": math.degrees(1.0),
    "e7": 1e-7,
    "ddmm": 1.0,
}  # ddmm.mmmm: degrees, and minutes of two digits
SPEEDS = {
    "mps": 1.0,
    "ms": 1.0,
    "m_s": 1.0,
    "kmh": 1 / 3.6,
    "kph": 1 / 3.6,
    "mph": 0.44704,
    "kn": 1852 / 3600,
    "fps": 0.3048,
    "cmps": 0.01,
}
UNITS: dict[str, dict[str, float]] = {
    "time": {
        "s": 1.0,
        "sec": 1.0,
        "ns": 1e-9,
        "us": 1e-6,
        "ms": 1e-3,
        "min": 60.0,
        "h": 3600.0,
        "d": 86400.0,
    },
    "vehicle": {},
    "kind": {},
    **dict.fromkeys(("lat", "lon"), DEGREES),
    **dict.fromkeys(("x", "y"), PLACES),
    **dict.fromkeys(("length", "width"), SIZES),
    "speed": SPEEDS,
    "heading": {"rad": 1.0, "deg": math.pi / 180.0, "north_deg": math.nan, "cw_deg": math.nan},
}
IN_BRACKETS = re.compile(r"(.+?)\s*[\[(]\s*([^\])]+?)\s*[\])]")  # x [m]
SPELLED = {
    "m/s": "mps",
    "km/h": "kmh",
    "°": "deg",
    "degrees": "deg",
    "seconds": "s",
    "metres": "m",
    "meters": "m",
    "feet": "ft",
}
NGSIM = {  # columns of the trajectory files, in feet, and their units; positions are those of the middle of the front
    "time": ("global_time", "ms"), "vehicle": ("vehicle_id", ""), "x": ("local_x", "ft"), "y": ("local_y", "ft"),
    "speed": ("v_vel", "fps"), "length": ("v_length", "ft"), "width": ("v_width", "ft"),
    "kind": ("v_class", "motorcycle1+car2+truck3"),
}  # fmt: skip
FRAMES = re.compile(r"(\d+(?:\.\d+)?)fps")  # a unit of time: frames, so many each second
KINDS = re.compile(
    r"([a-z_]*)(\d+)(?:\+|$)"
)  # in a unit of kinds that are numbers: which of them are of which type
ALL_KINDS = re.compile(r"[a-z_]*\d+(?:\+[a-z_]*\d+)*")
SHOWN = 12  # columns that are not read, by name
CLOCKWISE = ("course", "bearing")  # by convention degrees clockwise from north


@dataclass(frozen=True)
class Column:
    """A column of the table.

    Attributes:
        name: of the column.
        factor: to the unit used here; negative if the axis is flipped.
        clockwise: it is a heading clockwise from north.
        minutes: its last two whole digits and what follows are minutes of a degree, as receivers of NMEA write.
        types: it is of kinds that are numbers, and these are of these types; cars, where none is named.
    """

    name: str
    factor: float = 1.0
    clockwise: bool = False
    minutes: bool = False
    types: tuple[tuple[float, str], ...] = ()


def named(header: Sequence[str], path: Path, option: str) -> dict[str, Column | None]:
    """Return the columns that the parameter `columns` names, None of quantities that are not to be read.

    Raises:
        InputError: it names a column that is not there, or a unit or quantity that is not known.
    """
    spelled = {name.strip().lower(): name for name in header} | {
        normal(name): name for name in header
    }
    columns: dict[str, Column | None] = {}
    for part in listed(option):
        quantity, _, name = (p.strip() for p in part.partition("="))
        if quantity == "point":
            continue
        if quantity not in NAMES:
            raise InputError(
                f"parameter columns: write quantity=column, …; {quantity!r} is none of {', '.join(NAMES)}, point"
            )
        if name == "none":
            columns[quantity] = None
            continue
        flipped = name.startswith("-") and name.lower() not in spelled
        own, unit = name[flipped:].strip(), ""
        if own.lower() not in spelled and ":" in own:
            own, _, unit = (p.strip() for p in own.rpartition(":"))
        if own.lower() not in spelled:
            raise InputError(
                f"{path} has no column {name!r} (requested as {quantity}); it has {', '.join(header)}"
            )
        form = {"time": FRAMES, "kind": ALL_KINDS}.get(quantity)
        if unit and unit not in UNITS[quantity] and not (form and form.fullmatch(unit)):
            raise InputError(
                f"parameter columns: {quantity} has no unit {unit!r}; choose one of {', '.join(UNITS[quantity])}"
            )
        column = as_column(quantity, spelled[own.lower()], unit)
        columns[quantity] = replace(column, factor=-column.factor) if flipped else column
    return columns


def find_columns(header: Sequence[str], path: Path, option: str) -> dict[str, Column]:
    """Return the column of each quantity: as the parameter `columns` says, else by name.

    Raises:
        InputError: a required column is missing, or the parameter names a column that is not there.
    """
    names = {normal(name): name for name in header}
    asked = named(header, path, option)
    columns = {quantity: column for quantity, column in asked.items() if column is not None}
    without = asked.keys() - columns.keys()
    if NGSIM["x"][0] in names and NGSIM["speed"][0] in names:
        for quantity, (name, unit) in NGSIM.items():
            if name in names and quantity not in without:
                columns.setdefault(quantity, as_column(quantity, names[name], unit))
    joined = {name.replace(" ", "_"): own for name, own in names.items() if " " in name}
    for quantity, aliases in NAMES.items():
        if quantity in columns or quantity in without:
            continue
        suffixes = ("", *(f"_{unit}" for unit in UNITS[quantity]))
        candidates = [f"{alias}{suffix}" for alias in aliases for suffix in suffixes]
        match = next(
            (
                known[candidate]
                for known in (names, joined)
                for candidate in candidates
                if candidate in known
            ),
            None,
        )
        if match is not None:
            columns[quantity] = as_column(quantity, match)
    if (
        "heading" in columns
        and "time" in columns
        and columns["time"].name.strip().lower() == "gentime"
    ):  # basic safety messages
        columns["heading"] = Column(columns["heading"].name, math.pi / 180.0, clockwise=True)
    return complete(columns, path, names)


def normal(name: str) -> str:
    """Return a column's name in small letters, with a unit in brackets as a suffix: `Speed [m/s]` is `speed_mps`."""
    name = name.strip().lower()
    bracketed = IN_BRACKETS.fullmatch(name)
    return f"{bracketed[1]}_{SPELLED.get(bracketed[2], bracketed[2])}" if bracketed else name


def notes_on(columns: dict[str, Column], option: str, header: Sequence[str]) -> list[str]:
    """Return what there is to say about the columns that were found with the parameter `columns` in a header."""
    notes = []
    unread = [name for name in header if name not in {column.name for column in columns.values()}]
    if unread:
        read = ", ".join(f"{quantity} from {column.name}" for quantity, column in columns.items())
        more = f" and {len(unread) - SHOWN} more" if len(unread) > SHOWN else ""
        notes.append(f"columns read: {read}; not read: {', '.join(unread[:SHOWN])}{more}")
    if "speed" not in columns and "speed" not in option:
        notes.append("there is no speed column: speeds are derived from the positions")
    if columns.get("x", Column("")).name.strip().lower() == NGSIM["x"][0]:
        notes.append(
            "NGSIM columns: feet are converted to metres; positions are those of the front of each vehicle"
        )
    if "vehicle" not in columns:
        notes.append("there is no column for the vehicle: each file is read as one vehicle")
    return notes


def complete(columns: dict[str, Column], path: Path, names: dict[str, str]) -> dict[str, Column]:
    """Check that all required columns are there; leave out x and y where there are latitude and longitude.

    Raises:
        InputError: a needed column is missing.
    """
    missing: tuple[str, str, tuple[str, ...]] | None = None
    if not ({"lat", "lon"} <= columns.keys() or {"x", "y"} <= columns.keys()):
        missing = ("position (x and y, or lat and lon)", "x=…,y=…", ("x", "y", "lat", "lon"))
    elif "time" not in columns:
        missing = ("time", "time=…", ("time",))
    if missing:
        what, remedy, quantities = missing
        aliases = {
            alias
            for quantity in quantities
            if quantity not in columns
            for alias in NAMES[quantity]
        }
        near = nearest(names.values(), aliases)
        raise UnknownFormatError(
            f"{path} has no column for {what}; it has {', '.join(names.values())}. "
            f"Rename it, or name it with --set log.columns={remedy}{near}"
        )
    unused = ("x", "y") if {"lat", "lon"} <= columns.keys() else ("lat", "lon")
    return {quantity: column for quantity, column in columns.items() if quantity not in unused}


def nearest(present: Collection[str], aliases: Collection[str]) -> str:
    """Return a question whether one of the columns is meant by an alias; "" if none is near."""
    others = {alias for own in NAMES.values() for alias in own} - set(aliases)
    found = [
        (name, did_you_mean(normal(name), aliases))
        for name in present
        if len(name) > 2 and normal(name) not in others
    ]
    return next((f"; is it {name}?" for name, question in found if question), "")


def as_column(quantity: str, name: str, unit: str = "") -> Column:
    """Return the column in the given unit; by default its suffix names the unit."""
    lower = normal(name)
    if quantity == "kind":
        return Column(
            name,
            types=tuple((float(number), word or "car") for word, number in KINDS.findall(unit)),
        )
    if quantity == "time" and (frames := FRAMES.fullmatch(unit)):
        return Column(name, 1.0 / max(float(frames[1]), 1e-3))
    unit = unit or max(
        (unit for unit in UNITS[quantity] if lower.endswith("_" + unit)), key=len, default=""
    )
    if quantity == "heading":
        base = lower.removesuffix("_" + unit)
        if unit in ("north_deg", "cw_deg") or base in CLOCKWISE:
            return Column(name, 1.0 if unit == "rad" else math.pi / 180.0, clockwise=True)
        return Column(name, UNITS["heading"].get(unit, 1.0))
    if quantity == "time" and not unit and lower == "gentime":
        return Column(name, 1e-6)
    return Column(name, UNITS[quantity].get(unit, 1.0), minutes=unit == "ddmm")
