# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A fit that loses the template's encounter is refused, unless it is asked for by name."""

from dataclasses import replace

import numpy as np
import pytest
from support.motions import encounter_of
from support.reaction_scenes import crossing, lane_encounter

from scenario_gen.base.errors import InputError
from scenario_gen.method.fitting import fit, fit_template, FittingConfig, LostEncounterError
from scenario_gen.method.fitting.fit import find_unused
from scenario_gen.method.fitting.placement import Placement
from scenario_gen.method.segmentation import segment
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads import build_road
from scenario_gen.situation import clean_tracks, find_losses, LOSABLE
from scenario_gen.types import Vehicle
from scenario_gen.types.request import Request
from scenario_gen.types.road import Road

CROSSING = crossing(8.0)
SEGMENTATION = segment(CROSSING)
OPEN = Road("open", np.ones((1000, 1000), dtype=bool), 0.5, [-250.0, -250.0], [], [])


def apart(encounter, metres):
    """The template in its own frame, its second vehicle moved east by so much."""
    first, second = clean_tracks(encounter)
    moved = replace(second, curve=Curve(second.curve.points + np.array([metres, 0.0, 0.0])))
    return Placement((first, moved), np.ones(2), np.zeros(2), ())


@pytest.fixture
def place(monkeypatch):
    """Have the fit find a given placement, whatever the road."""
    return lambda placement: monkeypatch.setattr(fit, "_place", lambda *_: placement)


def test_lost_crossing_is_refused_or_allowed(place):
    place(apart(CROSSING, 120.0))
    with pytest.raises(
        LostEncounterError,
        match=r"vehicles 1 and 2 have crossing or merging paths .* fitting\.allow=lost_conflict",
    ):
        fit_template(CROSSING, SEGMENTATION, OPEN)
    taken = fit_template(CROSSING, SEGMENTATION, OPEN, FittingConfig(allow="lost_conflict"))
    assert [loss.kind for loss in taken.losses] == ["conflict"]


def test_asked_states_lose_crossings_if_allowed(place):
    place(apart(CROSSING, 0.0))
    ends = {
        name: apart(CROSSING, 120.0).tracks[1].curve.points[k]
        for name, k in (("starts", 0), ("goals", -1))
    }
    request = Request(
        **{name: f"2: {x:.2f} {y:.2f} {yaw:.4f}" for name, (x, y, yaw) in ends.items()}
    )
    with pytest.raises(LostEncounterError, match=r"fitting\.allow=lost_conflict"):
        fit_template(CROSSING, SEGMENTATION, OPEN, request=request)
    taken = fit_template(
        CROSSING, SEGMENTATION, OPEN, FittingConfig(allow="lost_conflict"), request=request
    )
    assert [loss.kind for loss in taken.losses] == ["conflict"]


def test_kept_situations_are_not_refused(place):
    place(apart(CROSSING, 1.0))
    assert not fit_template(CROSSING, SEGMENTATION, OPEN).losses
    place(replace(apart(CROSSING, 120.0), at_home=True))
    assert [loss.kind for loss in fit_template(CROSSING, SEGMENTATION, OPEN).losses] == [
        "conflict"
    ]


def along(*offsets, ahead=0.0, kind="car"):
    """The tracks of two of a type that go east at 10 m/s: for each its offsets [m, left] at start, middle and end."""
    x = np.arange(0.0, 150.0)
    poses = [
        np.column_stack((x + k * ahead, np.interp(x, [0.0, 50.0, 75.0, 100.0, 149.0], own)))
        for k, own in enumerate(offsets)
    ]
    position = np.stack(poses)
    vehicles = (Vehicle("1", type=kind), Vehicle("2", type=kind))
    return clean_tracks(encounter_of(position, vehicles=vehicles))


SAME, LEFT, INTO = (0.0,) * 5, (3.5,) * 5, (3.5, 3.5, 1.75, 0.0, 0.0)


@pytest.mark.parametrize(
    ("template", "road", "kind"),
    [
        (along(SAME, SAME, ahead=20.0), along(SAME, LEFT, ahead=20.0), "following"),
        (along(SAME, INTO, ahead=20.0), along(SAME, LEFT, ahead=20.0), "merge"),
        (along(SAME, INTO, ahead=20.0), along(SAME, SAME, ahead=20.0), "merge"),
        (along(SAME, INTO[::-1], ahead=20.0), along(SAME, SAME, ahead=20.0), "lane_change"),
        (along(SAME, LEFT, ahead=1.0), along(SAME, SAME, ahead=20.0), "lanes"),
    ],
)
def test_driver_in_whose_lane_is_kept(template, road, kind):
    assert not find_losses(template, template)
    kinds = [loss.kind for loss in find_losses(template, road)]
    assert [each for each in kinds if each in (*LOSABLE, "lanes")] == [kind]


def test_who_walks_is_in_no_lane():
    template, road = (along(SAME, other, ahead=20.0, kind="pedestrian") for other in (SAME, LEFT))
    assert not [loss.kind for loss in find_losses(template, road) if loss.kind in LOSABLE]


def test_vehicle_beside_another_does_not_follow():
    template = along(SAME, (1.7,) * 5, ahead=1.0)
    assert {loss.kind for loss in find_losses(template, along(SAME, LEFT, ahead=1.0))} == {
        "beside"
    }


def test_passing_side_is_kept():
    ahead, past = np.arange(0.0, 150.0), np.arange(-30.0, 270.0, 2.0)
    swerve = np.interp(past, [-10.0, 20.0, 60.0, 90.0], [0.0, 3.5, 3.5, 0.0])

    def scene(side, still):
        x = np.full(150, 40.0) if still else ahead / 2.0
        position = np.stack(
            [np.column_stack((x, np.zeros(150))), np.column_stack((past, side * swerve))]
        )
        speed = np.array([[0.0 if still else 5.0], [20.0]])
        return clean_tracks(encounter_of(position, speed=speed))

    for still, kind in ((False, "overtaking"), (True, "stand")):
        template = scene(1.0, still)
        assert not find_losses(template, template)
        assert kind in [loss.kind for loss in find_losses(template, scene(-1.0, still))]


def test_losses_are_named_and_allowed(place):
    speed = np.full(150, 10.0)
    encounter = lane_encounter(speed, speed)
    first, second = clean_tracks(encounter)
    beside = replace(second, curve=Curve(second.curve.points + np.array([0.0, 8.0, 0.0])))
    place(Placement((first, beside), np.ones(2), np.zeros(2), ()))
    with pytest.raises(
        LostEncounterError,
        match=r"drive in one lane .* fitting\.allow=lost_following accepts this",
    ):
        fit_template(encounter, segment(encounter), OPEN)
    taken = fit_template(
        encounter, segment(encounter), OPEN, FittingConfig(allow="lost_following, lost_merge")
    )
    assert [loss.kind for loss in taken.losses] == ["following"]


@pytest.mark.parametrize("driven", [1, 2, 3, 4])
def test_arms_without_vehicles_are_counted(driven):
    network = replace(build_road("four_way").lanes, drawn=True)
    used = [lane for lanes in list(network.arms.values())[:driven] for lane in lanes]
    losses = find_unused(network, used)
    assert [loss.kind for loss in losses] == ["arm"] * (driven < 4)
    assert not losses or losses[0].message.startswith(
        f"{4 - driven} of the 4 arms of road four_way "
    )


def test_only_known_losses_can_be_allowed():
    with pytest.raises(InputError, match="lost_conflict"):
        FittingConfig(allow="everything")
