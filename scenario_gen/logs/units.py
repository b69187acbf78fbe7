# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whether recorded headings and speeds would fit the positions in another unit or convention."""

from collections.abc import Sequence

import numpy as np

from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.encounters import Piece
from scenario_gen.logs.path import CONTRADICTS, MOVES
from scenario_gen.numerics import Floats, wrap_angle

SHARE = 75.0  # per cent of the headings that are no farther off: one vehicle of two may face along an axis
FITS = np.radians(5.0)  # so far off are headings that fit
NEAR = 0.03  # of a ratio of speeds
RATIOS = {"km/h (name the column speed_kmh)": 3.6, "mph (speed_mph)": 1 / 0.44704, "ft/s (speed_fps)": 1 / 0.3048}


def remarks_on_units(pieces: Sequence[Piece], origin_ns: int, config: LogConfig) -> tuple[str, ...]:
    """Return sentences on headings and speeds that contradict the positions, with the unit or convention that would fit.

    Args:
        pieces: smooth motion of all vehicles, with what was recorded.
        origin_ns: stamp of the common clock's first tick [ns].
        config: names the clock's period.
    """
    recorded, along, ratios = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    for piece in pieces:
        ticks = (piece.smooth.first + np.arange(len(piece.smooth.speed))) * config.period
        seconds = (piece.track.fix_ns - origin_ns) * 1e-9
        speed = np.interp(seconds, ticks, piece.smooth.speed)
        moves = (speed > MOVES) & np.isfinite(piece.track.heading)
        recorded.append(piece.track.heading[moves])
        along.append(np.interp(seconds[moves], ticks, piece.smooth.heading))
        stamps = (piece.track.speed_ns - origin_ns) * 1e-9
        driven = np.interp(stamps, ticks, piece.smooth.speed)
        ratios.append(piece.track.speed[driven > MOVES] / driven[driven > MOVES])
    found = (_of_headings(np.concatenate(recorded), np.concatenate(along)), _of_speeds(np.concatenate(ratios)))
    return tuple(sentence for sentence in found if sentence)


def _of_headings(recorded: Floats, along: Floats) -> str:
    """Return a sentence on headings (F,) [rad, as read] beside the directions of travel (F,) [rad]; "" if they fit."""

    def off(heading: Floats) -> float:
        return float(np.percentile(np.abs(wrap_angle(heading - along)), SHARE))

    if not len(recorded) or off(recorded) <= CONTRADICTS:
        return ""
    ways = {
        "clockwise from north (name the column heading_north_deg), or if x and y are swapped (log.columns=x=…,y=…)": np.pi / 2.0
        - recorded,
        "in degrees (name the column heading_deg)": np.radians(recorded),
        "in degrees clockwise from north (name the column heading_north_deg)": np.pi / 2.0 - np.radians(recorded),
        "turned by 180°": recorded + np.pi,
    }
    way = next((words for words, heading in ways.items() if off(heading) < FITS), "")
    return (
        f"a quarter of the recorded headings are {np.degrees(off(recorded)):.0f}° or more off the direction of travel; "
        "headings that contradict it are not used" + (f"; they would fit if they were {way}" if way else "")
    )


def _of_speeds(ratios: Floats) -> str:
    """Return a sentence on measured speeds, as ratios (S,) to those of the positions; "" if they fit."""
    ratio = float(np.median(ratios)) if len(ratios) else 1.0
    unit = next((words for words, factor in RATIOS.items() if abs(ratio / factor - 1.0) < NEAR), "")
    return f"the recorded speeds are {ratio:.2f} times those of the positions; they look like {unit}" if unit else ""
