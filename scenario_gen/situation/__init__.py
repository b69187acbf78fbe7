# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The situation: everything that is derived from a recorded encounter, without a road."""

from scenario_gen.situation.abreast import (
    Abreast,
    abreast_in_lane,
    MAX_CLEARANCE_CHANGE_M,
    path_offsets,
)
from scenario_gen.situation.conflicts import (
    closest_crossing,
    Conflict,
    conflict_of,
    conflicts_by_pair,
    find_conflicts,
    PairConflicts,
    required_orders,
    track_conflicts,
)
from scenario_gen.situation.frenet import FrenetTracks, main_line, to_frenet
from scenario_gen.situation.gaps import (
    departure,
    encroachment,
    lane_gaps,
    LaneGaps,
    passing,
    time_gaps,
)
from scenario_gen.situation.interaction_window import (
    FOLLOW_UP_S,
    interaction_windows,
    keeps_interaction,
    LEAD_S,
    MIN_LOSS_S,
)
from scenario_gen.situation.kind import EncounterKind, kind_of
from scenario_gen.situation.losses import find_losses, LOSABLE
from scenario_gen.situation.path_crossing import pair_crossings, path_crossing
from scenario_gen.situation.placement_lsq import Equation, solve_placement
from scenario_gen.situation.separation import separate, Separation, smallest_gaps
from scenario_gen.situation.signal_stops import (
    faced_light,
    red_runners,
    runs_red,
)
from scenario_gen.situation.situation import Situation
from scenario_gen.situation.size import (
    MAX_SAMPLES,
    MAX_VEHICLES,
    refuse_reversing,
    refuse_too_large,
)
from scenario_gen.situation.tracks import (
    clean_tracks,
    describe_turn,
    driver_rows,
    drivers_of,
    find_waits,
    follows_bend,
    is_same_turn,
    manoeuvre_of,
    sharpness_of,
    STANDSTILL_SPEED_MPS,
    Track,
    turn_of,
    Wait,
    WAIT_SPEED_MPS,
)
from scenario_gen.situation.traffic_side import mirrored, traffic_side

__all__ = [
    "FOLLOW_UP_S",
    "LEAD_S",
    "LOSABLE",
    "MAX_CLEARANCE_CHANGE_M",
    "MAX_SAMPLES",
    "MAX_VEHICLES",
    "MIN_LOSS_S",
    "STANDSTILL_SPEED_MPS",
    "WAIT_SPEED_MPS",
    "Abreast",
    "Conflict",
    "EncounterKind",
    "Equation",
    "FrenetTracks",
    "LaneGaps",
    "PairConflicts",
    "Separation",
    "Situation",
    "Track",
    "Wait",
    "abreast_in_lane",
    "clean_tracks",
    "closest_crossing",
    "conflict_of",
    "conflicts_by_pair",
    "departure",
    "describe_turn",
    "driver_rows",
    "drivers_of",
    "encroachment",
    "faced_light",
    "find_conflicts",
    "find_losses",
    "find_waits",
    "follows_bend",
    "interaction_windows",
    "is_same_turn",
    "keeps_interaction",
    "kind_of",
    "lane_gaps",
    "main_line",
    "manoeuvre_of",
    "mirrored",
    "pair_crossings",
    "passing",
    "path_crossing",
    "path_offsets",
    "red_runners",
    "refuse_reversing",
    "refuse_too_large",
    "required_orders",
    "runs_red",
    "separate",
    "sharpness_of",
    "smallest_gaps",
    "solve_placement",
    "time_gaps",
    "to_frenet",
    "track_conflicts",
    "traffic_side",
    "turn_of",
]  # fmt: skip
