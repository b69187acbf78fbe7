# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Vehicle-steps per CPU second of highway-env and SUMO, where they are installed: one step of the simulation for each of ours."""

from pathlib import Path
import sys
from tempfile import TemporaryDirectory
from time import process_time

from benchmarks._size import sized
from benchmarks.row import higher, Row

STEPS = sized(300, quick=5)
STREET = """<net version="1.20"><location netOffset="0,0" convBoundary="0,0,5000,0" origBoundary="0,0,5000,0" projParameter="!"/>
<edge id="e" from="a" to="b" priority="1"><lane id="e_0" index="0" speed="10" length="5000" shape="0,0 5000,0"/></edge>
<junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0"/>
<junction id="b" type="dead_end" x="5000" y="0" incLanes="e_0" intLanes="" shape="5000,0"/></net>"""


def highway_env(vehicles: int) -> list[Row]:
    """Measure `highway-v0` with as many vehicles as ours, at 10 Hz, nothing drawn, the ego going on."""
    try:
        import gymnasium
        import highway_env
    except ImportError as error:
        print(f"highway-env is not measured: {error}", file=sys.stderr)
        return []
    gymnasium.register_envs(highway_env)
    config = {
        "vehicles_count": vehicles - 1,
        "simulation_frequency": 10,
        "policy_frequency": 10,
        "duration": 10_000,
    }
    env = gymnasium.make("highway-v0", config=config)
    best = 0.0
    for seed in range(3):
        env.reset(seed=seed)
        began = process_time()
        done = 0
        for _ in range(STEPS):
            _, _, ended, cut, _ = env.step(1)  # idle
            done += len(env.unwrapped.road.vehicles)
            if ended or cut:
                env.reset()
        best = max(best, done / (process_time() - began))
    env.close()
    return [
        higher(
            f"highway-env, {vehicles} vehicles",
            best,
            "vehicle-steps/s",
            None,
            "highway-v0, kinematics observed",
        )
    ]


def sumo(vehicles: int) -> list[Row]:
    """Measure SUMO in process, as many vehicles as ours in a row, at 10 Hz; the ego is moved and all are read."""
    try:
        import libsumo
    except ImportError as error:
        print(f"SUMO is not measured: {error}", file=sys.stderr)
        return []
    ids = [f"v{k}" for k in range(vehicles)]
    cars = [
        f'<vehicle id="{name}" route="r" depart="0" departPos="{20 + 30 * k}" departSpeed="10"/>'
        for k, name in enumerate(ids)
    ]
    best = 0.0
    with TemporaryDirectory() as folder:
        net, routes = Path(folder) / "net.xml", Path(folder) / "routes.xml"
        net.write_text(STREET)
        routes.write_text(f'<routes><route id="r" edges="e"/>{"".join(cars)}</routes>')
        quiet = ["--no-step-log", "true", "--no-warnings", "true", "--collision.action", "none"]
        for _ in range(3):
            libsumo.start(
                ["sumo", "-n", str(net), "-r", str(routes), "--step-length", "0.1", *quiet]
            )
            libsumo.simulationStep()
            began = process_time()
            for step in range(10 * STEPS):
                libsumo.vehicle.moveToXY("v0", "e", 0, 20.0 + step, 0.0, 90.0, 2)
                libsumo.simulationStep()
                for name in ids:
                    (
                        libsumo.vehicle.getPosition(name),
                        libsumo.vehicle.getSpeed(name),
                        libsumo.vehicle.getAngle(name),
                    )
            best = max(best, 10 * STEPS * vehicles / (process_time() - began))
            libsumo.close()
    return [
        higher(
            f"SUMO, {vehicles} vehicles",
            best,
            "vehicle-steps/s",
            None,
            "libsumo, the ego moved by moveToXY",
        )
    ]
