# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lanes know their users: those of cars stand first, those of other types are chosen with them, and all travel in messages."""

import numpy as np
import pytest
from support.message_examples import lanes_again

from scenario_gen.base.errors import InputError
from scenario_gen.types import Lane, LaneNetwork, RuleKind, TrafficRule, VEHICLE_TYPES

BUS, BICYCLE = (VEHICLE_TYPES[name].lane_user for name in ("bus", "bicycle"))


def lane(name, y, after=(), users=(), crossing=False):
    line = np.array([[0.0, y], [50.0, y]])
    return Lane(name, line, line - (0.0, 3.0), after, users=frozenset(users), crossing=crossing)


def street():
    """A cycle lane, a car lane that leads into a bus lane and into another one, and a crossing."""
    lanes = [
        lane("cycle", 0.0, users=["bicycle"]), lane("in", 3.0, (2, 3)), lane("bus", 6.0, users=["bus"]),
        lane("motorway", 9.0, users=["car", "bus"]), lane("walk", 12.0, users=["pedestrian"], crossing=True),
    ]  # fmt: skip
    network = LaneNetwork("street", ()).with_lanes(lanes)
    rule = TrafficRule("s", RuleKind.STOP, (1,), (0,), np.array([[40.0, 9.0], [40.0, 6.0]]))
    return LaneNetwork("street", network.lanes, rules=(rule,), of_all=network.of_all)


def led(network):
    return {
        lane.id: sorted(network.lanes[k].id for k in lane.successors) for lane in network.lanes
    }


def test_lanes_of_cars_stand_first():
    network = street()
    assert led(network) == {"in": ["motorway"], "motorway": []}
    assert [lane.id for lane in network.others] == ["cycle", "bus", "walk"] and len(
        network.whole.lanes
    ) == 5
    assert led(network.for_users(BUS)) == {"in": ["bus", "motorway"], "motorway": [], "bus": []}
    assert network.open_to(frozenset(("car",))) is network


def test_bicycle_has_lanes_of_its_own():
    found = street().open_to(BICYCLE)
    assert led(found) == {"in": [], "cycle": []} and found.rules == ()
    assert street().open_to(BUS).rules[0].lanes == (1,)


def test_users_travel_in_messages():
    again = lanes_again(street())
    before = street()
    for one, other in zip(again.of_all, before.of_all, strict=True):
        assert (one.id, one.users, one.crossing, one.successors) == (
            other.id,
            other.users,
            other.crossing,
            other.successors,
        )
    assert led(again) == led(before) and again.moved(np.ones(2)).others[0].left[0].tolist() == [
        1.0,
        1.0,
    ]
    with pytest.raises(InputError, match="lane x: users tram; choose of bicycle, bus, car"):
        lane("x", 0.0, users=["tram"])


@pytest.mark.parametrize("name", VEHICLE_TYPES.names())
def test_every_type_uses_known_lanes(name):
    kind = VEHICLE_TYPES[name]
    (user,) = kind.lane_user
    assert kind.walks == (user == "pedestrian") and (
        name not in ("bus", "bicycle", "truck") or user == name
    )
