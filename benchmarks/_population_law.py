# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Make `scenario_gen/resources/population.json`: how encounters of each kind differ, from NGSIM.

`python -m benchmarks._population_law` reads the windows of NGSIM (US Department of Transportation,
public domain) in SCENARIO_GEN_DATA: every two vehicles within 4 s at the conflict area, or 15 m.
It writes the mean and the covariance of the features of each kind. The covariance of a kind is
shrunk towards that within all kinds, which counts as POOLED_COUNT encounters, so that a kind with
four encounters has one, too.
"""

from collections.abc import Iterator
from itertools import combinations
import json
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks._coverage_members import KINDS
from benchmarks._sampling_cases import DATA
from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.method.evaluation.law import (
    EncounterFeatures,
    FEATURES,
    features_of,
    JOINT_FEATURES,
    SHIPPED,
)

WINDOWS = "trajectories/ngsim_commonroad/USA_*_all_vehicles.csv"
SOURCE = (
    "NGSIM, Lankershim Boulevard and Peachtree Street "
    "(US Department of Transportation, public domain)"
)
CLOSE_S, CLOSE_M, NEAR_M = 4.0, 15.0, 30.0
POOLED_COUNT = 10.0
DIGITS = 4


def encounters() -> list[EncounterFeatures]:
    """Return the features of the encounters of two vehicles each."""
    found = []
    for path in sorted(DATA.glob(WINDOWS)):
        for one, other in _near_each_other(path):
            try:
                pair = read_log([path], LogConfig(vehicles=f"{one},{other}")).encounters
            except InputError:
                continue  # too little time in common
            found += [features_of(encounter, path.stem, 0) for encounter in pair]
    gap, distance = FEATURES.index("gap"), FEATURES.index("distance")
    return [
        one
        for one in found
        if one.kind is not None
        and (abs(one.features[gap]) < CLOSE_S or one.features[distance] < CLOSE_M)
    ]


def _near_each_other(path: Path) -> Iterator[tuple[str, str]]:
    """Yield ids of two vehicles whose centres come within NEAR_M."""
    tracks = {
        name: track.set_index("t_s")[["x_m", "y_m"]]
        for name, track in pd.read_csv(path).groupby("vehicle_id")
    }
    for one, other in combinations(tracks, 2):
        offset = (tracks[one] - tracks[other]).dropna()
        if len(offset) and np.hypot(offset.x_m, offset.y_m).min() < NEAR_M:
            yield str(one), str(other)


def main() -> None:
    """Write the file."""
    seen = encounters()
    if not seen:
        raise SystemExit(f"{DATA / WINDOWS}: no recordings; set SCENARIO_GEN_DATA to their folder")
    by_kind = {kind: np.array([one.every for one in seen if one.kind == kind]) for kind in KINDS}
    by_kind = {kind: rows for kind, rows in by_kind.items() if len(rows)}
    scatter = {kind: len(rows) * np.cov(rows.T, bias=True) for kind, rows in by_kind.items()}
    pooled = sum(scatter.values()) / len(seen)
    kinds = {}
    for kind, rows in by_kind.items():
        covariance = (POOLED_COUNT * pooled + scatter[kind]) / (POOLED_COUNT + len(rows))
        kinds[kind] = {
            "encounters": len(rows),
            "mean": rows.mean(axis=0).round(DIGITS).tolist(),
            "covariance": covariance.round(DIGITS).tolist(),
        }
        print(kind, len(rows))
    made_by = "benchmarks/_population_law.py"
    document = {
        "source": SOURCE,
        "made by": made_by,
        "features": FEATURES + JOINT_FEATURES,
        "kinds": kinds,
    }
    SHIPPED.write_text(json.dumps(document) + "\n")


if __name__ == "__main__":
    main()
