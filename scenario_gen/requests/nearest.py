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

"""The nearest request that is possible: what an impossible one is answered with, each suggestion tried out before it is made.

One thing that was asked is changed at a time (a pose, a speed; all of them only if no single one helps), as little as a
bisection finds, and the clock's stretch is tried beside it. What is suggested has been through the whole chain: fitted,
planned, sampled and checked.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import wrap_angle
from scenario_gen.errors import RefusedError, ScenarioGenError
from scenario_gen.fitting.routes import draw_route
from scenario_gen.requests.chain import Cancelled, Chain
from scenario_gen.requests.repair import elements, moved, repaired, with_state
from scenario_gen.requests.request import ENDS, Request
from scenario_gen.roads.clearance import footprint_fits
from scenario_gen.roads.curve import Curve
from scenario_gen.sampling.ego import vehicle_index

BISECTIONS = 7
ENOUGH = 10  # valid scenarios by which a request counts as possible, if not fewer are wanted
_FAR_ENDS = (1.0, 0.75, 0.5, 0.25)  # shares of a way at which a bisection may begin
_STRETCHES = (0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)

Path = Callable[[float], Request]


@dataclass(frozen=True)
class Suggestion:
    """A request that is possible, the stretch of the clock it needs (None: the one in effect), and the change in words."""

    request: Request
    said: str
    max_stretch: float | None = None


class ImpossibleError(RefusedError):
    """What was asked cannot be had; `suggestions` can."""

    def __init__(self, reason: str, suggestions: tuple[Suggestion, ...]) -> None:
        offers = "; or ".join(one.said for one in suggestions)
        super().__init__(f"{reason}. " + (f"Nearest possible: {offers}" if offers else "No nearby request was found possible"))
        self.suggestions = suggestions


def suggestions(chain: Chain, request: Request, count: int, cancelled: Cancelled | None = None) -> tuple[Suggestion, ...]:
    """Return possible requests near one that is not; none if nothing nearby was found, or if it was cancelled."""
    search = _Search(chain, request, count, cancelled or (lambda: False))
    found = tuple(search.run())
    return () if search.cancelled() else found


class _Search:
    """Everything that the suggestions for one request need."""

    def __init__(self, chain: Chain, request: Request, count: int, cancelled: Cancelled) -> None:
        self.chain, self.asked, self.cancelled = chain, request, cancelled
        self.wanted = min(count, ENOUGH)
        try:
            fit, _ = chain.place(replace(request, starts="", goals=""))
            self.base = {"starts": fit.asked.start, "goals": fit.asked.end}
        except ScenarioGenError:
            self.base = {}

    def possible(self, request: Request, stretch: float | None = None) -> bool:
        """Whether scenarios of the request can be had within its budget."""
        if self.cancelled():
            return False
        longest = self.chain.sampling.max_stretch if stretch is None else stretch
        chain = replace(self.chain, sampling=replace(self.chain.sampling, max_stretch=longest))
        try:
            fit, routes = chain.place(request)
            return len(chain.sample(request, routes, fit.asked, count=self.wanted).scenarios) == self.wanted
        except ScenarioGenError:
            return False

    def run(self) -> Iterator[Suggestion]:
        """Yield suggestions: the plain repair alone if it suffices, else every single change that does, else all at once."""
        start = repaired(self.chain, self.asked, self.base)
        if start != self.asked and self.possible(start):
            yield Suggestion(start, self._difference(start))
            return
        found = False
        for end, name in elements(start):
            for path in self._paths(start, end, name):
                near = self._bisected(path)
                if near is not None:
                    found = True
                    yield Suggestion(near, self._difference(near))
                    break
        stretched = self._stretched(start)
        if stretched is not None:
            yield stretched
        elif not found and self.base:
            near = self._bisected(lambda share: self._all_towards_base(start, share))
            if near is not None:
                yield Suggestion(near, self._difference(near))

    # --- ways to change a request: each a function of the share of the way, 0 (as it is) to 1 ---------------------

    def _paths(self, request: Request, end: str, name: str) -> Iterator[Path]:
        """The speed towards the template's, the pose along the drawn route, the pose towards where the fitting has it."""
        n = vehicle_index(self.chain.encounter, name, end)
        state = request.states(end)[name]
        base = self.base[end][n] if self.base else None
        if len(state) == 4:
            target = 0.0 if base is None else float(base[3])
            yield lambda share: with_state(request, end, name, (*state[:3], round(state[3] + share * (target - state[3]), 2)))
        route = self._route(request, n, name)
        if route is not None:
            yield lambda share: with_state(
                request, end, name, moved(state, route.at((1.0 - share if end == "goals" else share) * route.length))
            )
        if base is not None:
            turn = float(wrap_angle(base[2:3] - state[2])[0])
            step = np.array([base[0] - state[0], base[1] - state[1], turn])
            yield lambda share: with_state(request, end, name, moved(state, np.array(state[:3]) + share * step))

    def _all_towards_base(self, request: Request, share: float) -> Request:
        """Every asked state on its way to where the fitting has it: poses, then speeds."""
        for end, name in elements(request):
            *_, pose = self._paths(request, end, name)
            request = pose(share)
            if len(request.states(end)[name]) == 4:
                speed, *_ = self._paths(request, end, name)
                request = speed(share)
        return request

    def _route(self, request: Request, n: int, name: str) -> Curve | None:
        """The route of line, arc and line from the vehicle's start to its goal, where there is one."""
        ends = []
        for end in ENDS:
            asked = request.states(end).get(name)
            if asked is None and not self.base:
                return None
            ends.append(self.base[end][n, :3] if asked is None else np.array(asked[:3]))
        vehicle, road = self.chain.encounter.vehicles[n], self.chain.road
        return draw_route(ends[0], ends[1], lambda poses: bool(footprint_fits(road, poses, vehicle.length, vehicle.width).all()))

    def _bisected(self, path: Path) -> Request | None:
        """The least change along `path` that is possible, to 1/128 of it; None if even most of it is not enough."""
        far = next((share for share in _FAR_ENDS if self.possible(path(share))), None)
        if far is None:
            return None
        near, best = 0.0, far
        for _ in range(BISECTIONS):
            middle = 0.5 * (near + best)
            near, best = (near, middle) if self.possible(path(middle)) else (middle, best)
        return path(best)

    def _stretched(self, request: Request) -> Suggestion | None:
        """The same states on a longer clock."""
        for stretch in _STRETCHES:
            if stretch > self.chain.sampling.max_stretch and self.possible(request, stretch):
                before = self.chain.encounter.duration
                said = f"sampling.max_stretch:={stretch:g} (up to {before * (1.0 + stretch):.1f} s instead of {before:.1f} s)"
                other = "" if request == self.asked else f" with {self._difference(request)}"
                return Suggestion(request, said + other, stretch)
        return None

    def _difference(self, request: Request) -> str:
        """What differs from what was asked, as parameters to be set, and by how much."""
        said = []
        for end in ENDS:
            before, after = self.asked.states(end), request.states(end)
            changes = []
            for name in (name for name in after if after[name] != before[name]):
                a, b = before[name], after[name]
                if (distance := float(exact.hypot(b[0] - a[0], b[1] - a[1]))) > 0.0:
                    changes.append(f"vehicle {name} {distance:.2f} m away")
                elif a[2] != b[2]:
                    changes.append(f"vehicle {name} turned by {b[2] - a[2]:+.2f} rad")
                if a[3:] != b[3:]:
                    changes.append(f"vehicle {name} {b[3] - a[3]:+.2f} m/s")
            if changes:
                said.append(f"{end}:='{getattr(request, end)}' ({', '.join(changes)})")
        return " and ".join(said)
