# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The built-in roads that fit an encounter: `road="auto"` uses the first, refusals name all."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.fitting import fit_template
from scenario_gen.method.segmentation import segment
from scenario_gen.method.shortening import cut
from scenario_gen.roads import (
    CORRIDOR,
    drives_about_ring,
    NoPlaceError,
    road_and_template,
    ROADS,
    ROUNDABOUT,
)
from scenario_gen.situation import (
    conflict_of,
    interaction_windows,
    refuse_too_large,
    Situation,
)
from scenario_gen.types import (
    Encounter,
    GenerationResult,
    join_ego,
    Road,
    Segmentation,
)

AUTO = "auto"
CHECKED_SCENARIOS = 50  # scenarios in which the conflicts of the encounter are looked for


def fits_road(
    road: Road | str, situation: Situation, segmentation: Segmentation, config: PipelineConfig
) -> bool:
    """Whether an encounter fits a road without losing anything."""
    encounter = situation.encounter
    try:
        built, template = road_and_template(road, encounter, config.road)
        if template is not encounter:  # mirrored for the other side of traffic
            situation = Situation.of(template)
        fit = fit_template(situation, segmentation, built, replace(config.fitting, allow=""))
    except (RefusedError, InputError):
        return False
    return all(loss.kind != "bend" for loss in fit.losses)


def suitable_roads(
    situation: Situation, segmentation: Segmentation, config: PipelineConfig
) -> Iterator[str]:
    """Yield the names of the built-in roads that fit an encounter.

    If a vehicle drives round a ring, `roundabout` is the first one. The last one is `corridor`,
    which is drawn around the encounter.
    """
    ring = drives_about_ring(situation, config.road)
    names = sorted(ROADS.built_in, key=lambda name: ring and name != ROUNDABOUT)
    return (name for name in names if fits_road(name, situation, segmentation, config))


def with_suitable_roads(
    error: RefusedError, encounter: Encounter, road: Road | str, config: PipelineConfig, seed: int
) -> RefusedError:
    """Return a refusal with the names of suitable roads if the road is the reason.

    If the whole recording fits none but the corridor, the names for its interaction are added.
    """
    with suppress(RefusedError):
        refuse_too_large(encounter)
        situation = Situation.of(encounter)
        segmentation = segment(encounter, config.segmentation, seed)
        no_place = isinstance(error, NoPlaceError)
        if no_place or not fits_road(road, situation, segmentation, config):
            names = list(suitable_roads(situation, segmentation, config))
            advice = f". It fits these roads: {', '.join(names)}" if names else ""
            if config.fitting.shorten and not set(names) - {CORRIDOR}:
                part = cut(encounter, interaction_windows(situation))
                segmentation = segment(part, config.segmentation, seed)
                more = ", ".join(suitable_roads(Situation.of(part), segmentation, config))
                advice += f". Shortened to its interaction, it fits: {more}" if more else ""
            return RefusedError(f"{error}{advice}")
    return error


def refuse_lost_conflicts(result: GenerationResult) -> None:
    """Refuse a result in which two vehicles do not meet that meet in the recording.

    Raises:
        RefusedError: it names the vehicles and the scenario.
    """
    encounter = result.encounter
    for conflict in Situation.of(encounter).conflicts:
        names = [encounter.vehicles[n].id for n in conflict.pair]
        for scenario in map(join_ego, islice(result, CHECKED_SCENARIOS)):
            ids = scenario.ids
            if conflict_of(scenario, *map(ids.index, names)) is None:
                raise RefusedError(
                    f"vehicles {names[0]} and {names[1]} share no area there"
                    f" in scenario {scenario.index}"
                )
