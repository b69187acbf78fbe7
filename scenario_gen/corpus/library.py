# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`library`: one library of primitives for all encounters in a corpus, from pairs of vehicles.

A primitive of N vehicles has 3 N features, so their combinations multiply: libraries per number of
vehicles share nothing, and most numbers are rare. So the pairs that interact count. The first
vehicle of a pair is the one that is first where the two come closest in space and time; who yields
is always the second.

The library is fitted to a sample; then all pairs are assigned to its primitives.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import combinations, pairwise
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats.contingency import crosstab

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import Kind, replaced_folder, sha256_of, write_text
from scenario_gen.base.folders.scratch import sweep_tree
from scenario_gen.base.provenance import parameter_texts
from scenario_gen.base.stores import each_fetched, fetched, Place
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import encounter_of, tables_of
from scenario_gen.corpus.page import sketch, write_page
from scenario_gen.corpus.tables import rows_of, write_table
from scenario_gen.corpus.tasks import agree, arriving, spread, undone, Workers
from scenario_gen.logs import space_time_gap
from scenario_gen.method.segmentation import (
    assign,
    Assignment,
    build_library,
    CONVERGED_R_HAT_RATIO,
    DEFAULT,
    PrimitiveLibrary,
    SegmentationConfig,
)
from scenario_gen.numerics import Ints
from scenario_gen.situation import Situation
from scenario_gen.types import Encounter, FOLLOW, YIELD

LIBRARY = Kind("primitive library")
NAME, SEGMENTS, PAGE, SUMMARY, REQUEST = (
    "library.json",
    "segments",
    "library.html",
    "summary.json",
    "request.json",
)
MIN_PAIR_S = 2.0  # in which both vehicles of a pair are present
LEGEND = (
    "Lines are paths, dots their starts; the thick part is the primitive,"
    " vehicle 0 is the first of a pair (blue)."
)
EXAMPLES_COUNT = 2  # of a primitive on the page
VERBS = {FOLLOW: "follows", YIELD: "yields"}
SHARED = replace(DEFAULT, sampler=replace(DEFAULT.sampler, weight=0.1))
"""Accelerations are means over 1 s, so ten samples of 0.1 s contain as much as one. With a
weight of 0.5, at which the changepoints of one encounter are best, the number of states grows with
the recorded time: 118 states for 181 recorded pairs, and two seeds differ."""


@dataclass(frozen=True)
class AssignTask:
    """A table of encounters to assign to a library, and the table of segments to write."""

    name: str
    library: Place
    table: Place
    target: Place
    config: SegmentationConfig


@dataclass(frozen=True)
class LibrarySummary:
    """The result of fitting and assigning a corpus.

    Attributes:
        primitives: number of primitives.
        fitted: pairs in the fit.
        assigned: all pairs.
        segments: segments of all pairs.
        r_hat: largest split R̂.
        agreement: of the assignment with the fit (adjusted Rand).
        seeds: agreement of two seeds (adjusted Rand).
        limit: largest number of primitives; 0: none.
        failed: a sentence for each task that failed.
    """

    primitives: int
    fitted: int
    assigned: int
    segments: int
    r_hat: float
    agreement: float
    seeds: float
    limit: int
    failed: tuple[str, ...]

    def lines(self) -> list[str]:
        """Return the summary for people."""
        lines = [
            f"{self.primitives} primitives, fitted to {self.fitted} pairs;"
            f" {self.segments} segments in all {self.assigned} pairs",
            f"convergence: split R̂ at most {self.r_hat:.3f};"
            f" two seeds agree to {self.seeds:.2f} (adjusted Rand)",
            f"pairs assigned agree with the fit to {self.agreement:.2f} (adjusted Rand)",
        ]
        if self.r_hat > CONVERGED_R_HAT_RATIO:
            lines.append(
                "R̂ is above 1.1: the chains have not mixed; rely on primitives that both seeds"
                " find, or raise sampler.sweeps"
            )
        if 0 < self.limit <= self.primitives:
            lines.append(f"all {self.limit} states are in use: raise sampler.states")
        return [*lines, *self.failed]


def pair_encounters(encounter: Encounter, interaction: float) -> Iterator[Encounter]:
    """Yield the pairs of an encounter that interact, while both vehicles are present.

    The vehicle that is first where the two come closest is the first of a pair.

    Args:
        encounter: of N vehicles.
        interaction: space-time gap [m] up to which two vehicles interact.
    """
    for i, j in combinations(range(len(encounter.vehicles)), 2):
        rows = encounter.present_slice(i, j)
        if (rows.stop - rows.start - 1) * encounter.dt < MIN_PAIR_S:
            continue
        gap, when_i, when_j = space_time_gap(
            encounter.position[i, rows], encounter.position[j, rows], encounter.dt
        )
        if gap > interaction and len(encounter.vehicles) > 2:
            continue
        is_faster = encounter.speed[j, rows].mean() > encounter.speed[i, rows].mean()
        order = [i, j]
        if when_j < when_i or (when_i == when_j and is_faster):
            order = [j, i]
        first, second = (encounter.vehicles[n] for n in order)
        yield Encounter.sampled(
            (first, second),
            encounter.dt,
            encounter.position[order, rows],
            encounter.heading[order, rows],
            encounter.speed[order, rows],
            f"{encounter.name} {first.id} {second.id}",
            encounter.start_ns + rows.start * encounter.dt_ns,
            encounter.origin,
        )


