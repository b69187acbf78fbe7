"""What gp_sampler publishes of a request: footprints, every scenario with its account, one to look at, and the account of all."""

from collections.abc import Iterator

from msg_conventions.diagnostics import Status, encode_diagnostics, scenario_status
from msg_conventions.names import tokens
from msg_conventions.pictures import encode_footprint, scenario_markers
from msg_conventions.scenarios import encode_scenario
from msg_conventions.topics import vehicle_topic
from scenario_gen.nodes.template import Template
from scenario_gen.scenario import ScenarioSet


def sample_messages(template: Template, result: ScenarioSet, closing: Status, node: str) -> Iterator[tuple[str, bytes]]:
    """Yield topic and CDR bytes of every message, in order; `closing` is the request's account, `node` the full name."""
    stamp, vehicles = template.encounter.start_ns, template.encounter.vehicles
    for vehicle, name in zip(vehicles, tokens(vehicle.id for vehicle in vehicles), strict=True):
        yield vehicle_topic(name, "footprint"), encode_footprint(vehicle, stamp, f"vehicle_{name}")
    for scenario in result.scenarios:
        data = encode_scenario(scenario, stamp)
        yield "scenarios", data
        status = scenario_status(scenario, data, closing.values["request"], node, sigma_seed=closing.values["seed"])
        yield "scenarios/info", encode_diagnostics([status], stamp)
    if result.scenarios:
        yield "markers", scenario_markers(result.scenarios[0], stamp)
    yield "scenarios/info", encode_diagnostics([closing], stamp)
