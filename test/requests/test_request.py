# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The text of a request."""

import numpy as np
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.types.request import Request


def test_states_are_read_by_vehicle():
    request = Request(starts="1: 10.5 -1.75 0.0 8.0; b 2: 3,4,1.57")
    assert request.states("starts") == {"1": (10.5, -1.75, 0.0, 8.0), "b 2": (3.0, 4.0, 1.57)}
    assert request.states("goals") == {}
    assert request.moves and not Request(ego="1").moves


STATES = [
    "1",
    "1: 2 3",
    "1: 1 2 3 4 5",
    "1: a b c",
    ": 1 2 3",
    "1: nan 0 0",
    "1: 0 0 0 -1",
    "1: 0 0 0; 1: 1 1 1",
]
TARGETS = [
    "pet",
    "pet=1",
    "pet=2..1",
    "pet=..",
    "speed=1..2",
    "pet[1,]=1..2",
    "pet[1,2=1..2",
    "pet=a..2",
    "pet=1..2; pet=2..3",
]


@pytest.mark.parametrize(("name", "texts"), [("goals", STATES), ("target", TARGETS)])
def test_other_text_is_refused_and_named(name, texts):
    for text in texts:
        with pytest.raises(InputError, match=name):
            Request(**{name: text})


def test_vehicles_are_found_by_id(chain):
    rows = Request(goals="2: 1 2 3").rows("goals", chain.encounter)
    assert (
        np.isnan(rows[0]).all()
        and rows[1, :3].tolist() == [1.0, 2.0, 3.0]
        and np.isnan(rows[1, 3])
    )
    assert Request(ego="2").ego_of(chain.encounter) == 1
    assert Request().ego_of(chain.encounter) is None
    with pytest.raises(InputError, match=r"ego: no vehicle 'x'.*there are: 1, 2"):
        Request(ego="x").ego_of(chain.encounter)
    with pytest.raises(InputError, match="starts: no vehicle '3'"):
        Request(starts="3: 0 0 0").rows("starts", chain.encounter)
