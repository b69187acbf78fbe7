# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The closed loop: a certified scenario, an ego in the place of one of its vehicles, and one step after the other.

`ClosedLoop` holds what does not change; `State` is one instant; `step` gives the next and changes
nothing. So a drive can be repeated, branched and searched, and two drives with the same commands
are the same, bit for bit.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol
from zlib import crc32

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.config import ClosedLoopConfig, FORESIGHT, REPLAY, TEMPLATE
from scenario_gen.closed_loop.coordination_space import world_of
from scenario_gen.closed_loop.driver import DriverParameters
from scenario_gen.closed_loop.ego import Command, EgoState, move, Pose
from scenario_gen.closed_loop.step import advance, ego_hits
from scenario_gen.numerics import Bools, Floats, wrap_angle
from scenario_gen.numerics.plane import ahead_and_left, edge_lengths
from scenario_gen.roads import ground_for
from scenario_gen.types import Dynamics, Road, Scenario, Vehicle


@dataclass(frozen=True, eq=False)
class State:
    """One instant of a drive; N vehicles, the ego in its witness' place.

    Attributes:
        step: how many steps there were before.
        time: seconds from the drive's start.
        ego: the ego.
        vehicles: (N, 4) x, y [m], yaw [rad], speed [m/s] of all.
        here: (N,) whether each is on the scene.
        clock: (N,) certified time [s] at which each one is where it is now; for the ego, on its
            witness' path.
        rate: (N,) how fast the clocks run; 1 is the certified speed.
        acceleration: (N,) of the others [m/s²], as their drivers want it.
        waited: (N,) patience that each driver has spent waiting for an ego that stands [s];
            infinity once it goes before the ego.
        seen: (K, 9) the ego now and before, newest first, as far back as the slowest driver's
            reaction time: `EgoState`, its clock on its witness' path [s], the rate of that clock,
            and 1 if it is on that path.
        forced: how many times so far one of the others has braked harder than the strongest
            braking, or more suddenly than the jerk allows, to keep the order.
        fault: what was wrong with the last command, "" if nothing.
        jumped: whether no body can take the ego's pose after one step.
    """

    step: int
    time: float
    ego: EgoState
    vehicles: Floats
    here: Bools
    clock: Floats
    rate: Floats
    acceleration: Floats
    waited: Floats
    seen: Floats
    forced: int = 0
    fault: str = ""
    jumped: bool = False


