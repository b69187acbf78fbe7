# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The closed loop: a certified scenario in which an ego replaces one of the vehicles.

`ClosedLoop` has everything that is constant during a drive; `State` is one instant; `step` returns
the next instant and changes nothing. So drives can be repeated, branched and searched. Two drives
with the same commands are identical.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
import math
from typing import Protocol

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.config import ClosedLoopConfig, COMMITTED, FORESIGHT, REPLAY
from scenario_gen.closed_loop.coordination_space import world_of
from scenario_gen.closed_loop.criteria import find_criteria
from scenario_gen.closed_loop.drive import Drive
from scenario_gen.closed_loop.driver import DriverParameters
from scenario_gen.closed_loop.driver_traits import driver_traits, insisting, reaction_time
from scenario_gen.closed_loop.ego import Command, EgoState, move, Pose
from scenario_gen.closed_loop.lights import observed, ObservedLight
from scenario_gen.closed_loop.sensor import Sensor
from scenario_gen.closed_loop.step import advance, ego_hits
from scenario_gen.numerics import ahead_and_left, Bools, edge_lengths, Floats, wrap_angle
from scenario_gen.roads import ground_for
from scenario_gen.situation import find_conflicts
from scenario_gen.types import Dynamics, Facts, Road, Scenario, trailer_poses, Vehicle


@dataclass(frozen=True, eq=False)
class State:
    """One instant of a drive with N vehicles; the ego replaces its witness.

    Attributes:
        step: number of steps since the start.
        time: seconds from the drive's start.
        ego: the ego.
        vehicles: (N, 4) x, y [m], yaw [rad], speed [m/s] of all vehicles.
        present: (N,) whether each vehicle is in the scene.
        clock: (N,) certified time [s] of each vehicle's present place on its certified path; for
            the ego, on its witness' path.
        rate: (N,) rates of the clocks; 1 is the certified speed.
        acceleration: (N,) accelerations of the others [m/s²] that their drivers choose.
        waited: (N,) times for which each driver has waited for a vehicle that stands [s].
        seen: (K, 9) the ego now and before, newest first, as far back as the slowest driver's
            reaction time: `EgoState`, its clock on its witness' path [s], the rate of that clock,
            and 1 if it is on that path.
        passes: (N, N) whether vehicle i goes ahead of vehicle j, against the certified order.
        forced: number of times that one of the others has braked harder than the strongest
            braking, or more suddenly than the jerk allows, to preserve the order.
        fault: description of an error in the last command, "" if it was correct.
        jumped: whether no vehicle can reach the ego's pose in one step.
        past: states before this one, newest first, as far back as the delay of the observation.
    """

    step: int
    time: float
    ego: EgoState
    vehicles: Floats
    present: Bools
    clock: Floats
    rate: Floats
    acceleration: Floats
    waited: Floats
    seen: Floats
    passes: Bools
    forced: int = 0
    fault: str = ""
    jumped: bool = False
    past: tuple["State", ...] = ()


@dataclass(frozen=True, eq=False)
class Task:
    """The planner's input before a drive.

    Attributes:
        vehicle: the ego's identity and footprint.
        start: (4,) x, y [m], yaw [rad], speed [m/s].
        goal: (4,) x, y [m], yaw [rad], speed [m/s] at the witness' end.
        route: (M, 3) x, y [m], yaw [rad] of a drivable path from start to goal: the witness' path,
            without its speeds.
        road: the drivable area for the ego's type, if it is known.
        step: time between two decisions [s].
        config: the parameters of the drive.
        speed: the witness' highest speed [m/s].
        limits: the limits of the ego's body.
    """

    vehicle: Vehicle
    start: Floats
    goal: Floats
    route: Floats
    road: Road | None
    step: float
    config: ClosedLoopConfig
    speed: float
    limits: Dynamics


@dataclass(frozen=True, eq=False)
class Observation:
    """The planner's input at one instant: the ego, and the M other vehicles that it observes.

    Attributes:
        time: seconds from the drive's start.
        ego: the ego.
        ids: ids of the others.
        others: (M, 4) x, y [m], yaw [rad], speed [m/s]; (x, y) is the footprint's centre.
        sizes: (M, 2) length and width [m].
        types: their types, such as car, bicycle or pedestrian.
        lights: traffic lights whose states are known.
    """

    time: float
    ego: EgoState
    ids: tuple[str, ...]
    others: Floats
    sizes: Floats
    types: tuple[str, ...] = ()
    lights: tuple[ObservedLight, ...] = ()


