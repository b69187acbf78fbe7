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

"""Drawn routes on a laned road: entry line, arc, exit line."""

from collections.abc import Callable

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats, wrap_angle
from scenario_gen.curve import Curve

_RADII = (12.0, 10.5, 9.25, 8.0, 7.0, 6.25, 5.5, 5.0)  # metres, tried from the gentlest
_ARC_STEP = 0.5
_PARALLEL = np.radians(8.0)
_STEEPEST_SHIFT = 0.05  # 1/m, curvature of a change of lanes on the way
_WIDEST_SHIFT = 12.0  # metres sideways
_TIGHTEST_U_TURN = 6.0  # metres

Fits = Callable[[Floats], bool]


def draw_route(entry: Floats, leave: Floats, fits: Fits) -> Curve | None:
    """The route from an entry pose (3,) x, y [m], yaw [rad] to an exit pose, or None if `fits` allows none."""
    turn = float(wrap_angle(np.asarray(leave[2] - entry[2])))
    ahead, left = _relative(entry, leave[:2])
    if abs(turn) < _PARALLEL:
        return _accepted(_beside(entry, leave, ahead, left), fits) if ahead > 1.0 else None
    if abs(turn) > np.pi - _PARALLEL:
        return None  # a U-turn: where along the road is for the template to say, see draw_u_turn
    along_exit = left / exact.sin(turn)  # from the lines' intersection to the exit
    along_entry = ahead - along_exit * exact.cos(turn)
    for radius in _RADII:
        tangent = radius * exact.tan(abs(turn) / 2.0)
        if tangent <= min(along_entry, along_exit) - 0.5:
            route = _accepted(_arc(entry, along_entry - tangent, turn, radius, along_exit - tangent), fits)
            if route is not None:
                return route
    return None


def draw_u_turn(entry: Floats, leave: Floats, apex: float, fits: Fits) -> Curve | None:
    """The route between two poses (3,) that drives `apex` metres, makes a half circle and leaves by the lane beside it."""
    turn = float(wrap_angle(np.asarray(leave[2] - entry[2])))
    ahead, left = _relative(entry, leave[:2])
    radius = abs(left) / 2.0
    if abs(turn) < np.pi - _PARALLEL or radius < _TIGHTEST_U_TURN or apex - ahead <= 1.0 or apex <= 1.0:
        return None
    return _accepted(_arc(entry, apex, float(np.copysign(np.pi, left)), radius, apex - ahead), fits)


def _relative(pose: Floats, xy: Floats) -> tuple[float, float]:
    """How far `xy` lies ahead and to the left of a pose."""
    d = xy - pose[:2]
    cos, sin = exact.cos(pose[2]), exact.sin(pose[2])
    return float(d[0] * cos + d[1] * sin), float(d[1] * cos - d[0] * sin)


def _accepted(curve: Curve | None, fits: Fits) -> Curve | None:
    if curve is None:
        return None
    inner = curve.cut(3.0, max(curve.length - 3.0, 3.5), 0.5)  # the first and last footprint reach beyond the road's end
    return curve if fits(inner.points) else None


def _beside(entry: Floats, leave: Floats, ahead: float, left: float) -> Curve | None:
    """Straight on, or to a parallel lane by a smooth shift (x³(10 − 15x + 6x²)) in the middle."""
    if abs(left) < 0.05:
        return Curve(np.array([entry, [leave[0], leave[1], entry[2]]]))
    reach = np.sqrt(abs(left) * 5.7735 / _STEEPEST_SHIFT)  # the blend's steepest second derivative is 5.7735
    if abs(left) > _WIDEST_SHIFT or reach > ahead - 2.0:
        return None
    x = np.linspace(0.0, 1.0, int(np.ceil(reach)) + 1)
    along = np.concatenate(([0.0], (ahead - reach) / 2.0 + reach * x, [ahead]))
    aside = np.concatenate(([0.0], left * exact.power(x, 3) * (10.0 - 15.0 * x + 6.0 * np.square(x)), [left]))
    cos, sin = exact.cos(entry[2]), exact.sin(entry[2])
    return Curve.through(entry[:2] + np.column_stack((along * cos - aside * sin, along * sin + aside * cos)))


def _arc(entry: Floats, before: float, turn: float, radius: float, after: float) -> Curve:
    """Straight for `before`, an arc through `turn` [rad], straight for `after`."""
    steps = int(np.ceil(abs(turn) * radius / _ARC_STEP))
    angle = np.linspace(0.0, turn, steps + 1)
    signed = np.copysign(radius, turn)
    ahead = before + signed * exact.sin(angle)
    left = signed * (1.0 - exact.cos(angle))
    points = np.column_stack((ahead, left, angle))
    end = points[-1] + np.array([after * exact.cos(turn), after * exact.sin(turn), 0.0])
    points = np.vstack(([0.0, 0.0, 0.0], points, end))
    cos, sin = exact.cos(entry[2]), exact.sin(entry[2])
    return Curve(
        np.column_stack(
            (
                entry[0] + points[:, 0] * cos - points[:, 1] * sin,
                entry[1] + points[:, 0] * sin + points[:, 1] * cos,
                entry[2] + points[:, 2],
            )
        )
    )
