# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A Gymnasium environment over the closed loop: `pip install 'scenario_gen[gym,bags]'`.

    import scenario_gen.closed_loop.environment  # registers scenario_gen/Drive-v0

    env = gymnasium.make("scenario_gen/Drive-v0", trials="out/mine/bag", ego="2")
    seen, info = env.reset(seed=7, options={"index": 0})
    seen, reward, terminated, truncated, info = env.step(env.action_space.sample())

Many at once: `gymnasium.make_vec("scenario_gen/Drive-v0", 8, "async", trials="out/mine/bag",
ego="2")`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
from gymnasium.spaces import Box
import numpy as np
import numpy.typing as npt

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.lights import crosses_at_red
from scenario_gen.closed_loop.off_road import is_off_road
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.planners import NEAR_STATIONS
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.closed_loop.trials import trials_in
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.numerics import Bools, Floats, place
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.kernels import B1, F, F1, F2, I, kernel, OUT1
from scenario_gen.types import GenerationResult, MAX_PLANNED_CURVATURE_PER_M

MAX_OTHERS_COUNT = 8
ROUTE_STATIONS = np.array((0.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0))
"""Distances [m] along the route to the observed points; the offset is measured at the first."""
RANGE_M = 100.0  # vehicles farther away are not observed
MAX_SPEED_MPS = 100.0
ID = "scenario_gen/Drive-v0"

Array = npt.NDArray[np.float32]


