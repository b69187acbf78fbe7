# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The library: its public names, what importing it loads, and what the core does without any extra."""

import json
from pathlib import Path
import subprocess
import sys

from licences import extras
import pytest

import scenario_gen
from scenario_gen import bundled, read_log

EXTRA_MODULES = sorted(
    {
        one.name
        for name, listed in extras().items()
        if name not in ("core", "ros", "test")
        for one in listed
    }
)


def python(*arguments):
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parent,
    )


def test_every_public_name_is_there():
    assert len(scenario_gen.__all__) > 30 and set(scenario_gen.__all__) <= set(dir(scenario_gen))
    for name in scenario_gen.__all__:
        assert getattr(scenario_gen, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'segments'"):
        _ = scenario_gen.segments


def test_importing_the_package_loads_nothing():
    ran = python(
        "-c",
        "import sys; before = set(sys.modules); import scenario_gen; print(*(set(sys.modules) - before))",
    )
    assert {name.partition(".")[0] for name in ran.stdout.split()} <= {
        "scenario_gen",
        *sys.stdlib_module_names,
    }


def test_the_core_works_without_any_extra(tmp_path):
    """As in an environment where no extra is installed (`make core` makes a real one): their modules cannot be imported."""
    log = write_csv(tmp_path / "log.csv")
    absent = f"import sys; sys.modules.update(dict.fromkeys({EXTRA_MODULES}))"
    ran = python("-c", f"{absent}; sys.argv = ['core_use.py', {str(log)!r}]; import core_use")
    assert ran.returncode == 0, ran.stderr
    told = json.loads(ran.stdout)
    assert told["scenarios"] == 4 and told["changepoints"] and told["same"]
    assert [sentence.rpartition("[")[2].partition("]")[0] for sentence in told["refusals"]] == [
        "bags",
        "report",
    ]
    assert not set(told["loaded"]) & set(EXTRA_MODULES)


def write_csv(path):
    """Write the bundled case a as a table, which the core alone reads."""
    (encounter,) = read_log(bundled("a")).encounters
    rows = [
        "vehicle,time_s,x_m,y_m,speed_mps,heading_rad"
    ]  # a vehicle that only waits tells no heading by its places
    for n, vehicle in enumerate(encounter.vehicles):
        states = zip(
            encounter.time,
            encounter.position[n],
            encounter.speed[n],
            encounter.heading[n],
            strict=True,
        )
        rows += [
            f"{vehicle.id},{t:.1f},{x:.6f},{y:.6f},{speed:.6f},{heading:.6f}"
            for t, (x, y), speed, heading in states
        ]
    path.write_text("\n".join(rows) + "\n")
    return path
