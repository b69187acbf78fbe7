# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""OpenSCENARIO XML 1.2: one file per scenario, next to the OpenDRIVE file of its road.

Every vehicle follows a timed polyline. Its reference point is the centre of its rear axle on the
ground, x ahead, as the standard defines it; its bounding box gives the footprint. Trajectories use
absolute time from the start of the simulation. Their start condition (simulation time at least 0)
has no edge: a rising edge would wait for a change that never happens, or happens a step late. A
vehicle that arrives late is added to the simulation at that time, and one that leaves is deleted.
The ego, if any, has an initial pose and speed and a routing action to its goal; the controller
under test drives it. Each light whose states are known has a controller with its phases; its
signals are those of the OpenDRIVE file that is written beside it.
"""

from scenario_gen.output.exchange.cases import Case, Exported, scenario_source
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.lights import light_of, phases_within
from scenario_gen.output.exchange.opendrive import signal_ids
from scenario_gen.output.exchange.xml import add, date_of, Element, number, serialized
from scenario_gen.types import (
    height,
    Obstacle,
    OBSTACLE_HEIGHT_M,
    rear_axle,
    Scenario,
    shifted,
    SignalState,
    token,
    Vehicle,
    WHEELBASE_SHARE,
)

EGO = "Ego"
WHEEL_DIAMETER_M = 0.65
LIMITS = {  # beyond those of any published scenario
    "maxSpeed": 70.0,
    "maxAcceleration": 10.0,
    "maxDeceleration": 10.0,
}


def write_openscenario(
    case: Case, exported: Exported, road_file: str, export: ExportConfig = ExportConfig()
) -> bytes:
    """Return a scenario as the bytes of an OpenSCENARIO file; `road_file` is its OpenDRIVE file.

    Raises:
        RefusedError: the ego arrives late.
    """
    exported.refuse_late_ego()
    root = Element("OpenSCENARIO")
    add(
        root,
        "FileHeader",
        revMajor="1",
        revMinor="2",
        date=date_of(case.start_ns),
        description=f"{case.road_name}, {scenario_source(case, exported)}",
        author="scenario_gen",
    )
    add(root, "ParameterDeclarations")
    add(root, "CatalogLocations")
    network = add(root, "RoadNetwork")
    add(network, "LogicFile", filepath=road_file)
    if not export.map:
        _lights(network, case, exported)
    entities = add(root, "Entities")
    for n, vehicle in enumerate(exported.others.vehicles):
        _entity(entities, entity_name(vehicle), vehicle, _speeds(exported.others, n))
    if exported.ego is not None:
        _entity(entities, EGO, exported.ego.vehicles[0], "")
    storyboard = add(root, "Storyboard")
    actions = add(storyboard, "Init/Actions")
    for n, vehicle in enumerate(exported.others.vehicles):
        if exported.others.present[n, 0] == 0:
            _placed(actions, entity_name(vehicle), exported.others, n)
    if exported.ego is not None:
        _ego(actions, exported.ego)
    for n, obstacle in enumerate(case.lane_map.network.obstacles, 1):
        _standing(entities, actions, f"obstacle_{n}", obstacle)
    act = add(add(storyboard, "Story", name="story"), "Act", name="act")
    for n in range(len(exported.others.vehicles)):
        _follow(act, exported.others, n, export.following)
    _at(add(act, "StartTrigger"), "start", 0.0, "greaterOrEqual")
    _at(add(storyboard, "StopTrigger"), "end", exported.duration, "greaterThan")
    return serialized(root)


def _lights(parent: Element, case: Case, exported: Exported) -> None:
    """Append a controller for each light; unknown states have a phase without a state."""
    network, scenario = case.lane_map.network, exported.others
    lights = scenario.facts.lights
    known = {n: light_of(rule, network, lights) for n, rule in enumerate(network.rules)}
    shown = {n: light for n, light in known.items() if light is not None}
    group = add(parent, "TrafficSignals") if shown else parent
    for n, light in shown.items():
        controller = add(group, "TrafficSignalController", name=f"light {light.id}")
        ids = signal_ids(case.lane_map, n)
        for start, end, state in phases_within(light.schedule, exported.duration):
            phase = add(controller, "Phase", name=state.value, duration=end - start)
            for name in ids if state is not SignalState.UNKNOWN else ():
                add(phase, "TrafficSignalState", trafficSignalId=name, state=state.value)


def entity_name(vehicle: Vehicle) -> str:
    """Return the name of a vehicle in the file."""
    return f"vehicle_{token(vehicle.id)}"


def _speeds(scenario: Scenario, n: int) -> str:
    """Return the speeds at a vehicle's vertices as text: the format has no element for them."""
    first, last = scenario.present[n].tolist()
    return " ".join(map(number, scenario.speed[n, first : last + 1].tolist()))


def _entity(entities: Element, name: str, vehicle: Vehicle, speeds: str) -> None:
    kind, entity = vehicle.kind.openscenario, add(entities, "ScenarioObject", name=name)
    if vehicle.kind.walks:
        element = add(
            entity,
            "Pedestrian",
            name=vehicle.type,
            mass=75.0,
            model=vehicle.type,
            pedestrianCategory=kind,
        )
    else:
        element = add(entity, "Vehicle", name=vehicle.type, vehicleCategory=kind)
    add(element, "ParameterDeclarations")
    _box(element, rear_axle(vehicle), vehicle, height(vehicle))
    if not vehicle.kind.walks:
        add(element, "Performance", **LIMITS)
        axles = add(element, "Axles")
        track = 0.85 * vehicle.width
        wheelbase = WHEELBASE_SHARE * vehicle.length
        for tag, x, steering in (("FrontAxle", wheelbase, 0.7), ("RearAxle", 0.0, 0.0)):
            add(
                axles,
                tag,
                maxSteering=steering,
                wheelDiameter=WHEEL_DIAMETER_M,
                trackWidth=track,
                positionX=x,
                positionZ=WHEEL_DIAMETER_M / 2.0,
            )
    properties = add(element, "Properties")
    if speeds:
        add(properties, "Property", name="speed_mps", value=speeds)


