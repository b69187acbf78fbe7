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

"""A request from beginning to end: what can be had, or the reason why not with the nearest that can."""

from dataclasses import dataclass

from scenario_gen.errors import RefusedError
from scenario_gen.fitting import Fit
from scenario_gen.planning import Route
from scenario_gen.requests.chain import Cancelled, Chain, Progress
from scenario_gen.requests.nearest import ImpossibleError, suggestions
from scenario_gen.requests.request import Request
from scenario_gen.sampling.sample import Found
from scenario_gen.scenario import ScenarioSet


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a request came to."""

    fit: Fit
    routes: tuple[Route, ...]
    scenarios: ScenarioSet


def run_request(
    chain: Chain,
    request: Request,
    *,
    count: int,
    progress: Progress | None = None,
    cancelled: Cancelled | None = None,
    suggest: bool = True,
    found: Found | None = None,
) -> Outcome:
    """Fit, plan, sample and check; `suggest` whether to look for the nearest possible request where this one is not.

    `found` is called with each valid scenario as it is drawn.

    Raises:
        InputError: a vehicle that is named does not exist.
        ImpossibleError: the asked states cannot be met; it says why, and what nearby can be.
        RefusedError: without asked states: the template does not fit the road, or there is no way.
    """
    request.ego_of(chain.encounter)
    try:
        fit, routes = chain.place(request)
        made = chain.sample(request, routes, fit.asked, count=count, progress=progress, cancelled=cancelled, found=found)
    except RefusedError as error:
        if not request.moves or not suggest:
            raise
        raise ImpossibleError(str(error), suggestions(chain, request, count, cancelled)) from error
    return Outcome(fit, routes, made)
