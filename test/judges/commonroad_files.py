# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Judge CommonRoad files by other people's programs, in the environment of requirements/judges-commonroad.lock.

`python commonroad_files.py check FOLDER`: the schema (lxml), commonroad-io's reading against the file's own numbers, and the
drivability checker: collisions, who leaves the road, and whether both are found where they are planted.
`python commonroad_files.py drive FOLDER`: commonroad-reactive-planner at each planning problem; its track is then beside it, in
NAME.track.json. It has LIMIT for each, and plans for its own vehicle, or for the length and width [m] in NAME.size.json, for a
planning problem has none. One JSON object on the last line.
"""

from copy import deepcopy
import json
from pathlib import Path
import signal
import sys
import time
import warnings
import xml.etree.ElementTree as ET

from commonroad.common.file_reader import CommonRoadFileReader
import commonroad.scenario_definition
from commonroad_dc.boundary.boundary import create_road_boundary_obstacle
from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import (
    create_collision_object,
)
from commonroad_rp.reactive_planner import ReactivePlanner
from commonroad_rp.state import ReactivePlannerState
from commonroad_rp.utility.config import ReactivePlannerConfiguration
from commonroad_rp.utility.utils_coordinate_system import (
    create_coordinate_system,
    create_initial_ref_path,
)
from lxml import etree
import numpy as np

SCHEMA = (
    Path(commonroad.scenario_definition.__path__[0])
    / "xml_definition_files"
    / "XML_commonRoad_XSD.xsd"
)
AHEAD, COMFORT, SLOWEST = 30.0, 2.0, 2.5  # metres looked ahead, m/s² across, m/s
BEYOND = 60.0  # metres of reference path beyond its end
SEEN, IN_LANE, ALONG = (
    60.0,
    1.0,
    1.0,
)  # metres ahead, metres beside the reference path, rad: who is followed
BETWEEN, HEADWAY, SETTLED = (
    7.0,
    1.0,
    2.0,
)  # metres between rear axle and the other's centre when both stand, s, s
LIMIT = 60.0  # seconds of CPU time for one problem


def read_error(path, scenario):
    """Return by how much [m] positions that commonroad-io read differ from those written."""
    worst = 0.0
    for obstacle in ET.parse(path).getroot().iter("dynamicObstacle"):
        known = scenario.obstacle_by_id(int(obstacle.attrib["id"]))
        for state in [obstacle.find("initialState"), *obstacle.iterfind("trajectory/state")]:
            k = int(state.find("time/exact").text)
            place = [float(state.find(f"position/point/{axis}").text) for axis in "xy"]
            worst = max(worst, float(np.abs(known.state_at_time(k).position - place).max()))
    return worst


def planted(path, boundary):
    """Say whether a collision is found where a vehicle drives as another does, and a departure where it drives beside.

    Every plant is a copy of the file's vehicle, moved once: commonroad-io keeps the occupancies of the first move.
    """
    scenario, _ = CommonRoadFileReader(str(path)).open()
    first, *others = scenario.dynamic_obstacles

    def moved(by):
        copied = deepcopy(first)
        copied.translate_rotate(by, 0.0)
        return create_collision_object(copied)

    across = np.array(
        [-np.sin(first.initial_state.orientation), np.cos(first.initial_state.orientation)]
    )
    departure = any(
        moved(5.0 * k * across).collide(boundary) for k in range(1, 7)
    )  # 5 m, 10 m, … beside: a road may be wide
    if not others:
        return None, departure
    second = others[0]
    onto = moved(second.initial_state.position - first.initial_state.position)
    return onto.collide(create_collision_object(second)), departure


def check(folder):
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    found = {
        "files": 0,
        "invalid": [],
        "read_error": 0.0,
        "collisions": [],
        "off_road": [],
        "not_found": [],
    }
    for path in sorted(folder.rglob("*.xml")):
        name = str(path.relative_to(folder))
        found["files"] += 1
        if not schema.validate(etree.parse(str(path))):
            found["invalid"].append(name)
        scenario, _ = CommonRoadFileReader(str(path)).open()
        found["read_error"] = max(found["read_error"], read_error(path, scenario))
        _, boundary = create_road_boundary_obstacle(scenario, method="aligned_triangulation")
        things = [create_collision_object(obstacle) for obstacle in scenario.dynamic_obstacles]
        found["collisions"] += [name] * any(
            a.collide(b) for k, a in enumerate(things) for b in things[:k]
        )
        found["off_road"] += [name] * any(
            thing.collide(boundary)
            for thing, obstacle in zip(things, scenario.dynamic_obstacles, strict=True)
            if obstacle.obstacle_type.value != "pedestrian"  # who may walk beside the lanes
        )
        found["not_found"] += [name] * (False in planted(path, boundary))
    return found


def reference_path(scenario, problem):
    """Return the route planner's path, continued straight on."""
    path = create_initial_ref_path(scenario.lanelet_network, problem)
    step = path[-1] - path[-5]
    step /= np.hypot(*step)
    return np.vstack([path, path[-1] + np.arange(1.0, BEYOND)[:, None] * step])


