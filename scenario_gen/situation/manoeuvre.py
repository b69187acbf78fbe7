# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a vehicle does on its way: how far it turns, which manoeuvre that is, how sharply it bends; what keeps it."""

from typing import Final

import numpy as np

from scenario_gen.numerics.plane import angle_between
from scenario_gen.situation.tracks import Track

MOST_CHANGE: Final = np.radians(
    25.0
)  # a manoeuvre is kept if its turn differs by no more, and it has the same name
_STRAIGHT, _ROUND = np.radians(30.0), np.radians(150.0)
_DOUBT: Final = np.radians(
    15.0
)  # turns that differ by less are the same manoeuvre, on whichever side of a threshold they lie
_WINDOW = 8.0  # metres over which a bend's curvature is taken
_GENTLEST, _TIGHTEST = 0.005, 0.17  # 1/m


def turn_of(track: Track) -> float:
    """How far [rad, left positive] a track's heading turns from its first to its last sample; 0 for one that stands."""
    if track.still:
        return 0.0
    start, end = track.curve.at(track.progress[[0, -1]])[:, 2]
    return float(end - start)


def manoeuvre_of(turn: float) -> str:
    """The name of a manoeuvre that turns by `turn` [rad]: "straight", "left", "right" or "U-turn"."""
    if abs(turn) < _STRAIGHT:
        return "straight"
    if abs(turn) > _ROUND:
        return "U-turn"
    return "left" if turn > 0.0 else "right"


def keeps(template: float, road: float) -> bool:
    """Whether a turn on a road [rad] is that of the template [rad]: at most 25° different, and of the same name."""
    change = abs(angle_between(road, template))
    return change <= _DOUBT or (
        change <= MOST_CHANGE and manoeuvre_of(template) == manoeuvre_of(road)
    )


def turns_to_keep(track: Track) -> list[float]:
    """How far [rad] a template's track turns: by its path, and by its recorded heading unless that contradicts the path.

    A path is smoothed, and turns less at its ends than the vehicle did.
    """
    own, recorded = turn_of(track), track.recorded_turn
    return [own, recorded] if keeps(recorded, own) else [own]


def sharpness_of(track: Track) -> float:
    """The curvature [1/m] of a track's sharpest bend, over 8 m of path; within what cars drive."""
    bend = abs(track.turning(_WINDOW)) / min(_WINDOW, max(track.curve.length, 1.0))
    return float(np.clip(bend, _GENTLEST, _TIGHTEST))


def in_words(turn: float) -> str:
    """A turn [rad] as a person says it: "turns left by 68°", "goes straight on (4° to the right)"."""
    side = "left" if turn > 0.0 else "right"
    if manoeuvre_of(turn) != "straight":
        return f"turns {side} by {abs(np.degrees(turn)):.0f}°"
    return (
        "goes straight on"
        if abs(turn) < np.radians(1.0)
        else f"goes straight on ({abs(np.degrees(turn)):.0f}° to the {side})"
    )