def build(
    corpus: Place,
    config: SegmentationConfig = SHARED,
    *,
    most: int = 1000,
    seed: int = 0,
    workers: Workers = Workers(),
) -> LibrarySummary:
    """Fit a library to the encounters of a corpus, assign all of them, and write `library/` in it.

    Args:
        corpus: written by `mine`.
        config: of the segmentation.
        most: largest number of pairs in the fit; the sample depends on the digests of their names
            alone.
        seed: of the sampler; the fit is repeated with `seed` + 1, to compare two seeds.
        workers: run the tasks.

    Raises:
        InputError: the corpus has no pairs, or its encounters have several sampling periods.
    """
    tables = tables_of(corpus)
    pairs = _pairs_in(tables)
    sample = pairs[:most]
    if not sample:
        raise InputError(f"{corpus} has no two vehicles that interact for {MIN_PAIR_S:g} s")
    library, assignments = build_library(sample, config, seed)
    labels = _labels(assignments, sample)
    other_labels = _labels(build_library(sample, config, seed + 1)[1], sample)
    request = {
        "most": most,
        "seed": seed,
        "parameters": parameter_texts(config),
        "corpus": [sha256_of(local) for _, local in each_fetched(tables)],
    }
    with _replaced(corpus / "library", request) as folder, spread(workers) as run:
        with arriving(folder / NAME) as part:
            library.save(part)
        tasks = [
            AssignTask(table.stem, folder / NAME, table, folder / SEGMENTS / table.name, config)
            for table in tables
        ]
        failed = run(assign_table, undone(tasks))
        if isinstance(folder, Path):
            sweep_tree(folder)  # files of killed workers
        segments: list[Place] = sorted((folder / SEGMENTS).glob("*.parquet"), key=str)
        rows = list(rows_of(segments))
        summary = LibrarySummary(
            primitives=len(library.means),
            fitted=len(sample),
            assigned=len(rows),
            segments=sum(len(row["primitives"]) for row in rows),
            r_hat=max(assignment.segmentation.r_hat for assignment in assignments),
            agreement=adjusted_rand(labels, _assigned_labels(rows, sample)),
            seeds=adjusted_rand(labels, other_labels),
            limit=config.sampler.states,
            failed=tuple(failed),
        )
        with arriving(folder / SUMMARY) as part:
            write_text(part, json.dumps(vars(summary), indent=1) + "\n")
        with arriving(folder / PAGE) as part:
            _write_page(part, library, rows, pairs, summary)
    return summary


def _pairs_in(tables: Sequence[Place]) -> list[Encounter]:
    """Return the pairs in the encounters of tables, ordered by the digests of their names."""
    pairs: list[Encounter] = []
    for table in tables:
        for row in rows_of([table]):
            pairs += pair_encounters(encounter_of(row, table), CorpusConfig().interaction)
    return sorted(pairs, key=lambda pair: sha256(pair.name.encode()).digest())


@contextmanager
def _replaced(folder: Place, request: Mapping[str, Any]) -> Iterator[Place]:
    """Provide the folder to write to.

    A new folder replaces an earlier library at the end; in a store, an earlier one is continued.

    Raises:
        InputError: the store has a library of another request, or the folder is no library.
    """
    if isinstance(folder, Path):
        with replaced_folder(folder, LIBRARY) as new:
            yield new
        return
    agree(folder, REQUEST, request, "library")
    yield folder


def labels_of(
    points: Sequence[int] | Ints, primitives: Sequence[int] | Ints, pair: Encounter
) -> Ints:
    """Return the primitive (T,) of each sample, from changepoints (K,) and primitives (K + 1,)."""
    edges = np.array([0, *points, len(pair.time)])
    return np.repeat(np.asarray(primitives, dtype=np.int64), np.diff(edges))


def _labels(assignments: Sequence[Assignment], pairs: Sequence[Encounter]) -> Ints:
    """(T,) primitive of each sample of all pairs, one after the other."""
    return np.concatenate([
        labels_of(assignment.segmentation.changepoints, assignment.primitives, pair)
        for assignment, pair in zip(assignments, pairs, strict=True)
    ])  # fmt: skip


def _assigned_labels(rows: Sequence[Mapping[str, Any]], pairs: Sequence[Encounter]) -> Ints:
    """(T,) primitive of each sample of some pairs, from the rows of segments."""
    by_pair = {row["pair"]: row for row in rows}
    labels = []
    for pair in pairs:
        row = by_pair[pair.name]
        labels.append(labels_of(row["changepoints"], row["primitives"], pair))
    return np.concatenate(labels)


