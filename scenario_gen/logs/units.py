# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whether recorded headings and speeds would fit the positions in another unit or convention."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.encounters import Piece
from scenario_gen.logs.path import HEADINGS
from scenario_gen.numerics import Floats, wrap_angle

_QUANTILE_PERCENT = 75.0  # of headings; one vehicle of two may face along an axis
_FIT_RAD = float(np.radians(5.0))  # headings that fit are nearer
_SAME_RATIO = 0.03  # tolerance of a ratio of speeds
_WRONG_RATIO = 1.2  # a ratio of speeds, or its inverse, that no sensor error explains
_MIN_SAMPLE_COUNT = 5  # of a moving vehicle
_MIN_TRAVEL_M = 2.0  # by speeds or positions; less does not give a ratio


@dataclass(frozen=True)
class _Unit:
    """A ratio of measured speeds to those of the positions, and the unit that explains it.

    `metric` units apply to positions in x and y only.
    """

    ratio: float
    name: str
    metric: bool = False


_UNITS = (
    _Unit(3.6, "km/h (name the column speed_kmh)"),
    _Unit(1 / 0.44704, "mph (speed_mph)"),
    _Unit(1 / 0.3048, "ft/s (speed_fps)"),
    _Unit(3600 / 1852, "knots (speed_kn)"),
    _Unit(100.0, "cm/s (speed_cmps)"),
    _Unit(0.3048, "m/s, and x, y in feet (log.columns=x=…:ft,y=…:ft)", metric=True),
    _Unit(0.01, "m/s, and x, y in cm (x=…:cm,y=…:cm)", metric=True),
    _Unit(1000.0, "m/s, and x, y in km (log.columns=x=…:km,y=…:km)", metric=True),
    _Unit(1 / 60.0, "m/s, and the time in minutes (time=…:min)"),
    *(
        _Unit(
            rate, f"m/s, and the time in frames, {rate} per second (log.columns=time=…:{rate}fps)"
        )
        for rate in (10, 15, 20, 24, 25, 30, 50, 60)
    ),
)


@dataclass(frozen=True)
class _Travel:
    """The distances of one vehicle [m], and the median ratio of measured speeds to positions.

    `by_swapped` are those of the positions if latitude and longitude were swapped.
    """

    by_speed: float
    by_position: float
    by_swapped: float
    ratio: float


def remarks_on_units(
    pieces: Sequence[Piece], origin_ns: int, config: LogConfig
) -> tuple[str, ...]:
    """Return sentences on headings and speeds that contradict the positions, with likely units.

    Args:
        pieces: smooth motion of all vehicles, with what was recorded.
        origin_ns: stamp of the common clock's first tick [ns].
        config: names the clock's period.
    """
    is_geographic = any(piece.track.origin for piece in pieces)
    remarks = (
        _heading_remark(pieces, origin_ns, config, is_geographic),
        _speed_remark(_travels(pieces, origin_ns, config), is_geographic),
    )
    return tuple(remark for remark in remarks if remark)


def _tick_seconds(piece: Piece, config: LogConfig) -> Floats:
    """Return the times (T,) of a piece's samples [s]."""
    ticks = np.arange(len(piece.smooth.speed), dtype=np.float64)
    return (piece.smooth.first + ticks) * config.period


def _heading_remark(
    pieces: Sequence[Piece], origin_ns: int, config: LogConfig, is_geographic: bool
) -> str:
    """Return a sentence on headings that contradict the direction of travel; "" if they fit."""
    recorded_parts = [np.zeros(0)]
    course_parts = [np.zeros(0)]
    for piece in pieces:
        ticks = _tick_seconds(piece, config)
        seconds = (piece.track.fix_ns - origin_ns) * 1e-9
        speed = np.interp(seconds, ticks, piece.smooth.speed)
        is_used = (speed > HEADINGS.moving_mps) & np.isfinite(piece.track.heading)
        recorded_parts.append(piece.track.heading[is_used])
        course_parts.append(np.interp(seconds[is_used], ticks, piece.smooth.heading))
    recorded = np.concatenate(recorded_parts)
    course = np.concatenate(course_parts)

    def error(heading: Floats) -> float:
        return float(np.percentile(np.abs(wrap_angle(heading - course)), _QUANTILE_PERCENT))

    if not len(recorded) or error(recorded) <= HEADINGS.contradiction_rad:
        return ""
    axes = "x and y are swapped (log.columns=x=…,y=…)"
    if is_geographic:
        axes = "lat and lon are swapped (log.columns=lat=LON,lon=LAT)"
    quarter = np.pi / 2.0
    conventions = {
        f"clockwise from north (name the column heading_north_deg), or if {axes}": quarter
        - recorded,
        "clockwise, or if y points the other way (log.columns=heading=-…, or y=-…)": -recorded,
        "in degrees (name the column heading_deg)": np.radians(recorded),
        "in degrees clockwise from north (name the column heading_north_deg)": quarter
        - np.radians(recorded),
        "turned by 180°": recorded + np.pi,
    }
    fitting = [name for name, heading in conventions.items() if error(heading) < _FIT_RAD]
    hint = f"; they would fit if they were {fitting[0]}" if fitting else ""
    return (
        f"a quarter of the recorded headings are {np.degrees(error(recorded)):.0f}° or more off "
        f"the direction of travel; headings that contradict it are not used{hint}"
    )


