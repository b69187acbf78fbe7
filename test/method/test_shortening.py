# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A recording that is too long for a road is shortened to its interaction."""

from dataclasses import dataclass, field
from pathlib import Path
import pickle

import numpy as np
import pytest

from scenario_gen import read_log
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.chain import EmptySetError, Generation
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.shortening import cut, fitting_part
from scenario_gen.numerics.rounding import ROUNDING_S
from scenario_gen.situation import interaction_windows, keeps_interaction, Situation
from scenario_gen.types import Encounter, GenerationResult, NoteKind, Request, Segmentation

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


@dataclass(frozen=True, eq=False)
class ShortRoad(Generation):
    """Gives no scenario of an encounter in which a vehicle drives farther than a limit [m]."""

    road: str = "short"
    config: PipelineConfig = PipelineConfig()
    request: Request = Request()
    seed: int = 7
    who: int | None = None
    limit: float = 0.0
    calls: list[int] = field(default_factory=list)
    is_planned: bool = False

    def plan(self, encounter: Encounter) -> tuple[None, Encounter]:
        if not self.is_planned:
            self.refuse_long(encounter)
        return None, encounter

    def draw(self, _: None, planned: Encounter, count: int) -> GenerationResult:
        self.calls.append(count)
        self.refuse_long(planned)
        return result_of(planned)

    def refuse_long(self, encounter: Encounter) -> None:
        tracks = Situation.of(encounter).tracks
        driven = [track.travelled for n, track in enumerate(tracks) if self.who in (None, n)]
        if max(driven) > self.limit:
            raise EmptySetError("too long", result_of(encounter))


@pytest.mark.parametrize("is_planned", [False, True])
def test_smallest_loss_that_fits_is_used(crossing: Encounter, is_planned: bool) -> None:
    situation = Situation.of(crossing)
    longest = max(track.travelled for track in situation.tracks)
    short_road = ShortRoad(limit=0.95 * longest, is_planned=is_planned)
    result = short_road.run(crossing, 7)
    assert short_road.calls == [7] * len(short_road.calls)
    assert len(short_road.calls) <= (7 if is_planned else 6)  # of the whole and its parts
    assert result.encounter.duration > 0.7 * crossing.duration
    assert keeps_interaction(situation, Situation.of(result.encounter))
    (note,) = result.generated.adaptations
    assert note.kind is NoteKind.SHORTENED and f"of {crossing.duration:.1f} s" in str(note)
    assert dict(note.values)["reason"] == "too long"
    copied = pickle.loads(pickle.dumps(result))
    assert list(map(str, copied.generated.adaptations)) == [str(note)]

    with pytest.raises(
        EmptySetError, match=r"too long. Shortened to its interaction .* within"
    ) as caught:
        ShortRoad(limit=1.0, is_planned=is_planned).run(crossing, 7)
    error = pickle.loads(pickle.dumps(caught.value))
    assert (type(error), error.args) == (EmptySetError, caught.value.args)
    assert error.result.encounter.duration == caught.value.result.encounter.duration


def test_braking_is_lost_last(crossing: Encounter) -> None:
    situation = Situation.of(crossing)
    windows, shorter = (
        interaction_windows(situation, whole_braking=kept) for kept in (True, False)
    )
    (who,) = {edge.who for edge in situation.reactions.edges}
    assert (shorter[who, 0] > windows[who, 0] + 0.5) and (shorter >= windows).all(axis=0)[0]
    limit = 1.01 * Situation.of(cut(crossing, shorter)).tracks[who].travelled
    part, made, note = fitting_part(
        ShortRoad(who=who, limit=limit).plan, crossing, RefusedError("too long")
    )
    assert made == (None, part)
    assert f"lost: the beginning of the braking of vehicle {crossing.ids[who]}" in str(note)
    assert keeps_interaction(situation, Situation.of(part), whole_braking=False)


def test_part_reaches_as_far_as_lanes(crossing: Encounter) -> None:
    situation = Situation.of(crossing)
    whole = crossing.time[crossing.present]
    needed, shorter = (
        interaction_windows(situation, whole_braking=kept) for kept in (True, False)
    )
    assert ((whole - needed) * (1.0, -1.0)).max() < 0.0 < np.abs(shorter - needed).max()

    def proposed(*windows: np.ndarray) -> tuple[np.ndarray, str]:
        part, _, note = fitting_part(
            lambda part: part, crossing, RefusedError("x"), windows=windows
        )
        offset = (part.start_ns - crossing.start_ns) * 1e-9
        return part.time[part.present] + offset, str(note)

    between, too_short = (whole + needed) / 2.0, (needed + needed.mean()) / 2.0
    kept, note = proposed(too_short, between)
    assert np.abs(kept - between).max() <= crossing.dt and "braking" not in note
    kept, note = proposed(shorter)
    assert np.abs(kept - shorter).max() <= crossing.dt and "lost: the beginning" in note


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


def test_recorded_platoon_fits_a_straight(data: Path) -> None:
    (log,) = (data / "trajectories" / "openacc_zalazone").glob("encounter_3plus*")
    (platoon,) = read_log(log).encounters
    generation = Generation("straight", PipelineConfig(), Request(), 7)
    with pytest.raises(RefusedError, match="nowhere this encounter fits unchanged") as caught:
        generation.plan(platoon)
    part, _, note = fitting_part(generation.plan, platoon, caught.value)
    assert part.ids == platoon.ids and note.kind is NoteKind.SHORTENED
