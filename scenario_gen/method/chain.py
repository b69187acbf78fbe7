# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From an encounter to scenarios in sequence: prepare, place, plan and draw.

What does not fit as a whole is shortened. `road="auto"` uses the first of the built-in roads that
fit an encounter, and refusals name all.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.continuation import driven_on
from scenario_gen.method.evaluation import measures_in
from scenario_gen.method.fitting import fit_template
from scenario_gen.method.routing import plan_routes
from scenario_gen.method.sampling import Callbacks, Plan, sample_scenarios, TargetError
from scenario_gen.method.segmentation import segment
from scenario_gen.method.shortening import cut, fitting_part
from scenario_gen.roads import (
    CORRIDOR,
    drives_about_ring,
    NoPlaceError,
    road_and_template,
    ROADS,
    ROUNDABOUT,
    windows_on_map,
)
from scenario_gen.situation import (
    conflict_of,
    interaction_windows,
    refuse_reversing,
    refuse_too_large,
    Situation,
    Wait,
)
from scenario_gen.types import (
    causes_in_words,
    Encounter,
    GenerationResult,
    join_ego,
    Note,
    NoteKind,
    Planned,
    Request,
    Road,
    Scenario,
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


@dataclass(frozen=True, eq=False)
class Chain:
    """A template that is prepared for a road: the input of all later stages.

    Attributes:
        situation: the template's.
        segmentation: its changepoints.
        road: the target.
        config: the parameters of every stage.
        request: what is requested.
        count: valid scenarios wanted.
        seed: of all randomness.
        waits: that scenarios keep; the template's if None.
        population: recorded encounters that show how encounters differ.
        notes: on the preparation of the template.
    """

    situation: Situation
    segmentation: Segmentation
    road: Road
    config: PipelineConfig
    request: Request = Request()
    count: int = 50
    seed: int = 0
    waits: tuple[Wait, ...] | None = None
    population: Sequence[Encounter] = ()
    notes: Sequence[Note] = ()

    @property
    def encounter(self) -> Encounter:
        """The template."""
        return self.situation.encounter

    def plan(self) -> Planned:
        """Place the template on the road and plan its routes.

        Raises:
            InputError, RefusedError: as the stages.
        """
        config, limits = self.config, self.config.limits
        fit = fit_template(
            self.situation,
            self.segmentation,
            self.road,
            config.fitting,
            request=self.request,
            limits=limits,
        )
        routes = plan_routes(self.road, fit, config.planning, self.seed, limits)
        fit = replace(fit, notes=(*self.notes, *fit.notes))
        return Planned(self.encounter, self.segmentation, self.road, fit, routes, self.seed)

    def sample(self, planned: Planned, callbacks: Callbacks = Callbacks()) -> GenerationResult:
        """Draw scenarios of a planned template.

        Raises:
            InputError, RefusedError: as `sample_scenarios`.
        """
        config = self.config
        stage = (planned, config.sampling, config.limits, self.request)
        return sample_scenarios(
            *stage,
            count=self.count,
            plan=Plan.of(*stage, self.waits, self.situation),
            callbacks=callbacks,
            measures=measures_in(config.sampling.drivers, self.encounter, self.population),
        )

    def run(self, callbacks: Callbacks = Callbacks()) -> GenerationResult:
        """Place, plan and sample.

        Raises:
            InputError, RefusedError: as the stages.
        """
        return self.sample(self.plan(), callbacks)


class EmptySetError(RefusedError):
    """No candidate is valid; `result` has the account of the candidates."""

    def __init__(self, message: str, result: GenerationResult) -> None:
        super().__init__(message)
        self.result = result


@dataclass(frozen=True, eq=False)
class Generation:
    """How scenarios of a template are made, on one road or on the first suitable one.

    Attributes:
        road: the target; `AUTO`: the first built-in road that is suitable.
        config: the parameters of every stage.
        request: what is requested.
        seed: of all randomness.
        population: recorded encounters that show how encounters differ.
        callbacks: of the sampler.
        accepts: takes the road and a valid scenario; one that it refuses is left out.
    """

    road: Road | Path | str
    config: PipelineConfig
    request: Request
    seed: int
    population: Sequence[Encounter] = ()
    callbacks: Callbacks = Callbacks()
    accepts: Callable[[Road, Scenario], bool] = lambda *_: True

    def run(self, encounter: Encounter, count: int) -> GenerationResult:
        """Return scenarios of an encounter, or of its part that fits with the smallest loss.

        Raises:
            RefusedError: as the stages, for the whole encounter; the message has the lanes that
                its shortest form needs.
            InputError, TargetError: as the stages.
        """
        refuse_too_large(encounter)
        try:
            return self.of_whole(encounter, count)
        except RefusedError as error:
            fitting = self.config.fitting
            if not fitting.shorten or self.request.moves or isinstance(error, TargetError):
                raise
            refusal = error
        attempt = partial(self.of_whole, count=count)
        windows = windows_on_map(self.road, encounter) if self.road != AUTO else ()
        _, result, note = fitting_part(attempt, encounter, refusal, fitting, windows)
        return result.noted(note)

    def of_whole(self, encounter: Encounter, count: int) -> GenerationResult:
        """Return scenarios of an encounter as it is.

        Raises:
            InputError, RefusedError: as the stages.
        """
        if self.road != AUTO:
            return self.draw(*self.plan(encounter), count)
        refuse_too_large(encounter)
        refuse_reversing(encounter)
        refusal = RefusedError(
            f"{encounter.name} does not fit any built-in road; give the path of a map"
        )
        segmentation = segment(encounter, self.config.segmentation, self.seed)
        for name in suitable_roads(Situation.of(encounter), segmentation, self.config):
            try:
                result = replace(self, road=name).of_whole(encounter, count)
                refuse_lost_conflicts(result)
            except RefusedError as error:
                kind = TargetError if isinstance(error, TargetError) else RefusedError
                refusal = kind(f"{encounter.name} on road {name}, the last one tried: {error}")
            else:
                return result.noted(Note.of(NoteKind.AUTO_ROAD, road=name))
        raise refusal

    def plan(self, encounter: Encounter) -> tuple[Chain, Planned]:
        """Prepare, place and plan an encounter on the road.

        It is driven on where a record ends in the way of another vehicle, mirrored on a map with
        the other side of traffic, and segmented.

        Raises:
            InputError, RefusedError: as the stages.
        """
        encounter, notes = driven_on(encounter)
        road, encounter = road_and_template(self.road, encounter, self.config.road)
        chain = Chain(
            Situation.of(encounter),
            segment(encounter, self.config.segmentation, self.seed),
            road,
            self.config,
            self.request,
            seed=self.seed,
            population=self.population,
            notes=notes,
        )
        return chain, chain.plan()

    def draw(self, chain: Chain, planned: Planned, count: int) -> GenerationResult:
        """Return scenarios of a planned encounter, at least one.

        Raises:
            InputError, RefusedError: as `Chain.sample`.
            EmptySetError: there is none; the message has the causes of all refusals and the notes.
        """
        callbacks = replace(self.callbacks, accepts=partial(self.accepts, planned.road))
        result = replace(chain, count=count).sample(planned, callbacks)
        if not len(result):
            generated = result.generated
            refused = causes_in_words(generated.refused)
            causes = ", ".join(f"{number} × {cause}" for cause, number in refused)
            reasons = "; ".join((causes or "none was drawn", *map(str, generated.adaptations)))
            message = f"none of {generated.candidates} candidates is valid: {reasons}"
            raise EmptySetError(message, result)
        return result
