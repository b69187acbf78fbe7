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
from typing import Any, ClassVar

import gymnasium
from gymnasium.spaces import Box
import numpy as np
import numpy.typing as npt

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.ego import Command, EgoState
from scenario_gen.closed_loop.lights import crosses_at_red
from scenario_gen.closed_loop.off_road import is_off_road
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.picture import picture
from scenario_gen.closed_loop.planners import RouteFollower
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.closed_loop.trials import trials_in
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.numerics import ahead_and_left, angle_between, Floats, place, unit
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

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        trials: GenerationResult | Sequence[Trial] | Path | str,
        config: ClosedLoopConfig = ClosedLoopConfig(),
        ego: str = "",
        render_mode: str | None = None,
    ) -> None:
        """Prepare an environment.

        Args:
            trials: a result of `generate`, the path of a bag, or trials.
            config: the parameters.
            ego: id of the vehicle that the ego replaces, for a result or a bag.
            render_mode: "rgb_array" or None.

        Raises:
            InputError: the bag cannot be read or has no scenario, or the render mode is unknown.
        """
        modes = self.metadata["render_modes"]
        if render_mode not in (None, *modes):
            raise InputError(
                f"render_mode {render_mode!r} is unknown; use {', '.join(modes)} or None"
            )
        self.render_mode = render_mode
        if isinstance(trials, GenerationResult | Path | str):
            trials = trials_in(trials, ego)
        self.trials = list(trials)
        if not self.trials:
            raise InputError("no scenario to drive: trials are empty")
        self.config = config
        self.observation_space = observation_space()
        self.action_space = Box(-1.0, 1.0, (2,), np.float32)
        self._loops: dict[int, ClosedLoop] = {}

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
            self._loops[index] = ClosedLoop(trial.scenario, trial.ego, trial.road, self.config)
        self._loop = self._loops[index]
        # Curvature [1/m] of the action 1.
        self.sharpest = min(self._loop.limits.sharpest, MAX_PLANNED_CURVATURE_PER_M)
        self._follower = RouteFollower()
        self._follower.reset(self._loop.task())
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
        loop, last = self._loop, self._states[-2:]
        half = loop.scenario.vehicles[loop.ego].half[0]
        fronts = [place(state.vehicles[loop.ego], half, 0.0) for state in last]
        return crosses_at_red(loop.lights, fronts[0], fronts[1], last[1].time)

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Return a top view (400, 400, 3) of 100 m x 100 m; None without a render mode."""
        if self.render_mode is None:
            return None
        return picture(self._loop, self._states[-1])

    def _observed(self) -> Array:
        state = self._states[-1]
        values = np.concatenate([*self._route_values(state), self._other_values(state)])
        space = self.observation_space
        limited: Array = np.clip(values.astype(np.float32), space.low, space.high)
        return limited

    def _route_values(self, state: State) -> tuple[Floats, Floats]:
        """Return (5,) the values of the ego, and (2 R,) the points of the route."""
        ego = state.ego
        self._station = self._follower.locate(ego)
        route = self._follower.route
        if route is None:
            values = np.array((ego.speed, ego.curvature, 0.0, 0.0, 0.0))
            return values, np.zeros(2 * len(ROUTE_STATIONS) - 2)
        poses = route.at(self._station + ROUTE_STATIONS)
        x, y, yaw = poses[0].tolist()
        _, offset = ahead_and_left(np.array(ego[:2]) - (x, y), yaw)
        angle = angle_between(ego.yaw, yaw)
        remaining = route.length - self._station
        values = np.array((ego.speed, ego.curvature, offset, angle, remaining))
        return values, _local(poses[1:, :2], ego).ravel()

    def _other_values(self, state: State) -> Floats:
        """Return (7 O,) the values of the nearest others."""
        observation = self._loop.observe(state)
        position = _local(observation.others[:, :2], state.ego)
        distance = np.hypot(position[:, 0], position[:, 1])
        order = np.argsort(distance, kind="stable")[:MAX_OTHERS_COUNT]
        nearest = order[distance[order] <= RANGE_M]
        padded = np.zeros((MAX_OTHERS_COUNT, 7))
        rows, others = padded[: len(nearest)], observation.others[nearest]
        rows[:, 0] = 1.0
        rows[:, 1:3] = position[nearest]
        rows[:, 3:5] = unit(others[:, 2] - state.ego.yaw)
        rows[:, 5] = others[:, 3]
        rows[:, 6] = observation.sizes[nearest, 0]
        return padded.ravel()


def _local(positions: Floats, ego: EgoState) -> Floats:
    """Return positions (N, 2) in the ego's frame."""
    return np.array(ahead_and_left(positions - ego[:2], ego.yaw)).T


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
