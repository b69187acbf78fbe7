# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Manoeuvres: how far a vehicle turns, which manoeuvre this is, and how sharply it bends."""

from typing import Final

import numpy as np

from scenario_gen.numerics.plane import angle_between
from scenario_gen.situation.tracks import Track

MAX_TURN_CHANGE_RAD: Final = np.radians(40.0)  # between turns that are the same manoeuvre
SURELY_SAME_TURN_RAD: Final = np.radians(15.0)  # even if their names differ
MIN_NAMED_TURN_RAD = np.radians(30.0)
MIN_NAMED_U_TURN_RAD = np.radians(150.0)
BEND_WINDOW_M = 8.0


def turn_of(track: Track) -> float:
    """How far [rad, left positive] a track turns; 0 for a vehicle that stands."""
    if track.still:
        return 0.0
    start, end = track.curve.at(track.progress[[0, -1]])[:, 2]
    return float(end - start)


def manoeuvre_of(turn: float) -> str:
    """The name of a manoeuvre with this turn [rad]: "straight", "left", "right" or "U-turn"."""
    if abs(turn) < MIN_NAMED_TURN_RAD:
        return "straight"
    if abs(turn) > MIN_NAMED_U_TURN_RAD:
        return "U-turn"
    return "left" if turn > 0.0 else "right"


def is_same_turn(recorded: float, turn: float) -> bool:
    """Whether a turn [rad] is that of the recording: at most 40° different, with the same name."""
    change = abs(angle_between(turn, recorded))
    if change <= SURELY_SAME_TURN_RAD:
        return True
    return change <= MAX_TURN_CHANGE_RAD and manoeuvre_of(recorded) == manoeuvre_of(turn)


def turns_to_keep(track: Track) -> list[float]:
    """How far [rad] a track turns: by its path, and by its recorded heading unless they disagree.

    A path is smoothed, and turns less at its ends than the vehicle did.
    """
    turn, recorded = turn_of(track), track.recorded_turn
    return [turn, recorded] if is_same_turn(recorded, turn) else [turn]


def sharpness_of(track: Track) -> float:
    """The curvature [1/m] of the sharpest bend over 8 m, within the range of cars."""
    window = min(BEND_WINDOW_M, max(track.curve.length, 1.0))
    bend = abs(track.turning(BEND_WINDOW_M)) / window
    return float(np.clip(bend, 0.005, 0.17))


def describe_turn(turn: float) -> str:
    """A turn [rad] in words: "turns left by 68°", "goes straight on (4° to the right)"."""
    side = "left" if turn > 0.0 else "right"
    degrees = abs(np.degrees(turn))
    if manoeuvre_of(turn) != "straight":
        return f"turns {side} by {degrees:.0f}°"
    return (
        f"goes straight on ({degrees:.0f}° to the {side})"
        if degrees >= 1.0
        else "goes straight on"
    )
