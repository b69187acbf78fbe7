# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whether recorded headings and speeds would fit the positions in another unit or convention."""

from collections.abc import Sequence

import numpy as np

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.encounters import Piece
from scenario_gen.logs.path import HEADINGS
from scenario_gen.numerics import Floats, wrap_angle

SHARE = 75.0  # per cent of the headings that are no farther off: one vehicle of two may face along an axis
FITS = np.radians(5.0)  # so far off are headings that fit
NEAR_RATIO = 0.03  # of a ratio of speeds
DIFFERS = 1.2  # a ratio of speeds, or its inverse, that is no error of a sensor
MIN_SAMPLES = 5  # samples of a moving vehicle
DRIVEN_M = 2.0  # by its measured speeds or its positions: less does not tell a ratio
RATIOS = {  # of measured speeds to those of the positions, and what makes them
    **{
        "km/h (name the column speed_kmh)": 3.6,
        "mph (speed_mph)": 1 / 0.44704,
        "ft/s (speed_fps)": 1 / 0.3048,
    },
    **{"knots (speed_kn)": 3600 / 1852, "cm/s (speed_cmps)": 100.0},
    **{
        "m/s, and x, y in feet (log.columns=x=…:ft,y=…:ft)": 0.3048,
        "m/s, and x, y in cm (x=…:cm,y=…:cm)": 0.01,
    },
    **{
        "m/s, and x, y in km (log.columns=x=…:km,y=…:km)": 1000.0,
        "m/s, and the time in minutes (time=…:min)": 1 / 60.0,
    },
    **{
        f"m/s, and the time in frames, {n} each second (log.columns=time=…:{n}fps)": n
        for n in (10, 15, 20, 24, 25, 30, 50, 60)
    },
}


def remarks_on_units(
    pieces: Sequence[Piece], origin_ns: int, config: LogConfig
) -> tuple[str, ...]:
    """Return sentences on headings and speeds that contradict the positions, with the unit or convention that would fit.

    Args:
        pieces: smooth motion of all vehicles, with what was recorded.
        origin_ns: stamp of the common clock's first tick [ns].
        config: names the clock's period.
    """
    recorded, along = [np.zeros(0)], [np.zeros(0)]
    driven: dict[
        str, Floats
    ] = {}  # (T, 3) of each vehicle: by its speeds; by its positions, and those with the axes swapped
    for piece in pieces:
        ticks = (piece.smooth.first + np.arange(len(piece.smooth.speed))) * config.period
        seconds = (piece.track.fix_ns - origin_ns) * 1e-9
        speed = np.interp(seconds, ticks, piece.smooth.speed)
        moves = (speed > HEADINGS.moving_mps) & np.isfinite(piece.track.heading)
        recorded.append(piece.track.heading[moves])
        along.append(np.interp(seconds[moves], ticks, piece.smooth.heading))
        stamps = (piece.track.speed_ns - origin_ns) * 1e-9
        if len(stamps) > 1:
            step = np.diff(piece.smooth.position, axis=0)
            own = np.column_stack(
                [
                    np.interp(ticks, stamps, piece.track.speed)[1:] * config.period,
                    np.hypot(*step.T),
                ]
            )
            own = np.column_stack([own, np.hypot(*(step * _swapped(piece.track.origin)).T)])
            driven[piece.track.id] = np.concatenate(
                [driven.get(piece.track.id, np.zeros((0, 3))), own]
            )
    geographic = any(piece.track.origin for piece in pieces)
    least = HEADINGS.moving_mps * config.period
    totals = np.array(
        [_totals(own, least) for own in driven.values() if own.sum(axis=0)[:2].max() > DRIVEN_M]
    ).reshape(-1, 4)
    found = (
        _of_headings(np.concatenate(recorded), np.concatenate(along), geographic=geographic),
        _of_speeds(totals, geographic),
    )
    return tuple(sentence for sentence in found if sentence)


