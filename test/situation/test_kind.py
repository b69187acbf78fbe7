# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The kind of an encounter: textbook motions have the kind that anybody would name."""

from hypothesis import given, strategies
import numpy as np
import pytest
from support.motions import encounter_of
from support.textbook_motions import labelled, NOTHING, REACTIONS

from scenario_gen.situation import EncounterKind, kind_of

EXPECTED = {
    **dict.fromkeys((*REACTIONS, *NOTHING), EncounterKind.FOLLOWING),
    **{name: EncounterKind.CROSSING for name in (*REACTIONS, *NOTHING) if "crossing" in name},
    **{name: EncounterKind.LEFT_TURN for name in (*REACTIONS, *NOTHING) if "left turn" in name},
    **dict.fromkeys(
        (
            "cut in",
            "merges",
            "right turn into a stream",
            "roundabout entry",
            "stands in the way",
            "U-turn",
        ),
        EncounterKind.MERGING,
    ),
    **dict.fromkeys(
        ("meets another one closely", "narrow place", "oncoming"), EncounterKind.ONCOMING
    ),
    "stop sign": EncounterKind.CROSSING,
    "beside": EncounterKind.OTHER,
}


@pytest.mark.parametrize("name", EXPECTED)
def test_textbook_motions_have_their_kind(name):
    kinds = [kind_of(labelled(name, seed).encounter, 0, 1) for seed in range(20)]
    assert kinds.count(EXPECTED[name]) >= 19


@given(
    turned=strategies.floats(-3.0, 3.0),
    case=strategies.sampled_from(
        [
            ("following", (0.0, 0.0, 0.0), (-15.0, 0.5, 0.0)),
            ("oncoming", (0.0, 0.0, 0.0), (0.0, 3.5, np.pi)),
            ("crossing", (0.0, 0.0, 0.0), (0.0, 5.0, np.pi / 2.0)),
            ("other", (0.0, 0.0, 0.0), (0.0, 3.5, 0.0)),
        ]
    ),
)
def test_kind_ignores_direction_and_order(turned, case):
    kind, *starts = case
    time = np.arange(0.0, 12.0, 0.1)
    x, y, heading = np.array(starts).T[..., None]
    station = 10.0 * (time - 6.0)
    east, north = x + station * np.cos(heading), y + station * np.sin(heading)
    cos, sin = np.cos(turned), np.sin(turned)
    place = np.stack([cos * east - sin * north, sin * east + cos * north], axis=-1)
    encounter = encounter_of(place, heading + turned)
    assert kind_of(encounter, 0, 1) == kind == kind_of(encounter, 1, 0)


@pytest.mark.parametrize(
    ("on_path", "kind"), [(13, EncounterKind.OTHER), (15, EncounterKind.FOLLOWING)]
)
def test_followers_share_seven_tenths_of_path(on_path, kind):
    """Of the 20 samples of the last quarter; afterwards the follower is beside that path."""
    x = 3.0 * np.arange(80)
    beside = np.where(np.arange(80) >= 60 + on_path, 5.0, 0.0)
    ways = np.column_stack([x + 40.0, np.zeros(80)]), np.column_stack([x, beside])
    encounter = encounter_of(np.stack(ways), dt=0.3)
    assert kind_of(encounter, 0, 1) == kind
