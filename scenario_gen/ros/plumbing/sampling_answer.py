# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One request as gp_sampler answers it: a template's messages and the caller's values in, scenarios and a summary out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from msg_conventions.ego import ego_messages, WITNESS
from msg_conventions.hashes import template_hashes
from msg_conventions.pictures import encode_footprint, scenario_markers
from msg_conventions.scenario_info import encode_info, INFO, request_summary, RequestSummary, scenario_entry
from msg_conventions.scenarios import encode_scenario, messages_of
from msg_conventions.topics import vehicle_topic
from scenario_gen.bags.recordings.provenance import parameter_texts, versions
from scenario_gen.bags.recordings.template import decode_template
from scenario_gen.base.parameters import parameter
from scenario_gen.method.evaluation import MEASURES
from scenario_gen.method.fitting import FittingConfig
from scenario_gen.method.routing import PlanningConfig
from scenario_gen.method.sampling import Callbacks, sample_scenarios, SamplingConfig
from scenario_gen.method.validity import Limits
from scenario_gen.types import BoundaryStates, EgoSlot, Encounter, GenerationResult, Request, Scenario, ScenarioSet, tokens

Answer = tuple[GenerationResult, RequestSummary]  # what a request came to; its scenarios are published by then
Send = Callable[[str, bytes], None]  # of topic and CDR bytes


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
        super().__post_init__()


class _Messages:
    """Sends a request's messages in order, each scenario as it comes, so that a set need never be in memory."""

    def __init__(
        self, encounter: Encounter, frame_id: str, request: str, node: str, about: Mapping[str, str], send: Send
    ) -> None:
        """Take the template, the road's frame, the request's id, the node's name, what every entry says, and what sends."""
        self._encounter, self._frame_id, self._request, self._node = encounter, frame_id, request, node
        self._about, self._send = about, send
        self._begun = False

    def _begin(self, ego: EgoSlot | None) -> None:
        """Send what stands before the first scenario, once."""
        if self._begun:
            return
        self._begun = True
        stamp, vehicles = self._encounter.start_ns, self._encounter.vehicles
        for vehicle, name in zip(vehicles, tokens(vehicle.id for vehicle in vehicles), strict=True):
            self._send(vehicle_topic(name, "footprint"), encode_footprint(vehicle, stamp, f"vehicle_{name}"))
        for topic, data in () if ego is None else ego_messages(ego, self._frame_id, stamp):
            self._send(topic, data)

    def scenario(self, scenario: Scenario, asked: BoundaryStates, ego: EgoSlot | None) -> None:
        """Send a scenario and its entry."""
        self._begin(ego)
        stamp = self._encounter.start_ns
        data = encode_scenario(scenario, stamp)
        if scenario.witness is not None:
            self._send(WITNESS, encode_scenario(scenario.witness, stamp))
        for message in (data,) if scenario.all_present else messages_of(data):
            self._send("scenarios", message)
        entry = scenario_entry(
            scenario, data, self._request, self._node, template=self._encounter.vehicles, asked=asked, ego=ego, about=self._about
        )
        self._send(INFO, encode_info(entry, stamp))

    def close(self, result: ScenarioSet, summary: RequestSummary) -> None:
        """Send the picture of the first scenario and the request's summary."""
        self._begin(result.ego)
        stamp = self._encounter.start_ns
        if result.scenarios:
            self._send("markers", scenario_markers(result.scenarios[0], stamp))
        self._send(INFO, encode_info(summary, stamp))


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
        cancelled: whether to stop early; what was published by then stays, and the summary says so.
        send: called with topic and CDR bytes of every message, scenarios as they are drawn.

    Raises:
        InputError: a message is damaged, or a vehicle that is named does not exist.
        RefusedError: what is asked cannot be had; the message says why, and what nearby can.
    """
    template = decode_template(messages)
    encounter, segmentation, (road, _) = template.encounter, template.segmentation, template.placed()

    def advance(done: int, _total: int, candidates: int) -> None:
        progress(done, candidates, encounter.start_ns)

    hashes = template_hashes(messages)
    out = _Messages(encounter, road.frame_id, request, node, hashes, send)
    callbacks = Callbacks(advance, cancelled, out.scenario)
    if config.moves:
        from scenario_gen.method.attempt import Attempt  # these load all stages, and few requests need them
        from scenario_gen.method.config import PipelineConfig
        from scenario_gen.method.nearest import nearest_if_impossible

        stages = PipelineConfig(fitting=config.fitting, planning=config.planning, sampling=config.sampling, limits=config.limits)
        attempt = Attempt(encounter, segmentation, road, stages, config, config.count, config.seed)
        with nearest_if_impossible(attempt, cancelled):
            made = attempt.run(callbacks)
    else:
        made = sample_scenarios(
            replace(template, seed=config.seed), config.sampling, config.limits, config,
            count=config.count, callbacks=callbacks, measures=MEASURES,
        )  # fmt: skip
    result = made.generated
    provenance = parameter_texts(config) | versions() | hashes
    stopped = cancelled() and len(result.scenarios) < result.requested
    summary = request_summary(result, request, node, config.seed, provenance, cancelled=stopped, reactions=made.reacting)
    out.close(result, summary)
    return made, summary
