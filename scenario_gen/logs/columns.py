# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The columns of a table by quantity, with their units: by option, or by name and suffix."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
import math
from pathlib import Path
import re

from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.logs.column import Column, normalized
from scenario_gen.logs.config import listed, POINTS
from scenario_gen.logs.raw import UnknownFormatError

NAMES: dict[str, tuple[str, ...]] = {
    quantity: tuple(names.split())
    for quantity, names in {
        "scene": "case_id scenario_id scene scene_id run run_id run_index episode episode_id",
        "date": "date utc_date day",
        "time": "utc stamp unix gentime clock t time timestamp global_time epoch utc_time "
        "gps_time time_of_day sim_time timestep_time ts seconds frame frame_id frame_number "
        "frame_no frame_idx",
        "vehicle": "vehicle vehicle_id vehicle_name txdevice track_id id name agent_id object_id "
        "car car_id veh veh_id trackid actor_id obj_id agent track vid participant_id",
        "lat": "lat latitude gps_lat gps_latitude",
        "lon": "lon lng longitude long gps_lon gps_longitude",
        "x": "x e east easting pos_x position_x x_utm utm_x utm_e utm_east utm_easting xcenter "
        "x_center center_x tx p_rs_r_x px vehicle_x world_x map_x rear_axle_x",
        "y": "y n north northing pos_y position_y y_utm utm_y utm_n utm_north utm_northing "
        "ycenter y_center center_y ty p_rs_r_y py vehicle_y world_y map_y rear_axle_y",
        "speed": "speed v velocity vel vehicle_speed ground_speed speed_over_ground sog",
        "vx": "vx v_x velocity_x vel_x xvelocity x_velocity speed_x",
        "vy": "vy v_y velocity_y vel_y yvelocity y_velocity speed_y",
        "heading": "heading yaw theta course bearing psi hdg cog course_over_ground vehicle_angle",
        "height": "z height alt altitude elevation pos_z position_z",
        "valid": "valid is_valid validity fix_type fix_quality gps_quality gps_fix fix_status "
        "status num_sats num_satellites satellites",
        "ego_x": "ego_x ego_pos_x ego_position_x",
        "ego_y": "ego_y ego_pos_y ego_position_y",
        "ego_heading": "ego_yaw ego_heading ego_theta",
        "length": "length len vehicle_length",
        "width": "width vehicle_width",
        "kind": "type kind class vehicle_type object_type agent_type actor_type obj_type category "
        "classification vehicle_class object_class road_user road_user_type",
        "subkind": "",
        "signal": "signal signal_state traffic_light traffic_light_state light_state",
        "signal_id": "signal_id traffic_light_id light_id signal_group",
        "trailer": "trailer trailer_id trailer_length",
    }.items()
}
"""Column names of each quantity, the preferred first.

Clocks that all files share precede those that start with the file.
"""