def desired_speed(planner, cruise):
    """Return the speed that the bends ahead allow, for the planner itself does not slow down for them."""
    s, path, curvature = (
        planner.x_0_cl[0][0],
        planner.coordinate_system.ref_pos,
        planner.coordinate_system.ref_curv,
    )
    ahead = np.abs(curvature[(path > s - 2.0) & (path < s + AHEAD)])
    return max(SLOWEST, min(cruise, float(np.sqrt(COMFORT / max(ahead.max(initial=1e-6), 1e-6)))))


def following_speed(planner, scenario, step):
    """Return the speed at which the planner does not run into who drives ahead in its lane; it does not look so far itself."""
    (s, *_), now, allowed = planner.x_0_cl[0], planner.x_0, np.inf
    for obstacle in scenario.dynamic_obstacles:
        state = obstacle.state_at_time(step)
        if (
            state is None
            or abs(np.angle(np.exp(1j * (state.orientation - now.orientation)))) > ALONG
        ):
            continue
        try:
            ahead, beside = planner.coordinate_system.convert_to_curvilinear_coords(
                *state.position
            )
        except Exception:  # beside the reference path, its projection has no value and raises errors of its own types
            continue
        if 0.0 < ahead - s < SEEN and abs(beside) < IN_LANE:
            allowed = min(
                allowed, state.velocity + (ahead - s - BETWEEN - HEADWAY * now.velocity) / SETTLED
            )
    return max(allowed, 0.0)


def track_of(planner):
    """Return where the ego's centre was at each step: x, y [m], yaw [rad], speed [m/s]."""
    axle = planner.vehicle_params.wb_rear_axle
    states = [
        ReactivePlannerState.shift_state_to_center(state, axle)
        for state in planner.record_state_list
    ]
    return [
        [*map(float, state.position), float(state.orientation), float(state.velocity)]
        for state in states
    ]


def drive(path):
    """Return how the reactive planner fares with a file's problem, after how many steps, and its track."""
    scenario, problems = CommonRoadFileReader(str(path)).open()
    (problem,) = problems.planning_problem_dict.values()
    config = ReactivePlannerConfiguration()
    config.debug.logging_level, config.debug.multiproc = "CRITICAL", False
    config.planning.time_steps_computation, config.planning.dt = 20, scenario.dt
    config.planning.__post_init__()
    config.update(scenario=scenario, planning_problem=problem)
    if (size := path.with_suffix(".size.json")).is_file():
        config.vehicle.length, config.vehicle.width = json.loads(size.read_text())
    planner = ReactivePlanner(config)
    planner.set_reference_path(
        coordinate_system=create_coordinate_system(reference_path(scenario, problem))
    )
    planner.reset(coordinate_system=planner.coordinate_system)
    planner.record_state_and_input(planner.x_0)
    last = problem.goal.state_list[0].time_step.end
    length = planner.coordinate_system.convert_to_curvilinear_coords(
        *problem.goal.state_list[0].position.center
    )[0]
    length -= planner.x_0_cl[0][0]
    cruise = max(problem.initial_state.velocity, 3.0 * length / (last * scenario.dt), SLOWEST)
    planned = None
    while not planner.goal_reached():
        step = len(planner.record_state_list) - 1
        if step >= last:
            return "late", step, track_of(planner)
        k = step % config.planning.replanning_frequency
        if planned is None or k == 0:
            speed = max(
                planner.x_0.velocity, 0.01
            )  # at 0.0 it takes the initial speed for the desired one, and stands for ever
            wanted = min(desired_speed(planner, cruise), following_speed(planner, scenario, step))
            planner.set_desired_velocity(desired_velocity=wanted, current_speed=speed)
            planned, k = planner.plan(), 0
            if not planned:
                return "no trajectory", step, track_of(planner)
        planner.record_state_and_input(planned[0].state_list[1 + k])
        planner.reset(
            initial_state_cart=planner.record_state_list[-1],
            initial_state_curv=(planned[1][1 + k], planned[2][1 + k]),
            collision_checker=planner.collision_checker,
            coordinate_system=planner.coordinate_system,
        )
    return "reached", len(planner.record_state_list) - 1, track_of(planner)


def out_of_time(*_):
    raise TimeoutError(f"no end within {LIMIT:.0f} s of CPU time")


def drive_all(folder):
    outcomes = {}
    signal.signal(signal.SIGPROF, out_of_time)
    for path in sorted(folder.rglob("*.xml")):
        try:
            signal.setitimer(signal.ITIMER_PROF, LIMIT)
            *outcomes[path.name], track = drive(path)
            path.with_suffix(".track.json").write_text(json.dumps(track))
        except Exception as error:
            outcomes[path.name] = (f"{type(error).__name__}: {error}"[:160], 0)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        print(
            path.name,
            *outcomes[path.name],
            f"{time.process_time():.0f} s",
            file=sys.stderr,
            flush=True,
        )
    return {
        "problems": len(outcomes),
        "reached": sum(how == "reached" for how, _ in outcomes.values()),
        "outcomes": outcomes,
    }


if __name__ == "__main__":
    warnings.filterwarnings("ignore")
    print(
        json.dumps({"check": check, "drive": drive_all}[sys.argv[1]](Path(sys.argv[2]))),
        flush=True,
    )
