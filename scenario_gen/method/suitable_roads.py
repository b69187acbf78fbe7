# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The built-in roads that take a template: one is chosen for `road="auto"`, and a refusal of a road names them."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.fitting import fit_template
from scenario_gen.method.sampling import TargetError
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import (
    drives_about_ring,
    NoPlaceError,
    road_and_template,
    ROADS,
    ROUNDABOUT,
)
from scenario_gen.situation import (
    conflict_of,
    conflicts_in,
    refuse_reversing,
    refuse_too_large,
    Situation,
)
from scenario_gen.types import (
    Encounter,
    GenerationResult,
    join_ego,
    Note,
    NoteKind,
    Road,
    Segmentation,
)

AUTO = "auto"
LOOKED_AT = 50  # scenarios of a set, whether they keep the areas that vehicles share


def takes(
    road: Road | str, encounter: Encounter, segmentation: Segmentation, config: PipelineConfig
) -> bool:
    """Whether the template fits a road, and nothing of its encounter is lost there."""
    try:
        there, template = road_and_template(road, encounter, config.road)
        fit_template(template, segmentation, there, replace(config.fitting, allow=""))
    except (RefusedError, InputError):
        return False
    return True


def suitable_roads(
    encounter: Encounter, segmentation: Segmentation, config: PipelineConfig
) -> Iterator[str]:
    """Yield the names of the built-in roads that take the template: `roundabout` first for who drives about a ring.

    The last is `corridor`, its own road.
    """
    ring = drives_about_ring(Situation.of(encounter), config.road)
    names = sorted(ROADS.built_in, key=lambda name: ring and name != ROUNDABOUT)
    return (name for name in names if takes(name, encounter, segmentation, config))


def on_first_suitable_road(
    generate: Callable[[str], GenerationResult],
    encounter: Encounter,
    config: PipelineConfig,
    seed: int,
) -> GenerationResult:
    """Return what is generated on the first built-in road that takes the template; the result says which it is.

    Raises:
        RefusedError: the encounter is too large, or nothing can be generated on any of them; a TargetError if that is why.
    """
    refuse_too_large(encounter)
    refuse_reversing(encounter)
    refusal = RefusedError(
        f"{encounter.name}: no built-in road takes this encounter; give the path of a map"
    )
    for name in suitable_roads(encounter, segment(encounter, config.segmentation, seed), config):
        try:
            return _refuse_lost(generate(name)).noted(Note.of(NoteKind.AUTO_ROAD, road=name))
        except RefusedError as error:
            kind = TargetError if isinstance(error, TargetError) else RefusedError
            refusal = kind(f"{encounter.name} on road {name}, the last that takes it: {error}")
    raise refusal


def with_suitable_roads(
    error: RefusedError, encounter: Encounter, road: Road | str, config: PipelineConfig, seed: int
) -> RefusedError:
    """Return a refusal with the names of the built-in roads that take the template, if the road is why it was refused."""
    with suppress(RefusedError):
        refuse_too_large(encounter)
        segmentation = segment(encounter, config.segmentation, seed)
        if isinstance(error, NoPlaceError) or not takes(road, encounter, segmentation, config):
            names = ", ".join(suitable_roads(encounter, segmentation, config))
            return RefusedError(f"{error}. Roads that take it: {names}" if names else str(error))
    return error


def _refuse_lost(result: GenerationResult) -> GenerationResult:
    """Return a result whose vehicles share the areas that they share in the template.

    Raises:
        RefusedError: two of them do not in one of its scenarios.
    """
    encounter = result.encounter
    for conflict in conflicts_in(encounter):
        names = tuple(encounter.vehicles[n].id for n in conflict.pair)
        for scenario in map(join_ego, islice(result, LOOKED_AT)):
            ids = [vehicle.id for vehicle in scenario.vehicles]
            a, b = sorted(map(ids.index, names))
            if conflict_of(scenario, a, b) is None:
                raise RefusedError(
                    f"vehicles {names[0]} and {names[1]} share no area there in scenario {scenario.index}"
                )
    return result