class DriveEnv(gymnasium.Env[Array, Array]):  # type: ignore[misc]
    """Drives in one scenario at a time, drawn by the seed or selected by its index.

    Observation (float32, in the ego's frame, x ahead):

    - the ego: speed [m/s], curvature [1/m], offset from the route [m, left positive], angle to it
      [rad], metres to the goal;
    - the route at 5, 10, 15, 20, 30 and 40 m ahead: x, y [m] each;
    - the 8 nearest others within 100 m: 1, x, y [m], cos and sin of the relative yaw, speed [m/s],
      length [m]; zeros if there are fewer.

    All values are limited to the bounds of the space: 100 m and m/s, 1000 m to the goal, 50 m of
    length, the body's sharpest curvature.

    Action (float32, 2): acceleration, from -1 (the body's largest deceleration) to 1 (its largest
    acceleration), and curvature, as a share of the body's sharpest from -1 to 1.

    Reward: distance driven along the route [m]; -100 for a collision, exit or red light, +10 at
    the goal. Each of those terminates the drive; it is truncated when the time is over. Then
    `info["verdict"]` is the verdict.
    """

    def __init__(
        self,
        trials: GenerationResult | Sequence[Trial] | Path | str,
        config: ClosedLoopConfig = ClosedLoopConfig(),
        ego: str = "",
    ) -> None:
        """Prepare an environment.

        Args:
            trials: a result of `generate`, the path of a bag, or trials.
            config: the parameters.
            ego: id of the vehicle that the ego replaces, for a result or a bag.

        Raises:
            InputError: the bag cannot be read or has no scenario.
        """
        if isinstance(trials, GenerationResult | Path | str):
            trials = trials_in(trials, ego)
        self.trials = list(trials)
        if not self.trials:
            raise InputError("no scenario to drive: trials are empty")
        self.config = config
        self.observation_space = observation_space()
        self.action_space = Box(-1.0, 1.0, (2,), np.float32)
        self._loops: dict[int, tuple[ClosedLoop, Curve | None]] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin a drive in the scenario `options["index"]`, or else in one drawn by the seed.

        Raises:
            InputError: there is no scenario with that index.
        """
        super().reset(seed=seed)
        index = (options or {}).get("index")
        if index is None:
            index = int(self.np_random.integers(len(self.trials)))
        if not 0 <= index < len(self.trials):
            last = len(self.trials) - 1
            raise InputError(f"no scenario with index {index}; use an index from 0 to {last}")
        trial = self.trials[index]
        if index not in self._loops:
            loop = ClosedLoop(trial.scenario, trial.ego, trial.road, self.config)
            route = loop.task().route[:, :2]
            self._loops[index] = loop, Curve.through(route) if len(route) > 2 else None
        self._loop, self._route = self._loops[index]
        # Curvature [1/m] of the action 1.
        self.sharpest = min(self._loop.limits.sharpest, MAX_PLANNED_CURVATURE_PER_M)
        self._states: list[State] = [self._loop.start()]
        self._station = 0.0
        return self._observed(), {"index": index, "name": trial.name}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Drive one step.

        Args:
            action: (2,) acceleration and curvature as shares of the body's limits, limited to
                -1 to 1.

        Raises:
            InputError: a number in the action is not finite.
        """
        if not np.isfinite(action).all():
            raise InputError(
                f"action {np.asarray(action).tolist()}: both numbers must be finite, from -1 to 1"
            )
        loop = self._loop
        state = loop.step(self._states[-1], self._command(action))
        self._states.append(state)
        before = self._station
        observation = self._observed()
        reward = self._station - before
        info: dict[str, Any] = {"time": state.time}
        at_goal = loop.at_goal(state)
        failed = loop.hit(state) or self._is_off_road(state) or self._runs_red()
        if loop.lights:
            info["lights"] = {light.id: light.state.value for light in loop.observe(state).lights}
        terminated = at_goal or failed
        truncated = not terminated and state.step >= loop.last_step
        if terminated:
            reward += -100.0 if failed else 10.0
        if terminated or truncated:
            info["verdict"] = judge(loop, loop.record(self._states)).document()
        return observation, reward, terminated, truncated, info

    def _command(self, action: Array) -> Command:
        pedal, wheel = (min(max(float(value), -1.0), 1.0) for value in action)
        limits = self._loop.limits
        largest = limits.max_acceleration if pedal > 0.0 else limits.max_deceleration
        return Command(pedal * largest, wheel * self.sharpest)

    def _is_off_road(self, state: State) -> bool:
        loop = self._loop
        if loop.road is None:
            return False
        half = loop.scenario.vehicles[loop.ego].half
        pose = state.vehicles[loop.ego, :3]
        return is_off_road(loop.road, pose, half, self.config.off_road_depth)

    def _runs_red(self) -> bool:
        """Return whether the ego crosses a stop line at red in the last step."""
        if not self._loop.lights:
            return False
        loop, last = self._loop, self._states[-2:]
        half = loop.scenario.vehicles[loop.ego].half[0]
        fronts = [place(state.vehicles[loop.ego], half, 0.0) for state in last]
        return crosses_at_red(loop.lights, fronts[0], fronts[1], last[1].time)

    def _observed(self) -> Array:
        loop, route = self._loop, self._route
        state = loop.perceive(self._states[-1])
        space = self.observation_space
        values = np.zeros(space.shape[0])
        values[:2] = state.ego.speed, state.ego.curvature
        if route is not None:
            self._station = fill_route(
                route.points, route.station, self._station, state.vehicles[loop.ego], values
            )
        half = loop.world.half
        fill_others(state.vehicles, state.present, half, loop.ego, values[-7 * MAX_OTHERS_COUNT :])
        limited: Array = np.clip(values.astype(np.float32), space.low, space.high)
        return limited


@kernel(inline=True)
def _pose_on(points: Floats, stations: Floats, station: float, out: Floats) -> None:
    """Write the pose (3,) at a station [m] of a route, as `Curve.at`."""
    last = len(stations) - 1
    k = min(max(int(np.searchsorted(stations, station)) - 1, 0), last - 1)
    inside = min(max(station, stations[0]), stations[last])
    share = (inside - stations[k]) / (stations[k + 1] - stations[k])
    for column in range(3):
        out[column] = points[k, column] + share * (points[k + 1, column] - points[k, column])
    out[0] += (station - inside) * np.cos(out[2])
    out[1] += (station - inside) * np.sin(out[2])