def _travels(pieces: Sequence[Piece], origin_ns: int, config: LogConfig) -> list[_Travel]:
    """Return the distances of each vehicle that moves and has measured speeds."""
    steps: dict[str, list[Floats]] = {}
    for piece in pieces:
        track = piece.track
        stamps = (track.speed_ns - origin_ns) * 1e-9
        if len(stamps) < 2:
            continue
        ticks = _tick_seconds(piece, config)
        step = np.diff(piece.smooth.position, axis=0)
        by_speed = np.interp(ticks, stamps, track.speed)[1:] * config.period
        by_position = np.hypot(*step.T)
        by_swapped = np.hypot(*(step * _swap_factors(track.origin)).T)
        columns = np.column_stack([by_speed, by_position, by_swapped])
        steps.setdefault(track.id, []).append(columns)
    min_step = HEADINGS.moving_mps * config.period
    travels = [_travel(np.concatenate(parts), min_step) for parts in steps.values()]
    return [t for t in travels if max(t.by_speed, t.by_position) > _MIN_TRAVEL_M]


def _travel(steps: Floats, min_step: float) -> _Travel:
    """Return the sums of steps (T, 3) [m], and the ratio at steps longer than `min_step`."""
    moving = steps[steps[:, 1] > min_step]
    by_speed, by_position, by_swapped = steps.sum(axis=0).tolist()
    ratio = by_speed / max(by_position, 1e-3)
    if len(moving) >= _MIN_SAMPLE_COUNT:
        ratio = float(np.median(moving[:, 0] / moving[:, 1]))
    return _Travel(by_speed, by_position, by_swapped, ratio)


def _swap_factors(origin: tuple[float, float] | None) -> Floats:
    """Return the factors (2,) of steps east and north if latitude and longitude were swapped."""
    latitude, longitude = np.radians(origin or (0.0, 0.0))
    return np.array([1.0 / max(np.cos(latitude), 0.01), abs(np.cos(longitude))])


def _speed_ratio(travels: Sequence[_Travel], is_geographic: bool) -> tuple[float, str]:
    """Return the ratio of measured speeds to those by positions, and the unit that explains it.

    Of three estimates, the first one that a unit explains is used; "" if none is explained.
    """
    total_speed = sum(travel.by_speed for travel in travels)
    total_position = sum(travel.by_position for travel in travels)
    whole = [travel.by_speed / max(travel.by_position, 1e-3) for travel in travels]
    estimates = (
        float(np.median([travel.ratio for travel in travels])),
        total_speed / max(total_position, 1e-3),
        float(np.median(whole)),
    )
    likely = [(ratio, _likely_unit(ratio, is_geographic)) for ratio in estimates]
    return next((pair for pair in likely if pair[1]), likely[0])


def _speed_remark(travels: Sequence[_Travel], is_geographic: bool) -> str:
    """Return a sentence on measured speeds that contradict the positions; "" if they fit."""
    n_wrong = sum(_deviation(travel.ratio) > _WRONG_RATIO for travel in travels)
    if not travels or n_wrong < len(travels) / 2.0:
        return ""
    ratio, unit = _speed_ratio(travels, is_geographic)
    fact = (
        f"the recorded speeds are {ratio:.2f} times those of the positions in {n_wrong} of "
        f"{len(travels)} vehicles"
    )
    swapped = np.array([travel.by_speed / max(travel.by_swapped, 1e-3) for travel in travels])
    log_error = np.abs(np.log(np.maximum(swapped, 1e-9)))
    if is_geographic and (log_error < 0.5 * np.log(_WRONG_RATIO)).all():
        return (
            f"{fact}; they would fit if lat and lon were swapped "
            "(log.columns=lat=LON,lon=LAT, each the other column)"
        )
    if _deviation(ratio) <= _WRONG_RATIO:
        return ""
    if unit:
        return f"{fact}; they look like {unit}"
    return f"{fact}: check the time and the units of x, y and speeds"


def _deviation(ratio: float) -> float:
    """Return a ratio or its inverse, whichever is larger."""
    return max(ratio, 1.0 / max(ratio, 1e-9))


def _likely_unit(ratio: float, is_geographic: bool) -> str:
    """Return the unit that explains a ratio of speeds; "" if none does."""
    units = [unit for unit in _UNITS if not (is_geographic and unit.metric)]
    nearest = min(units, key=lambda unit: abs(ratio / unit.ratio - 1.0))
    return nearest.name if abs(ratio / nearest.ratio - 1.0) < _SAME_RATIO else ""