def _totals(steps: Floats, least: float) -> list[float]:
    """Return the sums of steps (T, 3) [m], and the median ratio of the first to the second where that is above `least`."""
    rolls = steps[steps[:, 1] > least]
    by_speed, by_place, swapped = steps.sum(axis=0)
    ratio = (
        np.median(rolls[:, 0] / rolls[:, 1])
        if len(rolls) >= MIN_SAMPLES
        else by_speed / max(by_place, 1e-3)
    )
    return [by_speed, by_place, swapped, float(ratio)]


def _swapped(origin: tuple[float, float] | None) -> Floats:
    """Return the factors (2,) of steps east and north if latitude and longitude were the other one."""
    latitude, longitude = np.radians(origin or (0.0, 0.0))
    return np.array([1.0 / max(np.cos(latitude), 0.01), abs(np.cos(longitude))])


def _of_headings(recorded: Floats, along: Floats, *, geographic: bool) -> str:
    """Return a sentence on headings (F,) [rad, as read] beside the directions of travel (F,) [rad]; "" if they fit."""

    def off(heading: Floats) -> float:
        return float(np.percentile(np.abs(wrap_angle(heading - along)), SHARE))

    if not len(recorded) or off(recorded) <= HEADINGS.contradiction_rad:
        return ""
    axes = (
        "lat and lon are swapped (log.columns=lat=LON,lon=LAT)"
        if geographic
        else "x and y are swapped (log.columns=x=…,y=…)"
    )
    ways = {
        f"clockwise from north (name the column heading_north_deg), or if {axes}": np.pi / 2.0
        - recorded,
        "clockwise, or if y points the other way (log.columns=heading=-…, or y=-…)": -recorded,
        "in degrees (name the column heading_deg)": np.radians(recorded),
        "in degrees clockwise from north (name the column heading_north_deg)": np.pi / 2.0
        - np.radians(recorded),
        "turned by 180°": recorded + np.pi,
    }
    way = next((words for words, heading in ways.items() if off(heading) < FITS), "")
    return (
        f"a quarter of the recorded headings are {np.degrees(off(recorded)):.0f}° or more off the direction of travel; "
        "headings that contradict it are not used"
        + (f"; they would fit if they were {way}" if way else "")
    )


def _of_speeds(totals: Floats, geographic: bool) -> str:
    """Return a sentence on measured speeds; "" if they fit.

    Args:
        totals: (V, 4) metres driven by each vehicle: by its speeds, by its positions, and by these with the axes swapped; and
            the median ratio of its speeds to those of the positions.
        geographic: whether positions were latitudes and longitudes.
    """
    ratios = totals[:, 3]
    off = np.maximum(ratios, 1.0 / np.maximum(ratios, 1e-9))
    if not len(totals) or (off > DIFFERS).sum() < len(totals) / 2.0:
        return ""
    whole = totals[:, 0] / np.maximum(totals[:, 1], 1e-3)
    all_in_all = totals[:, 0].sum() / max(totals[:, 1].sum(), 1e-3)
    known = [
        _nearest(float(own), geographic)
        for own in (np.median(ratios), all_in_all, np.median(whole))
    ]
    far, unit, ratio = next((one for one in known if one[0] < NEAR_RATIO), known[0])
    swapped = totals[:, 0] / np.maximum(totals[:, 2], 1e-3)
    count = f"{(off > DIFFERS).sum()} of {len(totals)} vehicles"
    said = f"the recorded speeds are {ratio:.2f} times those of the positions in {count}"
    if geographic and (np.abs(np.log(np.maximum(swapped, 1e-9))) < 0.5 * np.log(DIFFERS)).all():
        return f"{said}; they would fit if lat and lon were swapped (log.columns=lat=LON,lon=LAT, each the other column)"
    if max(ratio, 1.0 / max(ratio, 1e-9)) <= DIFFERS:
        return ""
    return (
        f"{said}; they look like {unit}"
        if far < NEAR_RATIO
        else f"{said}: check the time and the units of x, y and speeds"
    )


def _nearest(ratio: float, geographic: bool) -> tuple[float, str, float]:
    """Return how far a ratio of speeds is from one that a unit makes, as a share of it; that unit; and the ratio."""
    units = [
        (abs(ratio / factor - 1.0), words)
        for words, factor in RATIOS.items()
        if not (geographic and "x, y" in words)
    ]
    return *min(units), ratio