@kernel(F2, F1, F, F1, OUT1)
def fill_route(points: Floats, stations: Floats, near: float, ego: Floats, out: Floats) -> float:
    """Write offset, angle, metres to the goal and the points of the route behind two values.

    Args:
        points: (M, 3) of the route.
        stations: (M,) their stations [m].
        near: station [m] of the ego in the last step.
        ego: (4,) x, y [m], yaw [rad], speed [m/s].
        out: (O,) as in `DriveEnv`.

    Returns:
        The station of the ego [m].
    """
    pose = np.empty(3)
    station, least = near, np.inf
    for shift in NEAR_STATIONS:
        _pose_on(points, stations, near + shift, pose)
        distance = np.hypot(pose[0] - ego[0], pose[1] - ego[1])
        if distance < least:
            station, least = near + shift, distance
    cos, sin = np.cos(ego[2]), np.sin(ego[2])
    for k, ahead in enumerate(ROUTE_STATIONS):
        _pose_on(points, stations, station + ahead, pose)
        dx, dy = pose[0] - ego[0], pose[1] - ego[1]
        if k == 0:
            out[2] = dx * np.sin(pose[2]) - dy * np.cos(pose[2])
            out[3] = (ego[2] - pose[2] + np.pi) % (2.0 * np.pi) - np.pi
            out[4] = stations[len(stations) - 1] - station
        else:
            out[3 + 2 * k] = dx * cos + dy * sin
            out[4 + 2 * k] = dy * cos - dx * sin
    return float(station)


@kernel(F2, B1, F2, I, OUT1)
def fill_others(vehicles: Floats, present: Bools, half: Floats, ego: int, out: Floats) -> None:
    """Write the nearest others, 7 values each, as in `DriveEnv`.

    Args:
        vehicles: (N, 4) x, y [m], yaw [rad], speed [m/s].
        present: (N,) whether each is observed.
        half: (N, 2) half lengths and widths [m].
        ego: index of the ego.
        out: (O,) filled with zeros.
    """
    dx = vehicles[:, 0] - vehicles[ego, 0]
    dy = vehicles[:, 1] - vehicles[ego, 1]
    distance = np.where(present, np.hypot(dx, dy), np.inf)
    distance[ego] = np.inf
    cos, sin = np.cos(vehicles[ego, 2]), np.sin(vehicles[ego, 2])
    for k in range(min(len(vehicles), len(out) // 7)):
        i = np.argmin(distance)
        if distance[i] > RANGE_M:
            return
        distance[i] = np.inf
        row = out[7 * k : 7 * k + 7]
        row[0] = 1.0
        row[1] = dx[i] * cos + dy[i] * sin
        row[2] = dy[i] * cos - dx[i] * sin
        row[3] = np.cos(vehicles[i, 2] - vehicles[ego, 2])
        row[4] = np.sin(vehicles[i, 2] - vehicles[ego, 2])
        row[5] = vehicles[i, 3]
        row[6] = 2.0 * half[i, 0]


def observation_space() -> Box:
    """Return the space of the observations, with finite bounds."""
    route = np.full(2 * len(ROUTE_STATIONS) - 2, RANGE_M)
    ego_high = (MAX_SPEED_MPS, MAX_PLANNED_CURVATURE_PER_M, RANGE_M, np.pi, 1000.0)
    ego_low = (0.0, -MAX_PLANNED_CURVATURE_PER_M, -RANGE_M, -np.pi, -RANGE_M)
    other_high = np.array((1.0, RANGE_M, RANGE_M, 1.0, 1.0, MAX_SPEED_MPS, 50.0))
    other_low = -other_high
    other_low[0] = 0.0
    high = np.concatenate([ego_high, route, np.tile(other_high, MAX_OTHERS_COUNT)])
    low = np.concatenate([ego_low, -route, np.tile(other_low, MAX_OTHERS_COUNT)])
    return Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)


if ID not in gymnasium.registry:
    gymnasium.register(ID, entry_point=f"{__name__}:{DriveEnv.__name__}")
