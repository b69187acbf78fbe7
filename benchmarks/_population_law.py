# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Makes `scenario_gen/resources/population.json`: how encounters of each kind differ, from NGSIM.

`python -m benchmarks._population_law` takes, of the windows of NGSIM (US Department of Transportation, public domain) that lie in
SCENARIO_GEN_DATA, every two vehicles that come within 4 s at the shared area, or 15 m. It keeps sizes of effects
only: of each kind the mean and the covariance of the features. The covariance of a kind is shrunk towards that within all kinds,
which counts as POOLED encounters, so that a kind that was seen four times has one, too.
"""

from collections.abc import Iterator
from itertools import combinations
import json
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.naturalness import DATA
from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.method.evaluation.encounter_features import (
    EncounterFeatures,
    FEATURES,
    features_of,
)
from scenario_gen.method.evaluation.law import SHIPPED
from scenario_gen.method.evaluation.population import KINDS

WINDOWS = "trajectories/ngsim_commonroad/USA_*_all_vehicles.csv"
SOURCE = "NGSIM, Lankershim Boulevard and Peachtree Street (US Department of Transportation, public domain)"
CLOSE_S, CLOSE_M, NEAR_M = 4.0, 15.0, 30.0
POOLED = 10.0  # encounters
DIGITS = 4


def members() -> list[EncounterFeatures]:
    """Return the encounters of two vehicles each."""
    found = []
    for path in sorted(DATA.glob(WINDOWS)):
        for one, other in _near_each_other(path):
            try:
                encounters = read_log([path], LogConfig(vehicles=f"{one},{other}")).encounters
            except InputError:
                continue  # they have too little in common
            found += [features_of(encounter, path.stem, 0) for encounter in encounters]
    gap, distance = FEATURES.index("gap"), FEATURES.index("distance")
    close = [
        abs(member.features[gap]) < CLOSE_S or member.features[distance] < CLOSE_M
        for member in found
    ]
    return [
        member
        for member, near in zip(found, close, strict=True)
        if near and member.kind is not None
    ]


def _near_each_other(path: Path) -> Iterator[tuple[str, str]]:
    """Yield ids of two vehicles whose centres come within NEAR_M."""
    tracks = {
        name: track.set_index("t_s")[["x_m", "y_m"]]
        for name, track in pd.read_csv(path).groupby("vehicle_id")
    }
    for one, other in combinations(tracks, 2):
        apart = (tracks[one] - tracks[other]).dropna()
        if len(apart) and np.hypot(apart.x_m, apart.y_m).min() < NEAR_M:
            yield str(one), str(other)


def main() -> None:
    """Write the file."""
    seen = members()
    if not seen:
        raise SystemExit(
            f"{DATA / WINDOWS}: no such recordings; set SCENARIO_GEN_DATA to the folder that has them"
        )
    rows = {
        kind: np.array([member.features for member in seen if member.kind == kind])
        for kind in KINDS
        if any(member.kind == kind for member in seen)
    }
    scatter = {
        kind: (own - own.mean(axis=0)).T @ (own - own.mean(axis=0)) for kind, own in rows.items()
    }
    pooled = sum(scatter.values()) / len(seen)
    kinds = {}
    for kind, own in rows.items():
        covariance = (POOLED * pooled + scatter[kind]) / (POOLED + len(own))
        kinds[kind] = {
            "encounters": len(own),
            "mean": own.mean(axis=0).round(DIGITS).tolist(),
            "covariance": covariance.round(DIGITS).tolist(),
        }
        print(kind, len(own))
    document = {
        "source": SOURCE,
        "made by": "benchmarks/_population_law.py",
        "features": FEATURES,
        "kinds": kinds,
    }
    SHIPPED.write_text(json.dumps(document) + "\n")


if __name__ == "__main__":
    main()
