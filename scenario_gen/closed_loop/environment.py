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
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.off_road import is_off_road
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.picture import picture
from scenario_gen.closed_loop.planners import RouteFollower
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.closed_loop.trials import read_trials
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import ahead_and_left, angle_between, unit
from scenario_gen.types import MAX_PLANNED_CURVATURE_PER_M

OTHERS = 8  # nearest others that are seen
AHEAD = np.array((5.0, 10.0, 15.0, 20.0, 30.0, 40.0))  # metres along the route at which it is seen
LOOKED_AT = np.array((0.0, *AHEAD))
OWN, EACH = 5, 7  # numbers about the ego, and about each other
REACH = 100.0  # metres beyond which nobody is seen
FARTHEST, LONGEST, FASTEST = (
    1000.0,
    50.0,
    100.0,
)  # bounds of what is seen: metres to the goal, metres of a length, m/s
ID = "scenario_gen/Drive-v0"

Seen = npt.NDArray[np.float32]


class DriveEnv(gymnasium.Env[Seen, Seen]):  # type: ignore[misc]
    """One scenario at a time, drawn from the seed or named by its index.

    Observation (float32, all in the ego's frame, x ahead):

    - the ego: speed [m/s], curvature [1/m], offset from the route [m, left positive], angle to it
      [rad], metres to the goal;
    - the route at 5, 10, 15, 20, 30 and 40 m ahead: x, y [m] each;
    - the 8 nearest others within 100 m: 1, x, y [m], cos and sin of the relative yaw, speed [m/s],
      length [m]; zeros where there are fewer.

    All are cut to the bounds of the space: 100 m and m/s, 1000 m to the goal, 50 m of length, the
    body's sharpest curvature.

    Action (float32, 2): -1 to 1 of acceleration (the body's braking to its acceleration), -1 to 1
    of its sharpest curvature.

    Reward: metres driven along the route; -100 for a collision or leaving the road, +10 at the
    goal. It terminates with each of those, and is truncated when the time is up; `info["verdict"]`
    then holds the verdict.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        trials: Sequence[Trial] | Path | str,
        config: ClosedLoopConfig = ClosedLoopConfig(),
        ego: str = "",
        render_mode: str | None = None,
    ) -> None:
        """Take what is driven in: trials, or the path of a bag, where `ego` names the vehicle whose place the ego takes.

        Raises:
            InputError: the bag cannot be read, there is nothing to drive in, or the render mode is
                not known.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(
                f"render_mode {render_mode!r} is not known; take {', '.join(self.metadata['render_modes'])} or None"
            )
        self.render_mode = render_mode
        self.trials = (
            read_trials(Path(trials), ego) if isinstance(trials, Path | str) else list(trials)
        )
        if not self.trials:
            raise InputError("there is no scenario to drive in")
        self.config = config
        self.observation_space = observation_space()
        self.action_space = Box(-1.0, 1.0, (2,), np.float32)
        self._loops: dict[int, ClosedLoop] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """Begin a drive: the scenario `options["index"]`, else one drawn by the seed.

        Raises:
            InputError: there is no scenario of that index.
        """
        super().reset(seed=seed)
        index = (options or {}).get("index")
        if index is None:
            index = int(self.np_random.integers(len(self.trials)))
        if not 0 <= index < len(self.trials):
            raise InputError(f"there is no scenario {index}; there are {len(self.trials)}, from 0")
        trial = self.trials[index]
        if index not in self._loops:
            self._loops[index] = ClosedLoop(trial.scenario, trial.ego, trial.road, self.config)
        self._loop = self._loops[index]
        self.sharpest = min(
            self._loop.limits.sharpest, MAX_PLANNED_CURVATURE_PER_M
        )  # 1/m, of the wheel's ends
        self._follower = RouteFollower()
        self._follower.reset(self._loop.task())
        self._states: list[State] = [self._loop.start()]
        self._station = 0.0
        return self._observed(), {"index": index, "name": trial.name}

    def step(self, action: Seen) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Drive one step.

        Args:
            action: (2,) pedal and wheel, -1 to 1 (shares of the body's limits); what is beyond is
                cut.

        Raises:
            InputError: a number of the action is not finite.
        """
        if not np.isfinite(action).all():
            raise InputError(
                f"action {np.asarray(action).tolist()}: both numbers must be finite, from -1 to 1"
            )
        pedal, wheel = (min(max(float(value), -1.0), 1.0) for value in action)
        config, loop, limits = self.config, self._loop, self._loop.limits
        acceleration = pedal * (
            limits.max_acceleration if pedal > 0.0 else limits.max_deceleration
        )
        before = self._station
        self._states.append(
            loop.step(self._states[-1], Command(acceleration, wheel * self.sharpest))
        )
        state = self._states[-1]
        seen, reward = self._observed(), self._station - before
        info: dict[str, Any] = {"time": state.time}
        at_goal = loop.at_goal(state)
        pose, half = state.vehicles[loop.ego, :3], loop.scenario.vehicles[loop.ego].half
        off_road = loop.road is not None and is_off_road(
            loop.road, pose, half, config.off_road_depth
        )
        hit = loop.hit(state)
        terminated = at_goal or off_road or hit
        truncated = not terminated and state.step >= loop.last_step
        if terminated:
            reward += 10.0 if at_goal and not (off_road or hit) else -100.0
        if terminated or truncated:
            info["verdict"] = judge(loop, loop.record(self._states)).document()
        return seen, reward, terminated, truncated, info

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Return the scene (400, 400, 3) in pixels, the ego in the middle, 100 m a side; None without render_mode "rgb_array"."""
        if self.render_mode is None:
            return None
        return picture(self._loop, self._states[-1])

    def _observed(self) -> Seen:
        state = self._states[-1]
        ego = state.ego

        def local(xy: Floats) -> Floats:
            """Positions (..., 2) in the ego's frame."""
            return np.array(ahead_and_left(xy - ego[:2], ego.yaw)).T

        ahead, offset, angle, left = np.zeros((len(AHEAD), 2)), 0.0, 0.0, 0.0
        _, self._station = self._follower.steer(ego)
        if (route := self._follower.route) is not None:
            poses = route.at(self._station + LOOKED_AT)
            pose, coming = poses[0], poses[1:]
            offset = float(ahead_and_left(ego[:2] - pose[:2], pose[2])[1])
            angle, left = angle_between(ego.yaw, pose[2]), route.length - self._station
            ahead = local(coming[:, :2])
        found = self._loop.observe(state)
        place = local(found.others[:, :2])
        away = np.hypot(place[:, 0], place[:, 1])
        nearest = [k for k in np.argsort(away, kind="stable")[:OTHERS] if away[k] <= REACH]
        others = np.zeros((OTHERS, EACH))
        facts = (
            np.ones(len(away)),
            place,
            unit(found.others[:, 2] - ego.yaw),
            found.others[:, 3],
            found.sizes[:, 0],
        )
        others[: len(nearest)] = np.column_stack(facts)[nearest]
        own = np.array((ego.speed, ego.curvature, offset, angle, left))
        seen = np.concatenate([own, ahead.ravel(), others.ravel()]).astype(np.float32)
        within: Seen = np.minimum(
            np.maximum(seen, self.observation_space.low), self.observation_space.high
        )
        return within


def observation_space() -> Box:
    """Return the space of what is seen, with finite bounds."""
    own = np.array((FASTEST, MAX_PLANNED_CURVATURE_PER_M, REACH, np.pi, FARTHEST))
    each = np.array((1.0, REACH, REACH, 1.0, 1.0, FASTEST, LONGEST))
    high = np.concatenate([own, np.full(2 * len(AHEAD), REACH), np.tile(each, OTHERS)])
    low = -high
    low[[0, 4]] = 0.0, -REACH  # the speed; beyond the goal
    low[OWN + 2 * len(AHEAD) :: EACH] = 0.0  # whether somebody is there
    return Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)


if ID not in gymnasium.registry:
    gymnasium.register(ID, entry_point=f"{__name__}:{DriveEnv.__name__}")
