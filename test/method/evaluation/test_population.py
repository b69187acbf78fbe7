# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Coverage and precision of sets about drawn encounters, where the right answer is known."""

from dataclasses import dataclass, replace
import math

import numpy as np
import pytest
from support.textbook_motions import labelled

from scenario_gen import InputError
from scenario_gen.method.evaluation.encounter_features import features_of
from scenario_gen.method.evaluation.population import members_of, population_of
from scenario_gen.types import Encounter, Recombined, Scenario

KINDS = (
    "crossing, stops",
    "crossing, rolls",
    "follows",
    "stops behind a stopping leader",
    "merges",
)


@dataclass
class Made:
    """What a result is here: an encounter, and others that were made from it."""

    encounter: Encounter
    made: tuple[Encounter, ...] = ()

    def __iter__(self):
        for own in self.made:
            yield Scenario(
                own.vehicles,
                own.time,
                own.position,
                own.heading,
                own.speed,
                np.zeros_like(own.speed),
            )


@pytest.fixture(scope="module")
def encounters():
    return [labelled(kind, seed).encounter for seed in range(6) for kind in KINDS]


def results(encounters, made):
    return [
        (f"recording {k // len(KINDS)}", Made(encounter, made(k, encounter)))
        for k, encounter in enumerate(encounters)
    ]


def apart(encounter):
    """The same drives, a kilometre apart."""
    position = encounter.position.copy()
    position[0] += 1000.0
    return replace(encounter, position=position)


def test_kinds_are_those_of_the_drawn_motions():
    wanted = {
        "crossing, stops": "crossing",
        "left turn before oncoming, stops": "left_turn",
        "merges": "merging",
        "follows": "following",
    }
    for kind, name in wanted.items():
        found = [features_of(labelled(kind, seed).encounter, "", 0).kind for seed in range(5)]
        assert found.count(name) >= 4, (kind, found)


def test_an_encounter_on_two_roads_counts_once_under_any_name_of_its_recording(encounters):
    known = results(encounters, lambda _, own: (own,))
    again = [(f"copy of {name}", made) for name, made in known]
    once, twice = members_of(known), members_of([*known, *again])
    assert len(twice.recorded) == len(once.recorded) and len(twice.made) == 2 * len(once.made)
    assert twice.recordings == once.recordings


def test_copies_of_the_templates_cover_no_more_than_these_and_are_as_precise(encounters):
    (point,) = population_of(results(encounters, lambda _, own: (own, own)), (8,), draws=60).curve
    assert (
        point.generated == point.alone
        and point.precision == point.recorded
        and point.multiplier.value <= 1.0
    )


def test_what_reaches_other_recordings_covers_more_and_what_is_like_nothing_is_imprecise(
    encounters,
):
    def others(k, _):
        return tuple(encounters[(k + len(KINDS) * n) % len(encounters)] for n in (1, 2, 3))

    def slower(_, own):
        return (replace(own, speed=own.speed * 6.0),) * 3

    wide, wild = (
        population_of(results(encounters, made), (5,), draws=60).curve[0]
        for made in (others, slower)
    )
    assert (
        wide.generated.value > wide.alone.value + 0.2
        and wide.precision.value > 0.9
        and wide.multiplier.value > 1.5
    )
    assert wild.precision.value < 0.1 and wild.generated.value <= wild.alone.value + 0.1


def test_a_scenario_that_lost_the_shared_area_counts_against_precision(encounters):
    kept, lost = (
        population_of(results(encounters, made), (8,), draws=60).curve[0]
        for made in (lambda _, own: (own,), lambda _, own: (own, apart(own)))
    )
    assert lost.precision.value == pytest.approx(kept.precision.value / 2.0, abs=0.05)


def test_an_encounter_like_no_other_is_named_with_what_sets_it_apart(encounters):
    odd = replace(encounters[0], name="odd", speed=encounters[0].speed * np.array([[3.0], [1.0]]))
    found = population_of(
        [*results(encounters, lambda _, own: ()), ("odd", Made(odd))], (5,), draws=20
    )
    assert found.unreached[0].encounter == "odd" and found.unreached[0].distance > 2.0
    assert set(found.unreached[0].feature.split()) & {"speed", "acceleration", "braking"}
    assert found.needed == math.inf, "one point tells no curve"


def test_what_cannot_be_measured_is_refused_with_a_remedy(encounters):
    with pytest.raises(InputError, match="two recordings"):
        population_of([("one", Made(own)) for own in encounters])
    with pytest.raises(InputError, match=r"at most 15 templates"):
        population_of(results(encounters, lambda _, own: ()), (16,))


def test_what_is_recombined_counts_where_both_are_drawn_and_is_no_recorded_encounter(encounters):
    known = [
        (f"recording {k}", Made(replace(own, name=f"e{k}"))) for k, own in enumerate(encounters)
    ]
    kinds = [features_of(own, "", 0).kind for own in encounters]
    pairs = [(i, j) for i, a in enumerate(kinds) for j, b in enumerate(kinds) if i != j and a == b]
    # a copy of a third one stands for what is recombined of two
    more = [
        (
            "both",
            Made(
                replace(encounters[i], source=Recombined(f"e{i}", f"e{j}")),
                (encounters[(j + len(KINDS)) % len(encounters)],),
            ),
        )
        for i, j in pairs
    ]
    plain, found = (members_of(own) for own in (known, [*more, *known]))
    assert len(found.recorded) == len(plain.recorded) == len(known) and len(found.made) == len(
        pairs
    )
    for member in found.made:
        assert (
            member.template != member.other
            and found.recorded[member.template].recording == member.recording
        )
    both = [population_of(own, (3, 12), draws=60).curve for own in (known, [*more, *known])]
    gains = [
        with_more.generated.value - without.generated.value
        for without, with_more in zip(*both, strict=True)
    ]
    assert gains[0] < 0.1 < gains[1], "of 3 drawn ones hardly two are of one kind, of 12 many are"
    (without_parent,) = [
        members_of([own for own in [*more, *known] if own[1].encounter.name != "e0"])
    ]
    assert len(without_parent.made) == sum(0 not in pair for pair in pairs)


def test_the_scenarios_that_are_like_nothing_recorded_are_named(encounters):
    def two(k, own):
        return (own, replace(own, speed=own.speed * 5.0)) if k == 7 else (own,)

    known = [
        (recording, Made(replace(one.encounter, name=f"e{k}"), one.made))
        for k, (recording, one) in enumerate(results(encounters, two))
    ]
    farthest = population_of(known, (5,), draws=10).farthest
    assert (
        len(farthest) == 10
        and farthest[0].encounter == "e7"
        and farthest[0].distance > 2.0 > farthest[1].distance
    )
    assert set(farthest[0].feature.split()) & {"speed", "acceleration", "braking", "gap", "time"}


def test_curves_of_each_kind_are_of_its_own_templates(encounters):
    found = population_of(results(encounters, lambda _, own: (own,)), (2, 8), draws=30)
    assert set(found.by_kind) <= set(found.encounters) and "crossing" in found.by_kind
    assert all(
        point.templates <= found.encounters[kind] / 2
        for kind, curve in found.by_kind.items()
        for point in curve
    )
    columns, rows = found.table()
    assert len(rows) == len(found.curve) + sum(map(len, found.by_kind.values())) and all(
        len(row) == len(columns) for row in rows
    )
    alone = {kind: curve[0].alone.value for kind, curve in found.by_kind.items()}
    assert alone["crossing"] > found.curve[0].alone.value, (
        "two of a kind cover more of it than two of any kind cover of all"
    )
