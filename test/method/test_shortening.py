# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A recording that is too long for a road is shortened to its interaction."""

from pathlib import Path
import pickle

import numpy as np
import pytest

from scenario_gen import read_log
from scenario_gen.method.chain import EmptySetError
from scenario_gen.method.shortening import cut, fit_what_matters
from scenario_gen.numerics.rounding import ROUNDING_S
from scenario_gen.situation import (
    interaction_windows,
    keeps_interaction,
    Situation,
)
from scenario_gen.types import Encounter, GenerationResult, NoteKind, Segmentation

LOG = Path(__file__).resolve().parents[2] / "examples" / "my_log.csv"


@pytest.fixture(scope="module")
def crossing() -> Encounter:
    """One vehicle lets another one pass at a crossing."""
    return read_log(LOG).encounters[0]


def result_of(encounter: Encounter) -> GenerationResult:
    """Return a result without stages."""
    labels = np.zeros(len(encounter.time), dtype=np.int64)
    segmentation = Segmentation(labels, labels[:0], labels.astype(float), ("",))
    return GenerationResult(encounter, segmentation, None, None, ())


def test_the_smallest_loss_that_fits_is_used_and_noted(crossing: Encounter) -> None:
    calls = []

    def short_road(template: Encounter, count: int) -> GenerationResult:
        calls.append(count)
        longest = max(track.travelled for track in Situation.of(template).tracks)
        if longest > limit:
            raise EmptySetError("too long", result_of(template))
        return result_of(template)

    situation = Situation.of(crossing)
    longest = max(track.travelled for track in situation.tracks)
    limit = 0.95 * longest
    result = fit_what_matters(short_road, crossing, 7)
    assert (calls[0], calls[-1]) == (7, 7) and len(calls) <= 11
    assert result.encounter.duration > 0.7 * crossing.duration
    assert keeps_interaction(situation, Situation.of(result.encounter))
    (note,) = result.generated.adaptations
    assert note.kind is NoteKind.SHORTENED and f"of {crossing.duration:.1f} s" in str(note)
    assert dict(note.values)["reason"] == "too long"
    copied = pickle.loads(pickle.dumps(result))
    assert list(map(str, copied.generated.adaptations)) == [str(note)]

    loose = fit_what_matters(short_road, crossing, 7, attempt=lambda part: part)
    assert np.array_equal(loose.encounter.position, result.encounter.position)

    limit = 1.0
    with pytest.raises(
        EmptySetError, match=r"too long. Shortened to its interaction .* within"
    ) as caught:
        fit_what_matters(short_road, crossing, 7)
    error = pickle.loads(pickle.dumps(caught.value))
    assert (type(error), error.args) == (EmptySetError, caught.value.args)
    assert error.result.encounter.duration == caught.value.result.encounter.duration


def test_the_beginning_of_a_braking_is_the_last_that_is_lost(crossing: Encounter) -> None:
    situation = Situation.of(crossing)
    windows, shorter = (
        interaction_windows(situation, whole_braking=kept) for kept in (True, False)
    )
    (who,) = {edge.who for edge in situation.reactions.edges}
    assert (shorter[who, 0] > windows[who, 0] + 0.5) and (shorter >= windows).all(axis=0)[0]
    limit = 1.01 * Situation.of(cut(crossing, shorter)).tracks[who].travelled

    def short_road(template: Encounter, _: int) -> GenerationResult:
        if Situation.of(template).tracks[who].travelled > limit:
            raise EmptySetError("too long", result_of(template))
        return result_of(template)

    result = fit_what_matters(short_road, crossing, 7)
    (note,) = result.generated.adaptations
    assert f"lost: the beginning of the braking of vehicle {crossing.ids[who]}" in str(note)
    assert keeps_interaction(situation, Situation.of(result.encounter), whole_braking=False)


def test_each_vehicle_keeps_its_events(crossing: Encounter) -> None:
    situation = Situation.of(crossing)
    windows = interaction_windows(situation)
    for conflict in situation.conflicts:
        assert windows[conflict.first, 0] <= max(conflict.entry_first - 2.0, 0.0) + ROUNDING_S
        assert (
            windows[conflict.second, 1]
            >= min(conflict.exit_second, crossing.duration) - ROUNDING_S
        )
    part = cut(crossing, windows)
    assert part.start_ns - crossing.start_ns == pytest.approx(1e9 * windows[:, 0].min(), abs=1e8)
    assert keeps_interaction(situation, Situation.of(part))
    lost = windows.copy()
    lost[:, 1] = situation.conflicts[0].entry_first - 1.0
    assert not keeps_interaction(situation, Situation.of(cut(crossing, lost)))
