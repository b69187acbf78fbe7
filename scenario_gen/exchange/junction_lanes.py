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

"""The true lanes of the built-in roads: arms, and the ways of a junction, which cover what is drivable and nothing else.

The geometry is that of roads/builtin.py: arms of straight lanes, kerbs rounded by the corner radius r. Every drivable cell lies
in lanes. Ways through a junction begin and end where the kerbs begin to bend, r beyond the crossing road's edge. A turn over the
near corner is bounded by the kerb itself on one side; on the other its innermost lane widens to the corner of the two middles, so
that no piece of the junction's mouth lies between lanes. A turn over the far corner is concentric about that corner's kerb.
"""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.exchange.lanes import Joint, LaneMap, Strip

STEP = 1.0  # metres between points of an arm
ARC_STEPS = 24  # pieces of a quarter turn
_QUARTER = np.pi / 2.0
HALF_DIAGONAL = 0.7072  # of a cell, in sides
AT_AN_ANGLE = 2  # pieces of the arc after which a cell may reach beyond it


@dataclass(frozen=True)
class Crossing:
    """Sizes of a built-in road.

    Attributes:
        arms: direction outwards [rad] and length [m] from the centre, by name.
        lanes: per direction.
        lane_width: metres.
        corner_radius: of the kerbs, metres.
        side: of traffic.
        run_out: metres by which every arm is continued beyond its end.
        resolution: of the grid, metres.
    """

    arms: dict[str, tuple[float, float]]
    lanes: int
    lane_width: float
    corner_radius: float
    side: str
    run_out: float
    resolution: float


def crossing_lanes(name: str, crossing: Crossing, centre: Floats) -> LaneMap:
    """Return the lanes of a built-in road about its centre (2,) [m]."""
    if set(crossing.arms) == {"west", "east"}:
        made = LaneMap((_straight(crossing),), (), "right", "", derived=False)
    else:
        made = _junction(crossing)
    if crossing.side == "left":  # the roads are their own mirror images
        made = replace(made, side="left", strips=tuple(_mirrored(strip) for strip in made.strips))
        names = {"west": "east", "east": "west"}
        made = replace(made, strips=tuple(replace(s, name=_renamed(s.name, names)) for s in made.strips))
        made = replace(made, joints=tuple(replace(j, turn=_OTHER.get(j.turn, j.turn)) for j in made.joints))
    strips = tuple(replace(s, reference=s.reference + np.array([*centre, 0.0])) for s in made.strips)
    return replace(made, strips=strips, origin=f"the true lanes of {name}")


_OTHER = {"left": "right", "right": "left"}


def _renamed(name: str, names: dict[str, str]) -> str:
    return " ".join(names.get(word, word) for word in name.split())


def _mirrored(strip: Strip) -> Strip:
    """Return a strip mirrored at the y axis."""
    x, y, yaw = strip.reference.T
    return Strip(strip.name, np.column_stack((-x, y, np.pi - yaw)), -strip.offset, strip.left, strip.right)


def _line(start: Floats, yaw: float, length: float) -> Floats:
    """Return poses (M, 3) along a straight line, at most STEP apart."""
    count = int(np.ceil(length / STEP - 1e-9)) + 1
    along = np.linspace(0.0, length, count)
    return np.column_stack((start[0] + along * exact.cos(yaw), start[1] + along * exact.sin(yaw), np.full(count, yaw)))


def _straight(crossing: Crossing) -> Strip:
    (_, west), (_, east) = crossing.arms["west"], crossing.arms["east"]
    reference = _line(np.array([-west - crossing.run_out, 0.0]), 0.0, west + east + 2.0 * crossing.run_out)
    widths = np.full((crossing.lanes, len(reference)), crossing.lane_width)
    return Strip("west east", reference, np.zeros(len(reference)), widths, widths)