_LENGTHS_M = {"m": 1.0, "km": 1e3, "ft": 0.3048, "dm": 0.1, "cm": 0.01, "mm": 0.001}
_DEGREES = {
    "deg": 1.0,
    "rad": math.degrees(1.0),
    "e7": 1e-7,
    "min": 1 / 60.0,
    "ddmm": 1.0,
}
_SPEEDS_MPS = {
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
_TIMES_S = {
    "s": 1.0,
    "sec": 1.0,
    "ns": 1e-9,
    "us": 1e-6,
    "ms": 1e-3,
    "min": 60.0,
    "h": 3600.0,
    "d": 86400.0,
    "hhmmss": 1.0,
}
_ANGLES = {
    "rad": 1.0,
    "deg": math.pi / 180.0,
    "north_deg": math.nan,
    "cw_deg": math.nan,
    "north_rad": math.nan,
}
UNITS: dict[str, dict[str, float]] = {
    **{quantity: {} for quantity in NAMES},
    "time": _TIMES_S,
    **dict.fromkeys(("lat", "lon"), _DEGREES),
    **dict.fromkeys(("x", "y", "height", "length", "width", "ego_x", "ego_y"), _LENGTHS_M),
    **dict.fromkeys(("speed", "vx", "vy"), _SPEEDS_MPS),
    **dict.fromkeys(("heading", "ego_heading"), _ANGLES),
}
"""Factors of units to seconds, metres, m/s, radians, or degrees (lat, lon).

A column without a suffix has the first unit; `ddmm` means degrees and minutes (ddmm.mmmm), and
`hhmmss` a time of the day (hhmmss.ss).
"""

MAX_LISTED_COUNT = 12
"""Names in a note."""

_NGSIM = {
    "time": ("global_time", "ms"),
    "vehicle": ("vehicle_id", ""),
    "x": ("local_x", "ft"),
    "y": ("local_y", "ft"),
    "speed": ("v_vel", "fps"),
    "length": ("v_length", "ft"),
    "width": ("v_width", "ft"),
    "kind": ("v_class", "motorcycle1+car2+truck3"),
}
"""Columns and units of NGSIM's trajectories; positions are those of the front centre."""

_FRAME_RATE = re.compile(r"(\d+(?:\.\d+)?)fps")  # unit of a time in frames
_SCALED = ("x", "y", "speed", "vx", "vy", "length", "width", "height")
_SCALE = re.compile(r"\d*\.?\d+(?:e-?\d+)?")  # our units in one of the column
_KINDS = ("kind", "subkind")
_NUMBERED_KIND = re.compile(r"([a-z_]*)(\d+)(?:\+|$)")  # type and number, car2
_NUMBERED_KINDS = re.compile(r"[a-z_]*\d+(?:\+[a-z_]*\d+)*")
_CLOCKWISE_NAMES = (
    "course",
    "bearing",
    "cog",
    "course_over_ground",
    "vehicle_angle",
)  # by convention degrees clockwise from north


def find_columns(header: Sequence[str], path: Path, option: str) -> dict[str, Column]:
    """Return the column of each quantity: as the parameter `columns` says, else by name.

    Raises:
        InputError: a required column is missing, or the parameter names an unknown column.
    """
    by_name = {normalized(name): name for name in header}
    requested = _requested(header, path, option)
    columns = _ngsim_columns(by_name)
    for quantity in NAMES:
        name = _preferred_name(quantity, by_name)
        if quantity not in columns and name is not None:
            columns[quantity] = as_column(quantity, name)
    for quantity, column in requested.items():
        columns.pop(quantity, None)
        if column is not None:
            columns[quantity] = column
    time = columns.get("time")
    if time and time.is_gentime:  # receivers of SPMD have heights of little worth
        columns.pop("height", None)
    if time and time.is_gentime and "heading" in columns:
        name = columns["heading"].name
        columns["heading"] = Column(name, math.pi / 180.0, clockwise=True)
    return _complete(columns, path, list(by_name.values()))


def _ngsim_columns(by_name: Mapping[str, str]) -> dict[str, Column]:
    """Return the columns of NGSIM's trajectories; none of other tables."""
    if _NGSIM["x"][0] not in by_name or _NGSIM["speed"][0] not in by_name:
        return {}
    return {
        quantity: as_column(quantity, by_name[name], unit)
        for quantity, (name, unit) in _NGSIM.items()
        if name in by_name
    }


def _preferred_name(quantity: str, by_name: Mapping[str, str]) -> str | None:
    """Return the column whose name is the preferred alias of a quantity, with or without unit."""
    suffixes = (*(f"_{unit}" for unit in UNITS[quantity]), "")
    candidates = [alias + suffix for alias in NAMES[quantity] for suffix in suffixes]
    plain = {_letters(name): raw for name, raw in by_name.items() if len(name) > 2}
    for candidate in candidates:
        if candidate in by_name:
            return by_name[candidate]
    return next((plain[n] for n in map(_letters, candidates) if n in plain), None)


def _letters(name: str) -> str:
    """Return a name without separators: `Pos X`, `pos.x` and `PosX` are the same."""
    return re.sub(r"[\W_]", "", name)


def _requested(header: Sequence[str], path: Path, option: str) -> dict[str, Column | None]:
    """Return the columns that the parameter `columns` names; None for quantities to ignore.

    Raises:
        InputError: it names an unknown column, unit or quantity.
    """
    known = {name.strip().lower(): name for name in header}
    known |= {normalized(name): name for name in header}
    columns: dict[str, Column | None] = {}
    for part in listed(option):
        quantity, _, text = (word.strip() for word in part.partition("="))
        if quantity not in (*NAMES, "point"):
            raise InputError(
                f"parameter columns: write quantity=column, …; {quantity!r} is none of "
                f"{', '.join(NAMES)}, point"
            )
        if quantity != "point":
            columns[quantity] = None if text == "none" else _parsed(quantity, text, known, path)
    return columns


def _parsed(quantity: str, text: str, known: Mapping[str, str], path: Path) -> Column:
    """Return the column of a text `name`, `name:unit` or `-name` (flipped).

    Raises:
        InputError: the table has no such column, or the quantity no such unit.
    """
    is_flipped = text.startswith("-") and text.lower() not in known
    name = text.removeprefix("-").strip() if is_flipped else text
    unit = ""
    if name.lower() not in known and ":" in name:
        name, _, unit = (word.strip() for word in name.rpartition(":"))
    if name.lower() not in known:
        raise InputError(
            f"{path} has no column {text!r} (requested as {quantity}); "
            f"it has {', '.join(dict.fromkeys(known.values()))}"
        )
    _check_unit(quantity, unit)
    column = as_column(quantity, known[name.lower()], unit)
    return replace(column, factor=-column.factor) if is_flipped else column


def _check_unit(quantity: str, unit: str) -> None:
    """Check a unit in the parameter `columns`.

    Raises:
        InputError: the quantity does not have it.
    """
    if not unit or unit in UNITS[quantity]:
        return
    if quantity == "time" and _FRAME_RATE.fullmatch(unit):
        return
    if quantity in _SCALED and _SCALE.fullmatch(unit) and float(unit):
        return
    if quantity in _KINDS and _NUMBERED_KINDS.fullmatch(unit):
        return
    raise InputError(
        f"parameter columns: {quantity} has no unit {unit!r}; "
        f"choose one of {', '.join(UNITS[quantity])}"
    )


def with_columns(option: str, changes: Mapping[str, str]) -> str:
    """Return the parameter `columns` with some quantities changed, as an option of the commands.

    Args:
        option: the parameter's value.
        changes: by quantity, columns as in the parameter.
    """
    parts = dict(part.split("=", 1) for part in listed(option) if "=" in part)
    text = ",".join(f"{quantity}={column}" for quantity, column in {**parts, **changes}.items())
    assignment = f"log.columns={text}"
    return f"--set '{assignment}'" if re.search(r"[\s()\[\]&;]", text) else f"--set {assignment}"


def point_of(columns: Mapping[str, Column]) -> str:
    """Return the point of a vehicle that the name of the column of x says; "" if none."""
    words = normalized(columns["x"].name).rpartition("_x") if "x" in columns else ("",)
    return words[0] if words[0] in POINTS else ""


def column_notes(columns: dict[str, Column], option: str, header: Sequence[str]) -> list[str]:
    """Return notes on the columns in a header that are used, not used, and missing."""
    notes = []
    used = {column.name for column in columns.values()}
    unused = [name for name in header if name not in used]
    if unused:
        sources = ", ".join(
            f"{quantity} from {column.name}" for quantity, column in columns.items()
        )
        names = ", ".join(unused[:MAX_LISTED_COUNT])
        n_more = len(unused) - MAX_LISTED_COUNT
        more = f" and {n_more} more" if n_more > 0 else ""
        notes.append(f"columns read: {sources}; not read: {names}{more}")
    if not columns.keys() & {"speed", "vx"} and "speed" not in option:
        notes.append("no speed column: speeds are derived from the positions")
    if columns.get("x", Column("")).name.strip().lower() == _NGSIM["x"][0]:
        notes.append(
            "NGSIM columns: feet are converted to metres; positions are those of the front of "
            "each vehicle"
        )
    if "vehicle" not in columns:
        notes.append("no column for the vehicle: each file is read as one vehicle")
    return notes


def _complete(columns: dict[str, Column], path: Path, header: Sequence[str]) -> dict[str, Column]:
    """Return the columns without x and y if there are latitude and longitude, or vice versa.

    Raises:
        UnknownFormatError: a required column is missing.
    """
    is_geographic = {"lat", "lon"} <= columns.keys()
    if not is_geographic and not {"x", "y"} <= columns.keys():
        missing = [name for name in ("x", "y", "lat", "lon") if name not in columns]
        raise _missing_column("position (x and y, or lat and lon)", missing, columns, path, header)
    if "time" not in columns and "date" in columns:
        columns = {**columns, "time": columns.pop("date")}
    if "time" not in columns:
        raise _missing_column("time", ["time"], columns, path, header)
    ignored = ["x", "y"] if is_geographic else ["lat", "lon"]
    for group in (["vx", "vy"], ["ego_x", "ego_y", "ego_heading"]):
        ignored += [] if columns.keys() >= set(group) else group
    return {quantity: column for quantity, column in columns.items() if quantity not in ignored}


def _wide_hint(header: Sequence[str]) -> str:
    """Return a hint if each vehicle has columns of its own; else ""."""
    names = {normalized(name) for name in header}
    pairs = [(name, name.replace("x", "y", 1)) for name in names if re.match(r"x[_.]", name)]
    pairs += [(name, f"{name[:-1]}y") for name in names if re.search(r"[_.]x$", name)]
    wide = sorted(re.sub(r"^x[_.]|[_.]x$", "", x) for x, y in pairs if y in names)
    if len(wide) < 2 or set(wide) & set(UNITS["x"]):
        return ""
    return (
        f". Vehicles {', '.join(wide)} have columns of their own: write a row for each vehicle "
        "and time, with a column id"
    )


def _missing_column(
    missing: str,
    quantities: Sequence[str],
    columns: Collection[str],
    path: Path,
    header: Sequence[str],
) -> UnknownFormatError:
    """Return the error on a missing column, with all options that the next command needs."""
    needed = ["time", "vehicle"] if "time" in quantities else ["x", "y", "time", "vehicle"]
    remedy = ",".join(f"{name}=…" for name in needed if name in "xy" or name not in columns)
    if hint := _wide_hint(header):
        return UnknownFormatError(f"{path} has no column for {missing}{hint}")
    aliases = {alias for quantity in quantities for alias in NAMES[quantity]}
    return UnknownFormatError(
        f"{path} has no column for {missing}; it has {', '.join(header)}. Rename it, or name it "
        f"with --set log.columns={remedy}{_with_unknown_unit(header)}{_similar(header, aliases)}"
    )


def _with_unknown_unit(header: Sequence[str]) -> str:
    """Return how to name the unit of columns such as x_px; "" if there are none."""
    units = {}
    for quantity in ("x", "y"):
        for name in header:
            alias, _, unit = normalized(name).rpartition("_")
            if alias in NAMES[quantity] and unit not in UNITS[quantity]:
                units[quantity] = f"{name}:<metres of one {unit}>"
    parts = ",".join(f"{quantity}={text}" for quantity, text in units.items())
    return f", e.g. log.columns={parts}" if parts else ""


def _similar(header: Sequence[str], aliases: Collection[str]) -> str:
    """Return a question whether a column is meant by an alias; "" if none is similar."""
    others = {alias for names in NAMES.values() for alias in names} - set(aliases)
    for name in header:
        is_candidate = len(name) > 2 and normalized(name) not in others
        if is_candidate and did_you_mean(normalized(name), aliases):
            return f"; is it {name}?"
    return ""


def _kind_column(name: str, kinds: str) -> Column:
    """Return the column of the types of road users, whose numbers in the file are in `kinds`."""
    numbered = _NUMBERED_KIND.findall(kinds)
    types = tuple((float(number), kind or "car") for kind, number in numbered)
    return Column(name, types=types, unit=kinds)


def as_column(quantity: str, name: str, unit: str = "") -> Column:
    """Return the column in a unit; by default, its suffix names the unit."""
    if quantity in _KINDS:
        return _kind_column(name, unit)
    lower = normalized(name)
    frame_rate = _FRAME_RATE.fullmatch(unit) if quantity == "time" else None
    if frame_rate:
        return Column(name, 1.0 / max(float(frame_rate[1]), 1e-3), unit=unit)
    suffixes = [known for known in UNITS[quantity] if lower.endswith(f"_{known}")]
    unit = unit or max(suffixes, key=len, default="")
    is_clockwise = UNITS[quantity] is _ANGLES and (
        unit in ("north_deg", "cw_deg", "north_rad")
        or lower.removesuffix(f"_{unit}") in _CLOCKWISE_NAMES
    )
    if is_clockwise:
        factor = 1.0 if unit in ("rad", "north_rad") else math.pi / 180.0
        return Column(name, factor, clockwise=True, unit=unit or "north_deg")
    if quantity == "time" and not unit and lower == "gentime":
        return Column(name, 1e-6, unit="us")
    factor = float(unit) if _SCALE.fullmatch(unit) else UNITS[quantity].get(unit, 1.0)
    return Column(name, factor, minutes=unit == "ddmm", unit=unit)
