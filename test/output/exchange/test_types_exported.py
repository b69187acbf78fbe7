# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Road users of every type are written as what other formats call them, and read again as what they were."""

import numpy as np
from support.small_scenarios import case_of, moving, observed
from test_autoware import decoded, TRACKS

from scenario_gen.logs.kinds import type_called
from scenario_gen.output.exchange.commonroad import write_commonroad
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.scenarionet import description
from scenario_gen.types import Vehicle, VEHICLE_TYPES

KINDS = {name: kind for name, kind in VEHICLE_TYPES.built_in.items() if name != "other"}
ALL = moving(
    [[15.0 * k, 0.0, 0.0, 4.0, 0.0, 0.0] for k in range(len(KINDS))],
    vehicles=[
        Vehicle(str(k), kind.length, kind.width, name)
        for k, (name, kind) in enumerate(KINDS.items())
    ],
)


def test_what_is_written_is_read_again(tmp_path):
    data, _ = write_commonroad(*case_of(ALL), ExportConfig())
    path = tmp_path / "all.xml"
    path.write_bytes(data)
    read = observed(path).vehicles
    missing = {"van": "car", "trailer": "truck", "e_scooter": "bicycle"}  # in CommonRoad
    same = {name: name for name in KINDS} | missing
    assert [type_called(seen.kind) for seen in read] == list(same.values())
    assert [(seen.length, seen.width) for seen in read] == [
        (kind.length, kind.width) for kind in KINDS.values()
    ]
    for n, seen in enumerate(read):
        assert np.allclose(seen.fix[0], ALL.position[n, 0], atol=1e-6)


def test_exports_are_told_the_type():
    _, first = decoded(ALL)[TRACKS][0]
    labels = [entry.classification[0].label for entry in first.objects]
    assert labels == [1, 1, 2, 4, 3, 5, 6, 6, 7]
    described = description(*case_of(ALL), ExportConfig())
    assert [track["type"] for track in described["tracks"].values()] == [
        *["VEHICLE"] * 5,
        *["CYCLIST"] * 3,
        "PEDESTRIAN",
    ]
    counted = described["metadata"]["number_summary"]["num_objects_each_type"]
    assert counted == {"CYCLIST": 3, "PEDESTRIAN": 1, "VEHICLE": 5}