def _junction(crossing: Crossing) -> LaneMap:
    half = crossing.lanes * crossing.lane_width
    mouth = half + crossing.corner_radius
    strips: list[Strip] = []
    index: dict[str, int] = {}
    for name, (outward, reach) in crossing.arms.items():
        far = reach + crossing.run_out
        start = far * np.array([exact.cos(outward), exact.sin(outward)])
        reference = _line(start, outward + np.pi, far - mouth)
        widths = np.full((crossing.lanes, len(reference)), crossing.lane_width)
        index[name] = len(strips)
        strips.append(Strip(name, reference, np.zeros(len(reference)), widths, widths))
    joints = []
    for start_name, (outward, _) in crossing.arms.items():
        heading = outward + np.pi
        for goal, (away, _) in crossing.arms.items():
            turn = _turn(heading, away)
            if goal == start_name:
                continue
            made = {"straight": _through, "left": _far_turn, "right": _near_turn}[turn](crossing, mouth, half)
            joints.append(Joint(len(strips), index[start_name], index[goal], turn))
            strips.append(replace(_rotated(made, heading), name=f"{start_name} {goal}"))
    return LaneMap(tuple(strips), tuple(joints), "right", "", derived=False)


def _turn(heading: float, away: float) -> str:
    """Return which way one turns who comes in with a heading and leaves along `away`."""
    sine = float(exact.sin(away - heading))
    return "straight" if abs(sine) < 0.5 else "left" if sine > 0.0 else "right"


def _rotated(strip: Strip, angle: float) -> Strip:
    """Return a strip, drawn for one who comes along +x, turned about the centre."""
    cos, sin = float(exact.cos(angle)), float(exact.sin(angle))
    x, y, yaw = strip.reference.T
    return replace(strip, reference=np.column_stack((x * cos - y * sin, x * sin + y * cos, yaw + angle)))


def _through(crossing: Crossing, mouth: float, _half: float) -> Strip:
    reference = _line(np.array([-mouth, 0.0]), 0.0, 2.0 * mouth)
    widths = np.full((crossing.lanes, len(reference)), crossing.lane_width)
    return Strip("", reference, np.zeros(len(reference)), widths, np.zeros((0, len(reference))))


def _far_turn(crossing: Crossing, mouth: float, _half: float) -> Strip:
    """The turn to the left of one who comes along +x: about the kerb's centre at (-mouth, mouth)."""
    angle = np.linspace(-_QUARTER, 0.0, ARC_STEPS + 1)
    reference = np.column_stack((-mouth + mouth * exact.cos(angle), mouth + mouth * exact.sin(angle), angle + _QUARTER))
    widths = np.full((crossing.lanes, len(angle)), crossing.lane_width)
    return Strip("", reference, np.zeros(len(angle)), widths, np.zeros((0, len(angle))))


def _near_turn(crossing: Crossing, mouth: float, half: float) -> Strip:
    """The turn to the right of one who comes along +x: about the kerb's centre at (-mouth, -mouth), at radius `mouth`.

    The line between left and right is moved out to where the two roads' middles meet, rounded by `bend`. The kerb is drawn in
    cells, whose corners reach beyond the arc where it is not along them: so does the outermost lane.
    """
    bend = 0.9 * half
    angle = np.linspace(_QUARTER, 0.0, ARC_STEPS + 1)
    reference = np.column_stack((-mouth + mouth * exact.cos(angle), -mouth + mouth * exact.sin(angle), angle - _QUARTER))
    offset = np.array([_reach(float(a), mouth, bend) for a in angle]) - mouth
    widths = np.full((crossing.lanes, len(angle)), crossing.lane_width)
    widths[0] += offset
    from_end = np.minimum(np.arange(ARC_STEPS + 1), np.arange(ARC_STEPS, -1, -1))
    widths[-1] += HALF_DIAGONAL * crossing.resolution * np.minimum(from_end / AT_AN_ANGLE, 1.0)
    return Strip("", reference, offset, widths, np.zeros((0, len(angle))))


def _reach(angle: float, mouth: float, bend: float) -> float:
    """Return how far a ray from (-mouth, -mouth) runs until it meets the axes, whose corner is rounded by radius `bend`."""
    cos, sin = float(exact.cos(angle)), float(exact.sin(angle))
    to_axis = mouth / max(cos, sin)
    x, y = -mouth + to_axis * cos, -mouth + to_axis * sin
    if min(x, y) < -bend:
        return to_axis
    about = (mouth - bend) * (cos + sin)  # |(-mouth, -mouth) + t (cos, sin) - (-bend, -bend)| = bend
    gap = 2.0 * (mouth - bend) * (mouth - bend) - bend * bend
    return float(about + np.sqrt(about * about - gap))
