# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two lengths of the tests: `make test` runs the short one, `make soak PART=tests` the long one."""

import os
from pathlib import Path

LONG = os.environ.get("SCENARIO_GEN_TESTS") == "long"
"""Whether this is the long form: also what is marked `long`, and larger counts."""

DATA = Path(
    os.environ.get("SCENARIO_GEN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
)
"""Where recorded data lies, if it does; the fixture `data` gives it, or a folder laid out alike."""

VEHICLES = {
    "cats_av_lane_change/encounter_3plus_lane_change_four_vehicles_utc36110.csv": 4,
    "cats_av_lane_change/encounter_c_opposite_v2_v4_utc35195.csv": 2,
    "ngsim_commonroad/encounter_3plus_two_left_turners_one_opposite_Lanker-2_13.csv": 3,
    "ngsim_commonroad/encounter_a_cross_one_stops_Lanker-2_15_21202_21260.csv": 2,
    "ngsim_commonroad/encounter_b_left_turn_vs_opposite_Lanker-2_13_2839_21019.csv": 2,
    "ngsim_commonroad/encounter_c_opposite_stop_go_Peach-4_2_134_334.csv": 2,
    "openacc_zalazone/encounter_3plus_platoon4_openacc_no_ACC_handling_part22_60-100s.csv": 4,
    "psu_2obu/encounter_c_opposite_approach_then_stop_meet_300-340s.csv": 2,
    "psu_2obu/encounter_following_follow_230-270s.csv": 2,
}
"""Every encounter of either folder, by its name below `trajectories`, and how many vehicles it has."""
ENCOUNTERS = tuple(VEHICLES)
SOME_ENCOUNTERS = ENCOUNTERS if LONG else tuple(ENCOUNTERS[k] for k in (1, 2, 7))
"""In the short form one of each data set, with two or three vehicles; the platoon, the only one of its set, takes too long."""
