# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""nav_msgs/GetPlan as the planner serves it: a checked request in, a free path for a disc out."""

from collections import deque
import math
import threading
from typing import Any

import numpy as np

from msg_conventions.diagnostics import written
from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.errors import InputError
from scenario_gen.planning.config import PlanningConfig
from scenario_gen.planning.plan import make_planner
from scenario_gen.planning.planner import plan_patiently, Query
from scenario_gen.roads import Road

TOLD = 20  # answers that are explained


class Reasons:
    """Why the newest plans are empty: nav_msgs/GetPlan has no place for it. The request's stamp tells whose answer it is."""

    def __init__(self) -> None:
        self._newest: deque[tuple[int, str]] = deque(maxlen=TOLD)
        self._one_at_a_time = threading.Lock()

    def add(self, stamp_ns: int, reason: str) -> None:
        """Note an answer: why there is no path, or "" if there is one."""
        with self._one_at_a_time:
            self._newest.appendleft((stamp_ns, reason))

    def told(self) -> tuple[bool, str]:
        """Return whether the newest answer is a path, and a line for each, newest first: its request's stamp and the reason."""
        with self._one_at_a_time:
            newest = list(self._newest)
        lines = [f"{written(stamp)}: {reason or 'a path was found'}" for stamp, reason in newest]
        return bool(newest) and not newest[0][1], "\n".join(lines) or "no plan has been asked for"


def query_of(request: Any, frame_id: str, radius: float) -> Query:
    """Return the query of a nav_msgs/srv/GetPlan request.

    Raises:
        InputError: a pose is not finite, in another frame than the map, or the tolerance is negative.
    """
    if not (math.isfinite(request.tolerance) and request.tolerance >= 0.0):
        raise InputError(f"tolerance is {request.tolerance}; it must be at least 0 m")
    ends = []
    for name, stamped in (("start", request.start), ("goal", request.goal)):
        position = stamped.pose.position
        if stamped.header.frame_id not in ("", frame_id):
            raise InputError(f"{name} is in frame {stamped.header.frame_id!r}; the map is in {frame_id!r}")
        if not (math.isfinite(position.x) and math.isfinite(position.y)):
            raise InputError(f"{name} is not finite ({position.x}, {position.y})")
        ends.append(np.array([position.x, position.y]))
    return Query(ends[0], ends[1], radius)


def plan_poses(road: Road, query: Query, config: PlanningConfig, seed: int) -> Floats:
    """Return (M, 3) x, y, yaw along the path found; the heading is that of the piece ahead.

    Raises:
        RefusedError: the start or goal is blocked, there is no way, or the budget is spent.
    """
    path = plan_patiently(make_planner(config), road, query, config.iterations, seed).path
    ahead = np.diff(path, axis=0) if len(path) > 1 else np.zeros((1, 2))
    heading = exact.arctan2(ahead[:, 1], ahead[:, 0])
    return np.column_stack([path, np.append(heading, heading[-1])[: len(path)]])
