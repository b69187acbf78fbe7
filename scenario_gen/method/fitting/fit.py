# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One door to the fitting: which way of placing a template is tried on which road."""

from functools import lru_cache

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.finish import finish
from scenario_gen.method.fitting.given import place_given, place_in_own_frame, share_at_home
from scenario_gen.method.fitting.kept import refuse_lost
from scenario_gen.method.fitting.lanes import place_on_lanes
from scenario_gen.method.fitting.placement import Placement
from scenario_gen.method.fitting.requested import refuse_impossible, refuse_misfits
from scenario_gen.method.fitting.search import place_by_search
from scenario_gen.numerics import Floats
from scenario_gen.situation import refuse_reversing, Situation
from scenario_gen.types import Encounter, Fit, Request, Road, Segmentation, TypeLimits

_AT_HOME = 0.98  # share of footprints with room at which any road is taken for the template's own
_NEAR_HOME = 0.5  # the same for a map without lanes to go by: recorded cars leave recorded maps here and there


def fit_template(
    encounter: Encounter | Situation,
    segmentation: Segmentation,
    road: Road,
    config: FittingConfig = FittingConfig(),
    *,
    starts: Floats | None = None,
    goals: Floats | None = None,
    request: Request = Request(),
    limits: TypeLimits = TypeLimits(),
) -> Fit:
    """Place a template on a road (paper III-A, eqs 7-9 put right).

    Args:
        encounter: the template, or its situation, if that is known.
        segmentation: its changepoints; they decide which anchors are reported, never where start and end are.
        road: the target.
        config: which way, and how far things may be scaled and moved.
        starts: (N, 3) or (N, 4) given start poses x [m], y [m], yaw [rad], and speeds [m/s] of all vehicles; with `goals`.
        goals: likewise the end.
        request: the start and end states that are requested, of some vehicles; the others are the road's own placement.
        limits: of motion; no requested state may exceed a speed that is planned.

    Raises:
        LostEncounterError: the best place on the road loses something of the encounter that `config.allow` does not name.
        RefusedError: it does not fit, or a requested state cannot be had; the message says why, with figures.
        InputError: `starts` and `goals` disagree with the encounter, or a vehicle that is named does not exist.
    """
    situation = Situation.of(encounter)
    encounter = situation.encounter
    refuse_reversing(encounter)
    request.ego_of(encounter)  # no such vehicle: refused before anything is placed
    if request.moves:
        return _fit_request(situation, segmentation, road, config, request, limits)
    if starts is not None or goals is not None:
        placement, given = place_given(situation, road, config, starts, goals)
        return finish(situation, segmentation, road, placement, config, given)
    placement = _place(situation, road.cleared, config)
    fit = finish(situation, segmentation, road, placement, config)
    if not placement.at_home:
        refuse_lost(fit.losses, config.allow, road.name)
    return fit


def _fit_request(
    situation: Situation,
    segmentation: Segmentation,
    road: Road,
    config: FittingConfig,
    request: Request,
    limits: TypeLimits,
) -> Fit:
    encounter = situation.encounter
    starts, goals = (request.rows(end, encounter) for end in ("starts", "goals"))
    refuse_impossible(encounter, road, starts, goals, limits)
    base = (
        _place(situation, road.cleared, config)
        if np.isnan(starts).any() or np.isnan(goals).any()
        else None
    )
    placement, given = place_given(situation, road, config, starts, goals, base)
    fit = finish(situation, segmentation, road, placement, config, given)
    refuse_misfits(fit, starts, goals)
    refuse_lost(
        (loss for loss in fit.losses if loss.kind == "conflict"), config.allow, road.name
    )  # lanes are as requested
    return fit


@lru_cache(maxsize=1)  # changepoints have no part in it: the references have the same
def _place(situation: Situation, road: Road, config: FittingConfig) -> Placement:
    tracks = situation.tracks
    if config.placement == "search":
        return place_by_search(tracks, road, config)
    if config.placement == "lanes" or (config.placement == "auto" and road.map_lanes is not None):
        return place_on_lanes(tracks, road, config)
    share = share_at_home(tracks, road)
    reason, own = "", None
    try:
        own = place_in_own_frame(situation, road, config)
    except RefusedError as error:
        reason = f"where it was recorded, {error}"
        if config.placement == "identity":
            raise
    if own is not None and (
        config.placement == "identity" or share >= (_NEAR_HOME if road.lanes is None else _AT_HOME)
    ):
        return own
    try:
        return (
            place_by_search(tracks, road, config)
            if road.lanes is None
            else place_on_lanes(tracks, road, config)
        )
    except RefusedError as error:
        if share < _NEAR_HOME or not reason:
            raise
        raise RefusedError(f"{reason}; elsewhere on road {road.name}, {error}") from error