def assign_table(task: AssignTask) -> None:
    """Write changepoints and primitives for each pair in a table of encounters."""
    with fetched([task.library]) as (path,):
        library = PrimitiveLibrary.load(path)
    rows = []
    for row in rows_of([task.table]):
        for pair in pair_encounters(encounter_of(row, task.table), CorpusConfig().interaction):
            assignment = assign(pair, library, task.config)
            reactions = Situation.of(pair).reactions
            rows.append(
                {
                    "encounter": row["name"],
                    "kind": row["kind"],
                    "pair": pair.name,
                    "seconds": pair.duration,
                    "reactions": json.dumps(reactions.document(pair.vehicles)),
                    "changepoints": assignment.segmentation.changepoints.tolist(),
                    "primitives": assignment.primitives.tolist(),
                }
            )
    columns = {
        **dict.fromkeys(("encounter", "kind", "pair", "reactions"), "string"),
        "seconds": "double",
        **dict.fromkeys(("changepoints", "primitives"), "int64[]"),
    }
    write_table(task.target, rows, columns)


def adjusted_rand(first: Ints, second: Ints) -> float:
    """Return how far two labellings (T,) agree: 1 the same, 0 as by chance.

    Source: Hubert & Arabie 1985.
    """
    table = crosstab(first, second).count

    def pair_count(counts: Ints) -> float:
        return float((counts * (counts - 1) // 2).sum())

    common = pair_count(table)
    rows, columns = pair_count(table.sum(axis=1)), pair_count(table.sum(axis=0))
    expected = rows * columns / pair_count(np.array([len(first)]))
    highest = (rows + columns) / 2.0
    return 1.0 if highest == expected else (common - expected) / (highest - expected)


class _Segment(NamedTuple):
    """A segment of a pair, of whose encounter the kind is known; begin and end are samples."""

    pair: Encounter
    kind: str
    begin: int
    end: int


def _write_page(
    path: Path,
    library: PrimitiveLibrary,
    rows: Sequence[Mapping[str, Any]],
    pairs: Sequence[Encounter],
    summary: LibrarySummary,
) -> None:
    """Write the page of primitives: how frequent, how long, what follows, and examples."""
    by_name = {pair.name: pair for pair in pairs}
    segments: dict[int, list[_Segment]] = {}
    successors: Counter[tuple[int, int]] = Counter()
    for row in rows:
        pair = by_name[row["pair"]]
        edges = pairwise([0, *row["changepoints"], len(pair.time)])
        for primitive, (begin, end) in zip(row["primitives"], edges, strict=True):
            segment = _Segment(pair, row["kind"], begin, end)
            segments.setdefault(primitive, []).append(segment)
        successors.update(pairwise(row["primitives"]))
    total = sum(_samples_in(members) for members in segments.values())
    cards = []
    for k, members in sorted(segments.items(), key=lambda item: -len(item[1])):
        following = [(n, second) for (first, second), n in successors.items() if first == k]
        examples = members[:EXAMPLES_COUNT]
        cards.append(
            {
                "title": f"primitive {k}: {library.descriptions[k]}",
                "lines": _lines_of(members, total, following),
                "pictures": [sketch(each.pair, (each.begin, each.end)) for each in examples],
            }
        )
    first, *rest = summary.lines()
    write_page(path, "Primitives of pairs of vehicles", f"{first}. {LEGEND}", cards, rest)


def _samples_in(segments: Sequence[_Segment]) -> int:
    return sum(segment.end - segment.begin for segment in segments)


def _lines_of(
    segments: Sequence[_Segment], total: int, following: Sequence[tuple[int, int]]
) -> list[str]:
    """Return the lines about a primitive.

    Args:
        segments: of the primitive.
        total: samples of all primitives.
        following: (count, successor).
    """
    dt = segments[0].pair.dt
    count, samples = len(segments), _samples_in(segments)
    kinds = Counter(segment.kind for segment in segments).most_common(4)
    reactions: Counter[str] = Counter()
    for segment in segments:
        reactions.update(_reactions_of(segment.pair))
    after = sorted(following, reverse=True)[:3]
    successors = ", ".join(f"primitive {primitive} ({n} ×)" for n, primitive in after)
    return [
        f"{count} segments, {100.0 * samples / total:.1f} % of the time,"
        f" {samples * dt / count:.1f} s each",
        "in " + ", ".join(f"{n} × {kind}" for kind, n in kinds),
        "; ".join(f"{message} in {n} of them" for message, n in reactions.most_common()),
        f"followed by {successors or 'nothing'}",
        *(
            f"{each.pair.name}, {each.begin * dt:.1f} to {each.end * dt:.1f} s"
            for each in segments[:EXAMPLES_COUNT]
        ),
    ]


def _reactions_of(pair: Encounter) -> set[str]:
    """Return the reactions in a pair, in words."""
    edges = Situation.of(pair).reactions.edges
    messages = {f"the {('first', 'second')[edge.who]} {VERBS[edge.kind]}" for edge in edges}
    return messages or {"nobody reacts"}
