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

"""One request as gp_sampler works it off: a template's messages and the caller's values in, scenarios and their account out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from msg_conventions.belonging import identity
from msg_conventions.diagnostics import request_status, Status
from scenario_gen.bags.provenance import parameter_texts, versions
from scenario_gen.bags.template import read_template, Template
from scenario_gen.fitting import FittingConfig
from scenario_gen.nodes.sample_messages import SampleMessages, Send
from scenario_gen.parameters import check, parameter
from scenario_gen.planning import PlanningConfig
from scenario_gen.requests import Chain, Request, run_request
from scenario_gen.sampling import SamplingConfig
from scenario_gen.scenario import ScenarioSet
from scenario_gen.validity import Limits


@dataclass(frozen=True)
class Config(Request):
    """The sampler's parameters; `fitting` and `planning` are used where start or end states are asked for."""

    count: int = parameter(50, "scenarios to generate", low=1, high=100_000)
    seed: int = parameter(0, "seed of the samples, and of the planner where states are asked for", low=0)
    generate_on_input: bool = parameter(True, "generate whenever the inputs are complete or change; false: on ~/generate only")
    patience: float = parameter(
        60.0,
        "wait so long for subscribers of scenarios that acknowledge none, then go on and warn; 0: for ever",
        unit="s",
        low=0.0,
    )
    pair_map: bool = parameter(True, "take only a map with the template's stamp; false: any map server's newest one")
    fitting: FittingConfig = field(default_factory=FittingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    sampling: SamplingConfig = field(default_factory=SamplingConfig)
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        check(self)
        super().__post_init__()


@dataclass(frozen=True, eq=False)
class Answer:
    """What a request came to: the template, the scenarios, which are published by then, and their account."""

    template: Template
    result: ScenarioSet
    closing: Status


def answer_request(
    messages: Mapping[str, bytes],
    config: Config,
    request: str,
    node: str,
    progress: Callable[[int, int, int], None],
    cancelled: Callable[[], bool],
    send: Send,
) -> Answer:
    """Sample, check and publish; fit and plan anew if start or end states are asked for.

    Args:
        messages: of the template, by topic.
        config: the values of this request.
        request: its id.
        node: the node's full name.
        progress: called with the scenarios and candidates so far, and the template's stamp [ns].
        cancelled: whether to stop early; what was published by then stays, and the account says so.
        send: called with topic and CDR bytes of every message, scenarios as they are drawn.

    Raises:
        InputError: a message is damaged, or a vehicle that is named does not exist.
        RefusedError: what is asked cannot be had; the message says why, and what nearby can.
    """
    template = read_template(messages)
    chain = Chain(
        template.encounter,
        template.segmentation,
        template.road,
        config.seed,
        config.fitting,
        config.planning,
        config.sampling,
        config.limits,
    )

    def advance(done: int, _total: int, candidates: int) -> None:
        progress(done, candidates, template.encounter.start_ns)

    hashes = identity(messages)
    out = SampleMessages(template.encounter, request, node, hashes, send)
    if config.moves:
        result = run_request(
            chain, config, count=config.count, progress=advance, cancelled=cancelled, found=out.scenario
        ).scenarios
    else:
        result = chain.sample(
            config, template.routes, template.asked, count=config.count, progress=advance, cancelled=cancelled, found=out.scenario
        )
    stopped = {"cancelled": "true"} if cancelled() and len(result.scenarios) < result.requested else {}
    told = parameter_texts(config) | versions() | hashes | stopped
    closing = request_status(result, request, node, config.seed, told)
    out.close(result, closing)
    return Answer(template, result, closing)