def _standing(entities: Element, actions: Element, name: str, obstacle: Obstacle) -> None:
    """Append an obstacle and its place."""
    entity = add(entities, "ScenarioObject", name=name)
    misc = add(entity, "MiscObject", name=name, mass=1000.0, miscObjectCategory="obstacle")
    add(misc, "ParameterDeclarations")
    _box(misc, 0.0, obstacle, OBSTACLE_HEIGHT_M)
    add(misc, "Properties")
    private = add(actions, "Private", entityRef=name)
    position = "PrivateAction/TeleportAction/Position/WorldPosition"
    add(private, position, x=obstacle.x, y=obstacle.y, h=obstacle.yaw)


def _box(parent: Element, ahead: float, sized: Vehicle | Obstacle, height_m: float) -> None:
    """Append a bounding box whose centre is so far ahead of the reference point [m]."""
    box = add(parent, "BoundingBox")
    add(box, "Center", x=ahead, y=0.0, z=height_m / 2.0)
    add(box, "Dimensions", length=sized.length, width=sized.width, height=height_m)


def _pose(parent: Element, scenario: Scenario, n: int, k: int) -> None:
    """Append the reference point of vehicle `n` at instant `k`, without z: players find it."""
    axle = shifted(
        scenario.position[n, k], scenario.heading[n, k], -rear_axle(scenario.vehicles[n])
    )
    x, y = axle.tolist()
    add(parent, "Position/WorldPosition", x=x, y=y, h=float(scenario.heading[n, k]))


def _placed(actions: Element, name: str, scenario: Scenario, n: int) -> Element:
    """Append a vehicle's place and speed at its first instant; return its initial actions."""
    first = int(scenario.present[n, 0])
    private = add(actions, "Private", entityRef=name)
    _pose(add(private, "PrivateAction/TeleportAction"), scenario, n, first)
    speed = add(private, "PrivateAction/LongitudinalAction/SpeedAction")
    add(speed, "SpeedActionDynamics", dynamicsShape="step", value=0.0, dynamicsDimension="time")
    target = "SpeedActionTarget/AbsoluteTargetSpeed"
    add(speed, target, value=float(scenario.speed[n, first]))
    return private


def _ego(actions: Element, ego: Scenario) -> None:
    private = _placed(actions, EGO, ego, 0)
    goal = add(private, "PrivateAction/RoutingAction/AcquirePositionAction")
    _pose(goal, ego, 0, int(ego.present[0, 1]))


def _at(trigger: Element, name: str, seconds: float, rule: str) -> None:
    """Append a condition on the simulation time, without an edge."""
    group = add(trigger, "ConditionGroup")
    condition = add(group, "Condition", name=name, delay=0.0, conditionEdge="none")
    add(condition, "ByValueCondition/SimulationTimeCondition", value=seconds, rule=rule)


def _follow(act: Element, scenario: Scenario, n: int, mode: str) -> None:
    """Append a vehicle's maneuver: a late arrival, its trajectory, and an early departure."""
    name = entity_name(scenario.vehicles[n])
    first, last = scenario.present[n].tolist()
    begin, end = scenario.time[[first, last]].tolist()
    group = add(act, "ManeuverGroup", name=f"{name}_group", maximumExecutionCount=1)
    add(add(group, "Actors", selectTriggeringEntities="false"), "EntityRef", entityRef=name)
    maneuver = add(group, "Maneuver", name=f"{name}_maneuver")
    if first > 0:
        event = add(maneuver, "Event", name=f"{name}_arrives", priority="parallel")
        arrival = _entity_action(event, f"{name}_added", name)
        _pose(add(arrival, "AddEntityAction"), scenario, n, first)
        _at(add(event, "StartTrigger"), f"{name}_arrival", begin, "greaterOrEqual")
    priority = "parallel" if first > 0 else "override"
    event = add(maneuver, "Event", name=f"{name}_drives", priority=priority)
    action = add(event, "Action", name=f"{name}_follows")
    follow = add(action, "PrivateAction/RoutingAction/FollowTrajectoryAction")
    reference = add(follow, "TrajectoryRef")
    trajectory = add(reference, "Trajectory", name=f"{name}_trajectory", closed="false")
    add(trajectory, "ParameterDeclarations")
    polyline = add(trajectory, "Shape/Polyline")
    for k in range(first, last + 1):
        _pose(add(polyline, "Vertex", time=float(scenario.time[k])), scenario, n, k)
    timing = "TimeReference/Timing"
    add(follow, timing, domainAbsoluteRelative="absolute", scale=1.0, offset=0.0)
    add(follow, "TrajectoryFollowingMode", followingMode=mode)
    _at(add(event, "StartTrigger"), f"{name}_start", begin, "greaterOrEqual")
    if last < len(scenario.time) - 1:
        event = add(maneuver, "Event", name=f"{name}_leaves", priority="parallel")
        add(_entity_action(event, f"{name}_deleted", name), "DeleteEntityAction")
        _at(add(event, "StartTrigger"), f"{name}_departure", end, "greaterOrEqual")


def _entity_action(event: Element, action_name: str, entity: str) -> Element:
    action = add(event, "Action", name=action_name)
    return add(add(action, "GlobalAction"), "EntityAction", entityRef=entity)
