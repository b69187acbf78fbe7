# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two lengths of the tests: `make test` runs the short one, `make soak PART=tests` the long one."""

import os
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[2]
LONG = os.environ.get("SCENARIO_GEN_TESTS") == "long"
"""Whether this is the long form: also what is marked `long`, and larger counts."""

DATA = Path(os.environ.get("SCENARIO_GEN_DATA", _ROOT.parent / "shared" / "data"))
"""Where recorded data lies, if it does; the fixture `data` gives it."""

SHIPPED = _ROOT / "scenario_gen" / "resources" / "recorded"
"""Where the recorded logs lie that the package ships."""

_TRAJECTORIES = DATA / "trajectories"
_CATS, _NGSIM, _PSU = (
    _TRAJECTORIES / name for name in ("cats_av_lane_change", "ngsim_commonroad", "psu_2obu")
)
VEHICLES = {
    SHIPPED / "ngsim_left_turn.csv": 2,
    SHIPPED / "ngsim_two_left_turns.csv": 3,
    SHIPPED / "v2x_following.csv": 2,
    _CATS / "encounter_3plus_lane_change_four_vehicles_utc36110.csv": 4,
    _CATS / "encounter_c_opposite_v2_v4_utc35195.csv": 2,
    _NGSIM / "encounter_3plus_two_left_turners_one_opposite_Lanker-2_13.csv": 3,
    _NGSIM / "encounter_a_cross_one_stops_Lanker-2_15_21202_21260.csv": 2,
    _NGSIM / "encounter_b_left_turn_vs_opposite_Lanker-2_13_2839_21019.csv": 2,
    _NGSIM / "encounter_c_opposite_stop_go_Peach-4_2_134_334.csv": 2,
    _TRAJECTORIES
    / "openacc_zalazone"
    / "encounter_3plus_platoon4_openacc_no_ACC_handling_part22_60-100s.csv": 4,
    _PSU / "encounter_c_opposite_approach_then_stop_meet_300-340s.csv": 2,
    _PSU / "encounter_following_follow_230-270s.csv": 2,
}
"""Every file of one recorded encounter, and how many vehicles it has."""
LOGS = tuple(
    pytest.param(
        path,
        id=path.stem[:40],
        marks=() if path.parent == SHIPPED else pytest.mark.recorded,
    )
    for path in VEHICLES
)
"""They as parameters of a test: those of the package always, others where `-m recorded` asks for them."""
