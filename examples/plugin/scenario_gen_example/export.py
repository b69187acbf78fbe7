# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""An export format: one CSV table per scenario."""

from pathlib import Path

from scenario_gen.output.exchange import Case, ExportConfig, Exported, ExportFormat, Written


def write(folder: Path, case: Case, exported: Exported, _: ExportConfig) -> Written:
    """Write time [s], vehicle, x [m], y [m], heading [rad], speed [m/s] of all vehicles but the ego."""
    scenario = exported.others
    lines = ["time,vehicle,x,y,heading,speed"]
    for n, vehicle in enumerate(scenario.vehicles):
        columns = (scenario.time, *scenario.position[n].T, scenario.heading[n], scenario.speed[n])
        lines += [
            f"{t:.3f},{vehicle.id},{x:.3f},{y:.3f},{yaw:.4f},{v:.3f}"
            for t, x, y, yaw, v in zip(*columns, strict=True)
        ]
    name = f"case_{case.number}_{exported.index}.csv"
    (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return Written((name,))


STATES = ExportFormat(write)