class Planner(Protocol):
    """The planner under test: it gets its task, then returns a command at every step."""

    def reset(self, task: Task) -> None:
        """Begin a new drive."""

    def act(self, observation: Observation) -> Command | Pose | None:
        """Return the ego's command for the next step; None brakes."""


PAST_GOAL_M = 10.0  # more than any vehicle drives in one step


class ClosedLoop:
    """A scenario that can be driven."""

    def __init__(
        self,
        scenario: Scenario,
        ego: int | str,
        road: Road | None = None,
        config: ClosedLoopConfig = ClosedLoopConfig(),
    ) -> None:
        """Prepare the drives of a scenario.

        Args:
            scenario: a certified scenario that includes the ego's witness.
            ego: index or id of the witness.
            road: the road of the scenario, if it is known.
            config: the parameters.

        Raises:
            InputError: the scenario has no such vehicle, or it has a trailer, the road is in
                another frame, or a criterion is not valid.
        """
        if road is not None and road.frame_id != scenario.frame_id:
            raise InputError(
                f"scenario {scenario.index} is in frame {scenario.frame_id!r}, "
                f"its road in {road.frame_id!r}"
            )
        scenario = scenario.with_trailers()
        self.scenario, self.world = scenario, world_of(scenario, ego, config.step)
        self.ego = self.world.ego
        if self.ego in chain.from_iterable(scenario.towed):
            raise InputError(
                f"vehicle {scenario.ids[self.ego]} has or is a trailer, which no planner can "
                "drive; choose another ego"
            )
        self.road = road and ground_for(road, scenario.vehicles[self.ego])
        self.config, self.limits = config, config.limits.of(scenario.vehicles[self.ego].type)
        self.criteria = find_criteria(config.criteria)
        observation = config.observation
        self._sensor = (
            None if observation.is_perfect else Sensor(observation, scenario, self.ego, road)
        )
        pairs = [(self.ego, other) for other in range(len(scenario.vehicles)) if other != self.ego]
        conflicts = find_conflicts(scenario, pairs)
        self.conflicts = {sum(conflict.pair) - self.ego: conflict for conflict in conflicts}
        self.insists = insisting(scenario, self.ego, self.conflicts)
        self.traits = driver_traits(scenario, config)
        self.reactions = self._reaction_times()
        self.parameters = self._driver_parameters()
        self._slowest = int(self.parameters.delay.max())
        self._sizes = 2.0 * self.world.half
        self._ids = tuple(vehicle.id for vehicle in scenario.vehicles)
        self._others = np.arange(len(self._ids)) != self.ego
        self.begin, end = self.world.spans[self.ego].tolist()
        self.duration = end - self.begin
        begin = self.begin
        self.lights = tuple(
            light.retimed(lambda times: times - begin) for light in scenario.facts.lights
        )
        driven_distance = self.world.cells[self.ego, -1, 7]
        self._witness_waits = bool(driven_distance < 1.0)
        self.last_step = self.steps_from(self.begin)

    def steps_from(self, begin: float) -> int:
        """Return the largest number of steps of a drive from a certified time [s] on."""
        remaining = self.begin + self.duration - begin
        return int(np.ceil((remaining * self.config.overtime + 5.0) / self.config.step))

    def driven_distance(self, vehicle: int, clocks: Floats) -> Floats:
        """Return the distances (C,) [m] on a vehicle's certified path at clocks (C,) [s]."""
        distances = self.world.cells[vehicle, :, 7]
        return np.interp(clocks, np.arange(len(distances)) * self.world.cell, distances)

    def _reaction_times(self) -> Floats:
        """Return (N,) reaction times [s]; 0 for pedestrians and for all vehicles in a replay.

        A driver who follows closely is attentive: it reacts within its time gap.
        """
        config = self.config
        times = []
        for vehicle in self.scenario.vehicles:
            reacts = config.policy != REPLAY and not vehicle.kind.walks
            times.append(reaction_time(self.scenario, vehicle.id, config.reaction * reacts))
        return np.minimum(times, self.traits.headway)

    def _driver_parameters(self) -> DriverParameters:
        config = self.config
        traits = self.traits
        foresight = FORESIGHT.get(config.policy, 0.0)
        strongest_braking = [
            min(config.strongest_braking, config.limits.of(vehicle.type).max_deceleration)
            for vehicle in self.scenario.vehicles
        ]
        return DriverParameters(
            traits.headway,
            config.standstill_gap,
            traits.acceleration,
            traits.braking,
            np.array(strongest_braking),
            config.jerk,
            traits.patience,
            traits.margin,
            np.where(self.insists, FORESIGHT[COMMITTED], foresight),
            ~self.insists,
            config.policy != REPLAY,
            np.round(self.reactions / config.step).astype(np.int64),
        )

    def task(self) -> Task:
        """Return the planner's input before a drive."""
        witness = self.world.motion[self.ego]
        route = witness[np.concatenate([[True], edge_lengths(witness[:, :2]) > 1e-3]), :3]
        vehicle, config = self.scenario.vehicles[self.ego], self.config
        return Task(
            vehicle,
            witness[0, :4],
            witness[-1, :4],
            route,
            self.road,
            config.step,
            config,
            float(witness[:, 3].max()),
            self.limits,
        )

    def start(self) -> State:
        """Return the first instant: all vehicles when the ego's witness enters the scene."""
        world = self.world
        first = int(self.scenario.present[self.ego, 0])
        vehicles = world.motion[:, first, :4].copy()
        n = len(vehicles)
        entered, left = (world.spans <= self.begin).T
        present = entered & ~(world.leaves & left)
        ego = EgoState(*vehicles[self.ego].tolist())
        seen = np.array([(*ego, self.begin, 1.0, 1.0)])  # it has driven as its witness
        return State(
            0,
            0.0,
            ego,
            vehicles,
            present,
            np.full(n, self.begin),
            np.ones(n),
            np.zeros(n),
            np.zeros(n),
            seen,
            np.zeros((n, n), dtype=np.bool_),
        )

    def step(self, state: State, asked: Command | Pose | None, note: str = "") -> State:
        """Return the next instant; `state` does not change.

        Args:
            state: the present instant.
            asked: the planner's command.
            note: description of another error in the command, which replaces that of `move`.
        """
        config = self.config
        moved = move(state.ego, asked, config, self.limits)
        ego, n = moved.state, len(self._ids)
        number = state.step + 1
        time = number * config.step
        before = np.empty((n, 4))
        before[:, 0], before[:, 1] = state.clock, state.rate
        before[:, 2], before[:, 3] = state.acceleration, state.waited
        seen = np.empty((min(len(state.seen), self._slowest) + 1, 9))
        seen[0, :6] = ego
        seen[1:] = state.seen[: len(seen) - 1]
        after, vehicles = np.empty((n, 5)), np.empty((n, 5))
        vehicles[:, 4] = state.present
        passes = state.passes.copy()
        now = self.begin + time
        advance(self.world, self.parameters, now, before, seen, passes, after, vehicles)
        for row, towing in self.scenario.towed:
            trailer = self.scenario.vehicles[towing].trailer
            assert trailer is not None
            poses = np.stack([state.vehicles[towing, :3], vehicles[towing, :3]])
            vehicles[row, :3] = trailer_poses(poses, trailer, state.vehicles[row, 2])[1]
            vehicles[row, 3:] = vehicles[towing, 3:]
            after[row] = *after[towing, :4], 0.0  # counted once where the order forces it
        clock, rate, acceleration, waited, forced = after.T
        count = state.forced + int(np.count_nonzero(forced))
        delay = config.observation.delay
        past = (replace(state, past=()), *state.past)[:delay] if delay else ()
        return State(
            number,
            time,
            ego,
            vehicles[:, :4],
            vehicles[:, 4] > 0.0,
            clock,
            rate,
            acceleration,
            waited,
            seen,
            passes,
            count,
            note or moved.fault,
            moved.jumped,
            past,
        )

    def perceive(self, state: State) -> State:
        """Return a state with the other vehicles as the ego observes them.

        Those that it does not observe are not present.
        """
        if self._sensor is None:
            return state
        source = state.past[-1] if state.past else state
        vehicles, present = self._sensor.measure(source.step, source.vehicles, source.present)
        vehicles[self.ego] = state.vehicles[self.ego]
        present[self.ego] = True
        return replace(
            source,
            step=state.step,
            time=state.time,
            ego=state.ego,
            vehicles=vehicles,
            present=present,
            past=(),
        )

    def observe(self, state: State) -> Observation:
        """Return the planner's input at an instant."""
        perceived = self.perceive(state)
        rows = np.flatnonzero(self._others & perceived.present)
        ids = tuple(self._ids[row] for row in rows)
        others, sizes = perceived.vehicles[rows], self._sizes[rows]
        lights = observed(self.lights, state.time)
        types = tuple(self.scenario.vehicles[row].type for row in rows)
        return Observation(state.time, state.ego, ids, others, sizes, types, lights)

    def drive(self, planner: Planner, ended: Callable[[State], bool] | None = None) -> Drive:
        """Drive with a planner until the drive ends.

        Args:
            planner: the planner under test.
            ended: whether the drive ends at a state; by default at the goal, at a collision (at
                the instants only) or when the time is over.
        """
        return self.record([self.start(), *self.steps(planner, ended)])

    def steps(
        self, planner: Planner, ended: Callable[[State], bool] | None = None
    ) -> Iterator[State]:
        """Yield the instants of a drive after its start; arguments as for `drive`."""
        planner.reset(self.task())
        state = self.start()
        over = ended or self.over
        while not over(state):
            state = self.step(state, planner.act(self.observe(state)))
            yield state

    def over(self, state: State) -> bool:
        """Whether a drive ends: at the goal, at a collision, or when the time is over."""
        return state.step >= self.last_step or self.at_goal(state) or self.hit(state)

    def hit(self, state: State) -> bool:
        """Whether the ego overlaps another vehicle at this instant."""
        return bool(ego_hits(state.vehicles, self.world.half, state.present, self.ego))

    def at_goal(self, state: State) -> bool:
        """Whether the ego is at its goal at this instant."""
        goal, ego = self.world.motion[self.ego, -1], state.ego
        if math.hypot(ego.x - goal[0], ego.y - goal[1]) > PAST_GOAL_M + self.config.goal_width:
            return False
        return bool(self.reached(np.array([state.time]), state.vehicles[self.ego, None])[0])

    def reached(self, time: Floats, poses: Floats) -> Bools:
        """Return (T,) whether an ego is at its goal or has passed it.

        An ego whose witness waits at the goal reaches it only at the end.

        Args:
            time: (T,) [s].
            poses: (T, 3) or wider: x, y [m], yaw [rad].
        """
        goal, width = self.world.motion[self.ego, -1], self.config.goal_width
        ahead, left = ahead_and_left(poses[:, :2] - goal[:2], goal[2])
        if self._witness_waits:
            return np.asarray((time >= self.duration - 1e-9) & (np.hypot(ahead, left) <= width))
        turn = np.abs(wrap_angle(poses[:, 2] - goal[2]))
        at_line = (ahead >= -0.2) & (ahead <= PAST_GOAL_M)
        return np.asarray(at_line & (np.abs(left) <= width) & (turn <= 1.0))

    def record(self, states: list[State]) -> Drive:
        """Return the drive with these instants."""
        vehicles = np.stack([state.vehicles for state in states], axis=1)
        speed, step = vehicles[..., 3], self.config.step
        scenario = self.scenario
        motion = Scenario(
            scenario.vehicles,
            np.arange(len(states), dtype=np.float64) * step,
            vehicles[..., :2],
            vehicles[..., 2],
            speed,
            np.diff(speed, axis=1, prepend=speed[:, :1]) / step,
            scenario.seed,
            scenario.index,
            scenario.frame_id,
            facts=Facts(lights=self.lights),
        )
        return Drive(
            motion,
            self.ego,
            np.stack([state.present for state in states], axis=1),
            np.stack([state.clock for state in states], axis=1),
            np.array([state.ego.acceleration for state in states]),
            states[-1].forced,
            tuple((state.step, state.fault) for state in states if state.fault),
            tuple(state.step for state in states if state.jumped),
        )
