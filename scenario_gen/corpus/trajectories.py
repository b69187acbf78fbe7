# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Trajectories of scenarios as Parquet: a row per vehicle, with a list of its samples."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.corpus.tasks import arriving
from scenario_gen.types import Scenario

SAMPLE = {
    "time": ("t", "s", 0.0),
    "x": ("x", "m", 512.0),
    "y": ("y", "m", 512.0),
    "heading": ("heading", "rad", 1024.0),
    "speed": ("speed", "m/s", 256.0),
}
"""Field, unit and steps per unit of a motion's columns; 0: exact.

Rounded binary fractions take a third of the bytes.
"""


def write_trajectories(
    target: Path, scenarios: Sequence[tuple[Mapping[str, Any], Scenario]]
) -> None:
    """Write a table with a row for each vehicle of each scenario.

    Columns: sha256, template and index of the scenario, vehicle (id), type, length and width [m],
    and trajectory, a list of samples (t, x, y, heading, speed) while the vehicle is present. Units
    are in the metadata of the fields. Values are rounded to 2 mm, 1 mrad and 4 mm/s.

    Args:
        target: the file.
        scenarios: rows of the table of scenarios, and their motions.
    """
    import pyarrow as pa
    from pyarrow import parquet

    def metres(name: str) -> Any:
        return pa.field(name, pa.float64(), metadata={"unit": "m"})

    motions = [scenario.columns() for _, scenario in scenarios]
    arrays, fields = [], []
    for name, (field, unit, steps) in SAMPLE.items():
        values = np.concatenate([columns[name] for columns in motions])
        arrays.append(pa.array(np.round(values * steps) / steps if steps else values))
        fields.append(pa.field(field, pa.float64(), metadata={"unit": unit}))
    counts = [count for _, scenario in scenarios for count in scenario.is_present.sum(axis=1)]
    samples = pa.StructArray.from_arrays(arrays, fields=fields)
    offsets = pa.array(np.cumsum([0, *counts]), pa.int32())
    trajectory = pa.ListArray.from_arrays(offsets, samples, type=pa.list_(samples.type))
    vehicles = [
        {name: row[name] for name in ("sha256", "template", "index")}
        | {"vehicle": vehicle.id, "type": vehicle.type}
        | {"length": vehicle.length, "width": vehicle.width}
        for row, scenario in scenarios
        for vehicle in scenario.vehicles
    ]
    texts = [pa.field(name, pa.string()) for name in ("sha256", "template", "vehicle", "type")]
    numbers = [pa.field("index", pa.int64()), metres("length"), metres("width")]
    columns = pa.schema([*texts, *numbers])
    table = pa.Table.from_pylist(vehicles, schema=columns)
    table = table.append_column("trajectory", trajectory)
    with arriving(target) as part:
        parquet.write_table(
            table,
            part,
            compression="zstd",
            compression_level=9,
            use_dictionary=[*columns.names, "trajectory.list.element.t"],
            use_byte_stream_split=[
                f"trajectory.list.element.{field}" for field, _, steps in SAMPLE.values() if steps
            ],
        )
