# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is about the recorded encounter on its own ground: tracks, path coordinates, stops, conflicts."""

from scenario_gen.situation.frenet import FrenetTracks, main_line, MainLine, to_frenet
from scenario_gen.situation.gaps import (
    conflict_of,
    conflicts_by_pair,
    conflicts_in,
    departure,
    lag_behind,
    lane_gaps,
    LaneGaps,
    Meetings,
    meetings,
    Motion,
    passing,
    time_gaps,
)
from scenario_gen.situation.interaction import (
    closest_crossing,
    Conflict,
    find_conflicts,
    find_waits,
    required_orders,
    STAND_SPEED,
    Wait,
    WAIT_SPEED,
)
from scenario_gen.situation.kind import EncounterKind, kind_of
from scenario_gen.situation.manoeuvre import (
    in_words,
    keeps,
    manoeuvre_of,
    MOST_CHANGE,
    sharpness_of,
    turn_of,
    turns_to_keep,
)
from scenario_gen.situation.path_crossing import pair_crossings, path_crossing
from scenario_gen.situation.placement_lsq import Equation, solve_starts
from scenario_gen.situation.reactions import find_reactions
from scenario_gen.situation.separation import (
    least_gaps,
    separate,
    separate_recorded,
    smallest_gaps,
)
from scenario_gen.situation.situation import Situation
from scenario_gen.situation.size import (
    MOST_SAMPLES,
    MOST_VEHICLES,
    refuse_reversing,
    refuse_too_large,
)
from scenario_gen.situation.tracks import (
    clean_tracks,
    driver_rows,
    drivers_of,
    Track,
)
from scenario_gen.situation.traffic_side import mirrored, traffic_side

__all__ = [
    "MOST_CHANGE",
    "MOST_SAMPLES",
    "MOST_VEHICLES",
    "STAND_SPEED",
    "WAIT_SPEED",
    "Conflict",
    "EncounterKind",
    "Equation",
    "FrenetTracks",
    "LaneGaps",
    "MainLine",
    "Meetings",
    "Motion",
    "Situation",
    "Track",
    "Wait",
    "clean_tracks",
    "closest_crossing",
    "conflict_of",
    "conflicts_by_pair",
    "conflicts_in",
    "departure",
    "driver_rows",
    "drivers_of",
    "find_conflicts",
    "find_reactions",
    "find_waits",
    "in_words",
    "keeps",
    "kind_of",
    "lag_behind",
    "lane_gaps",
    "least_gaps",
    "main_line",
    "manoeuvre_of",
    "meetings",
    "mirrored",
    "pair_crossings",
    "passing",
    "path_crossing",
    "refuse_reversing",
    "refuse_too_large",
    "required_orders",
    "separate",
    "separate_recorded",
    "sharpness_of",
    "smallest_gaps",
    "solve_starts",
    "time_gaps",
    "to_frenet",
    "traffic_side",
    "turn_of",
    "turns_to_keep",
]  # fmt: skip