@dataclass(frozen=True, eq=False)
class Task:
    """What a planner is given before it starts.

    Attributes:
        vehicle: the ego's identity and footprint.
        start: (4,) x, y [m], yaw [rad], speed [m/s].
        goal: (4,) likewise: where the witness ends.
        route: (M, 3) x, y [m], yaw [rad] of a way from start to goal that can be driven: the
            witness' path, without its speeds.
        road: what is drivable for the ego's type, if it is known.
        step: time between two decisions [s].
        config: the parameters of the drive.
        speed: the witness' highest speed [m/s].
        limits: what the body can do.
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
    """What a planner sees at one instant: the ego, and the M others that are on the scene.

    Attributes:
        time: seconds from the drive's start.
        ego: the ego.
        ids: of the others.
        others: (M, 4) x, y [m], yaw [rad], speed [m/s]; (x, y) is the footprint's centre.
        sizes: (M, 2) length and width [m].
    """

    time: float
    ego: EgoState
    ids: tuple[str, ...]
    others: Floats
    sizes: Floats


class Planner(Protocol):
    """What is tested: told its task, then asked at every step what to do next."""

    def reset(self, task: Task) -> None:
        """Begin a new drive."""

    def act(self, observation: Observation) -> Command | Pose | None:
        """Return what the ego does until the next step; None brakes."""


@dataclass(frozen=True, eq=False)
class Drive:
    """One drive from start to end; N vehicles, T instants.

    Attributes:
        motion: all vehicles, the ego in its witness' place, as they drove: a scenario like the
            certified one.
        ego: its index.
        here: (N, T) whether each was on the scene.
        clock: (N, T) as in `State`.
        accelerations: (T,) the ego's own [m/s²].
        forced: how many times one of the others braked harder or more suddenly than drivers do, to
            keep the order.
        faults: what was wrong with commands, by step.
        jumps: the instants before which the ego jumped.
    """

    motion: Scenario
    ego: int
    here: Bools
    clock: Floats
    accelerations: Floats
    forced: int
    faults: tuple[tuple[int, str], ...]
    jumps: tuple[int, ...] = ()

    @property
    def driven(self) -> int:
        """How many instants there are before the first jump."""
        return min((*self.jumps, len(self.motion.time)))


WAITS = 1.0  # metres; a witness that drives no farther waits throughout
AT = 0.2  # metres before the goal that count as there
BEYOND = 10.0  # metres beyond it, more than anyone drives in one step
GOAL_TURN = 1.0  # rad, largest difference of heading at the goal


def reaction_time(scenario: Scenario, vehicle: str, mean: float) -> float:
    """Draw the reaction time [s] of a vehicle's driver, evenly from half to one and a half of the mean.

    It follows from the scenario's seed and index and from the vehicle's id, whoever the ego is and
    whatever it does.
    """
    words = [
        number % 2**32
        for number in (scenario.seed, scenario.seed >> 32, scenario.index, crc32(vehicle.encode()))
    ]
    return mean * (0.5 + float(np.random.default_rng(words).random()))


class ClosedLoop:
    """A scenario that can be driven."""

    def __init__(
        self,
        scenario: Scenario,
        ego: int | str,
        road: Road | None = None,
        config: ClosedLoopConfig = ClosedLoopConfig(),
    ) -> None:
        """Prepare.

        Args:
            scenario: certified, the ego's witness among its vehicles.
            ego: index or id of the witness.
            road: what it drives on, if it is known.
            config: the parameters.

        Raises:
            InputError: the scenario has no such vehicle, or the road is in another frame.
        """
        if road is not None and road.frame_id != scenario.frame_id:
            raise InputError(
                f"scenario {scenario.index} is in frame {scenario.frame_id!r}, its road in {road.frame_id!r}"
            )
        self.scenario, self.world = scenario, world_of(scenario, ego, config.step)
        self.ego = self.world.ego
        self.road = road and ground_for(road, scenario.vehicles[self.ego])
        self.config, self.limits = config, config.limits.of(scenario.vehicles[self.ego].type)
        reactive = config.policy != REPLAY
        self.reactions = np.array(
            [
                reaction_time(
                    scenario, vehicle.id, config.reaction * (reactive and not vehicle.kind.walks)
                )
                for vehicle in scenario.vehicles
            ]
        )
        self._parameters = DriverParameters(
            config.headway,
            config.standstill_gap,
            config.acceleration,
            config.comfortable_braking,
            np.array(
                [
                    min(config.strongest_braking, config.limits.of(one.type).max_deceleration)
                    for one in scenario.vehicles
                ]
            ),
            config.jerk,
            config.patience,
            FORESIGHT.get(config.policy, 0.0),
            config.yield_to_ego == TEMPLATE,
            reactive,
            np.round(self.reactions / config.step).astype(np.int64),
        )
        self._slowest = int(self._parameters.delay.max())
        self._sizes = 2.0 * self.world.half
        self._ids = tuple(vehicle.id for vehicle in scenario.vehicles)
        self._others = np.arange(len(self._ids)) != self.ego
        self.begin, end = self.world.spans[self.ego].tolist()
        self.duration = end - self.begin
        self._waits = bool(self.world.cells[self.ego, -1, 7] < WAITS)
        self.last_step = int(np.ceil((self.duration * config.overtime + 5.0) / config.step))

    def task(self) -> Task:
        """Return what a planner is told beforehand."""
        own = self.world.motion[self.ego]
        route = own[np.concatenate([[True], edge_lengths(own[:, :2]) > 1e-3]), :3]
        vehicle, config = self.scenario.vehicles[self.ego], self.config
        return Task(
            vehicle,
            own[0, :4],
            own[-1, :4],
            route,
            self.road,
            config.step,
            config,
            float(own[:, 3].max()),
            self.limits,
        )

    def start(self) -> State:
        """Return the first instant: where everyone is when the ego's witness comes onto the scene."""
        known = self.world
        first = int(self.scenario.present[self.ego, 0])
        vehicles = known.motion[:, first, :4].copy()
        n = len(vehicles)
        here = (known.spans[:, 0] <= self.begin) & ~(
            known.leaves & (known.spans[:, 1] <= self.begin)
        )
        ego = EgoState(*vehicles[self.ego].tolist())
        seen = np.array([(*ego, self.begin, 1.0, 1.0)])  # before that it drove as its witness
        return State(
            0,
            0.0,
            ego,
            vehicles,
            here,
            np.full(n, self.begin),
            np.ones(n),
            np.zeros(n),
            np.zeros(n),
            seen,
        )

    def step(self, state: State, asked: Command | Pose | None, note: str = "") -> State:
        """Return the next instant; `state` stays what it was. `note` says what else was wrong with what was asked."""
        config = self.config
        moved = move(state.ego, asked, config, self.limits)
        ego, n = moved.state, len(self._ids)
        number = state.step + 1
        time = number * config.step
        before = np.column_stack([state.clock, state.rate, state.acceleration, state.waited])
        seen = np.empty((min(len(state.seen), self._slowest) + 1, 9))
        seen[0, :6], seen[1:] = ego, state.seen[: len(seen) - 1]
        after, vehicles, here = np.empty((n, 5)), np.empty((n, 4)), np.empty(n, dtype=np.bool_)
        advance(
            self.world, self._parameters, self.begin + time, before, seen, after, vehicles, here
        )
        clock, rate, acceleration, waited, forced = after.T
        count = state.forced + int(np.count_nonzero(forced))
        return State(
            number,
            time,
            ego,
            vehicles,
            here,
            clock,
            rate,
            acceleration,
            waited,
            seen,
            count,
            note or moved.fault,
            moved.jumped,
        )

    def observe(self, state: State) -> Observation:
        """Return what a planner sees."""
        seen = self._others & state.here
        ids = tuple(name for name, there in zip(self._ids, seen.tolist(), strict=True) if there)
        return Observation(state.time, state.ego, ids, state.vehicles[seen], self._sizes[seen])

    def drive(self, planner: Planner, ended: Callable[[State], bool] | None = None) -> Drive:
        """Drive with a planner until it is over.

        Args:
            planner: what is tested.
            ended: says when to stop; by default at the goal, at a collision (of instants only) or
                after the time given.
        """
        planner.reset(self.task())
        states = [self.start()]
        over = ended or self.over
        while not over(states[-1]):
            states.append(self.step(states[-1], planner.act(self.observe(states[-1]))))
        return self.record(states)

    def over(self, state: State) -> bool:
        """Whether a drive ends: at the goal, when the ego overlaps another, or after the time given."""
        return state.step >= self.last_step or self.at_goal(state) or self.hit(state)

    def hit(self, state: State) -> bool:
        """Whether the ego overlaps another at this instant."""
        return bool(ego_hits(state.vehicles, self.world.half, state.here, self.ego))

    def at_goal(self, state: State) -> bool:
        """Whether the ego is at its goal at this instant."""
        return bool(self.reached(np.array([state.time]), state.vehicles[self.ego, None])[0])

    def reached(self, time: Floats, poses: Floats) -> Bools:
        """Return (T,) whether an ego is at its goal, or has passed it, at times (T,) [s] and poses (T, 3+) x, y [m], yaw [rad].

        If the witness waits there, only at the end.
        """
        goal, width = self.world.motion[self.ego, -1], self.config.goal_width
        ahead, left = ahead_and_left(poses[:, :2] - goal[:2], goal[2])
        if self._waits:
            return np.asarray((time >= self.duration - 1e-9) & (np.hypot(ahead, left) <= width))
        turn = np.abs(wrap_angle(poses[:, 2] - goal[2]))
        return np.asarray(
            (ahead >= -AT) & (ahead <= BEYOND) & (np.abs(left) <= width) & (turn <= GOAL_TURN)
        )

    def record(self, states: list[State]) -> Drive:
        """Return the drive of these instants."""
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
        )
        return Drive(
            motion,
            self.ego,
            np.stack([state.here for state in states], axis=1),
            np.stack([state.clock for state in states], axis=1),
            np.array([state.ego.acceleration for state in states]),
            states[-1].forced,
            tuple((state.step, state.fault) for state in states if state.fault),
            tuple(state.step for state in states if state.jumped),
        )
