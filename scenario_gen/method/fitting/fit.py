# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The fitting: how a recording is placed on a road."""

from functools import lru_cache

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.assemble_fit import assemble_fit
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.lanes import place_on_lanes
from scenario_gen.method.fitting.losses import refuse_lost
from scenario_gen.method.fitting.placement import Placement
from scenario_gen.method.fitting.search import place_by_search
from scenario_gen.method.fitting.similarity_fit import (
    place_given,
    place_in_own_frame,
    share_at_home,
)
from scenario_gen.method.fitting.state_check import refuse_impossible, refuse_misfits
from scenario_gen.numerics import Floats
from scenario_gen.situation import refuse_reversing, Situation
from scenario_gen.types import Encounter, Fit, Request, Road, Segmentation, TypeLimits

# The share of footprints with room in the recording's own frame, with which it is placed there;
# recorded cars leave recorded maps now and then.
_MIN_ROOM_AT_HOME_SHARE = 0.98
_MIN_ROOM_WITHOUT_LANES_SHARE = 0.5


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
    """Place a recording on a road (paper III-A, eqs 7-9 corrected).

    Args:
        encounter: the recording, or its situation.
        segmentation: its changepoints; they decide which anchors are reported, and never the
            start and the end.
        road: the target.
        config: how the recording is placed, and how far it may be scaled and moved.
        starts: (N, 3) or (N, 4) start poses x [m], y [m], yaw [rad], and speeds [m/s] of all
            vehicles; with `goals`.
        goals: the same for the end.
        request: the start and end states that are requested for some vehicles.
        limits: of motion; no requested state may exceed a planned speed.

    Raises:
        LostEncounterError: the best place on the road has a loss that `config.allow` does not
            name.
        RefusedError: the recording does not fit, or a requested state is impossible.
        InputError: `starts` and `goals` disagree with the encounter, or a named vehicle does not
            exist.

    Examples:
        >>> import scenario_gen as sg
        >>> (encounter,) = sg.read_log("examples/my_log.csv").encounters
        >>> road = sg.build_road("four_way", encounter)
        >>> fit = sg.fit_template(encounter, sg.segment(encounter), road)
        >>> fit.losses
        ()
    """
    situation = Situation.of(encounter)
    encounter = situation.encounter
    refuse_reversing(encounter)
    request.ego_of(encounter)  # refuses an unknown vehicle
    if request.moves:
        return _fit_request(situation, segmentation, road, config, request, limits)
    if starts is not None or goals is not None:
        placement, given = place_given(situation, road, config, starts, goals)
        return assemble_fit(situation, segmentation, road, placement, config, given)
    placement = _place(situation, road.cleared, config)
    fit = assemble_fit(situation, segmentation, road, placement, config)
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
    """Return the fit with requested states; lanes are as requested, so only conflicts count."""
    encounter = situation.encounter
    starts, goals = (request.rows(end, encounter) for end in ("starts", "goals"))
    refuse_impossible(encounter, road, starts, goals, limits)
    base = None
    if np.isnan(starts).any() or np.isnan(goals).any():
        base = _place(situation, road.cleared, config)
    placement, given = place_given(situation, road, config, starts, goals, base)
    fit = assemble_fit(situation, segmentation, road, placement, config, given)
    refuse_misfits(fit, starts, goals)
    conflicts = [loss for loss in fit.losses if loss.kind == "conflict"]
    refuse_lost(conflicts, config.allow, road.name)
    return fit


@lru_cache(maxsize=1)  # the references have the same placement with other changepoints
def _place(situation: Situation, road: Road, config: FittingConfig) -> Placement:
    tracks = situation.tracks
    if config.placement == "search":
        return place_by_search(tracks, road, config)
    if config.placement == "identity":
        return place_in_own_frame(situation, road, config)
    if config.placement == "lanes" or road.map_lanes is not None:
        return place_on_lanes(tracks, road, config)

    share = share_at_home(tracks, road)
    home_refusal = ""
    try:
        at_home = place_in_own_frame(situation, road, config)
    except RefusedError as error:
        home_refusal = str(error)
    else:
        enough = _MIN_ROOM_AT_HOME_SHARE
        if road.lanes is None:
            enough = _MIN_ROOM_WITHOUT_LANES_SHARE
        if share >= enough:
            return at_home
    try:
        if road.lanes is None:
            return place_by_search(tracks, road, config)
        return place_on_lanes(tracks, road, config)
    except RefusedError as error:
        if share < _MIN_ROOM_WITHOUT_LANES_SHARE or not home_refusal:
            raise
        raise RefusedError(
            f"where it was recorded, {home_refusal}; elsewhere on road {road.name}, {error}"
        ) from error
