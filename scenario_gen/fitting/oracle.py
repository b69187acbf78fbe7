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

"""The template's own motion replayed on the road: the oracle row of the evaluation."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np

from scenario_gen.arrays import Floats, Ints
from scenario_gen.encounter import Encounter
from scenario_gen.fitting.result import Fit, FittedVehicle
from scenario_gen.roads.curve import Curve
from scenario_gen.roads.tracks import clean_tracks
from scenario_gen.scenario import Scenario


class RouteLike(Protocol):
    """What is needed of a planned route (planning comes after fitting, so it is not imported here)."""

    @property
    def points(self) -> Floats:
        """(M, 3) poses."""

    @property
    def anchor(self) -> Ints:
        """(K + 2,) index of each anchor."""

    @property
    def length(self) -> Floats:
        """(M,) arc length [m]."""


_SHORT = 0.05  # metres of the template's path that carry no ratio of lengths


def fitted_template(encounter: Encounter, fit: Fit, routes: Sequence[RouteLike]) -> Scenario:
    """Drive the routes as the template drove its paths, on the template's clock.

    Between two anchors every vehicle has covered the same share of its way as in the template; speeds are the template's
    times the ratio of the two lengths.

    Args:
        encounter: the template.
        fit: where its anchors are.
        routes: one per vehicle, through the anchors.

    Returns:
        A scenario of T instants; it is a reference, no one has checked it.
    """
    motions = [
        _replayed(track.progress, encounter.speed[i], fit.anchor_index, fit.fitted[i], routes[i])
        for i, track in enumerate(clean_tracks(encounter))
    ]
    speed = np.stack([speed for _, speed in motions])
    poses = np.stack([poses for poses, _ in motions])
    return Scenario(
        vehicles=fit.vehicles,
        time=encounter.time,
        position=poses[..., :2],
        heading=poses[..., 2],
        speed=speed,
        acceleration=np.gradient(speed, encounter.dt, axis=1),
    )


def _replayed(progress: Floats, speed: Floats, index: Ints, fitted: FittedVehicle, route: RouteLike) -> tuple[Floats, Floats]:
    """(T, 3) poses and (T,) speeds of one vehicle."""
    along, ratio = np.zeros(len(progress)), np.zeros(len(progress))
    for k, (a, b) in enumerate(pairwise(index)):
        here = slice(a, b + 1)
        start, end = route.length[route.anchor[k]], route.length[route.anchor[k + 1]]
        driven = progress[b] - progress[a]
        if fitted.stands[k] or driven < _SHORT:
            along[here] = np.linspace(start, end, b + 1 - a)
            continue
        ratio[here] = (end - start) / driven
        along[here] = start + (progress[here] - progress[a]) * ratio[a]
    if len(route.points) == 1:
        return np.repeat(route.points, len(progress), axis=0), np.zeros(len(progress))
    return Curve(route.points).at(along * _rate(route)), speed * ratio


def _rate(route: RouteLike) -> float:
    """Length of the polyline per metre of the route's own arc length: one, but for rounding."""
    return Curve(route.points).length / float(route.length[-1])
