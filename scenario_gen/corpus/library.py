# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`library`: one library of primitives for all encounters of a corpus, by pairs of vehicles.

By pairs, because a primitive of N vehicles has 3 N features and their combinations multiply: libraries per number of vehicles
share nothing, and of most numbers there are few encounters. Of an encounter those pairs count that have to do with each other.
The vehicle that is first where the two come closest in space and time is the first of the pair: who yields is always the second.

The library is fitted to a sample; then all pairs are assigned to its primitives, without fitting anything anew.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import combinations, pairwise
import json
from pathlib import Path
from typing import Any

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
SHORTEST_S = 2.0  # s that a pair must be there together
LEGEND = "Lines are paths, dots their starts; the thick part is the primitive, vehicle 0 is the first of a pair (blue)."
EXAMPLES = 2
VERBS = {FOLLOW: "follows", YIELD: "yields"}
SHARED = replace(DEFAULT, sampler=replace(DEFAULT.sampler, weight=0.1))
"""Accelerations are over a window of 1 s, so ten samples of 0.1 s say as much as one. With the weight of a half, at which one
encounter's changepoints are found best, states multiply with the hours: 118 of 181 recorded pairs, and two seeds differ."""


@dataclass(frozen=True)
class AssignTask:
    """A table of encounters to assign to a library, and the table of segments to write."""

    name: str
    library: Place
    table: Place
    target: Place
    config: SegmentationConfig


@dataclass(frozen=True)
class Built:
    """What became of a corpus: primitives, pairs fitted and assigned, agreement of the two, and of two seeds."""

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
            f"{self.primitives} primitives, fitted to {self.fitted} pairs; {self.segments} segments in all {self.assigned} pairs",
            f"convergence: split R̂ at most {self.r_hat:.3f}; two seeds agree to {self.seeds:.2f} (adjusted Rand)",
            f"pairs assigned agree with the fit to {self.agreement:.2f} (adjusted Rand)",
        ]
        if self.r_hat > CONVERGED_R_HAT_RATIO:
            lines.append(
                "R̂ is above 1.1: the chains have not mixed; rely on what two seeds agree on, or raise sampler.sweeps"
            )
        if 0 < self.limit <= self.primitives:
            lines.append(f"all {self.limit} states are in use: raise sampler.states")
        return [*lines, *self.failed]


def pair_encounters(encounter: Encounter, interaction: float) -> Iterator[Encounter]:
    """Yield the pairs of an encounter that have to do with each other, in canonical order, while both are there.

    Args:
        encounter: of N vehicles.
        interaction: space-time gap [m] up to which two have.
    """
    for i, j in combinations(range(len(encounter.vehicles)), 2):
        first = int(max(encounter.present[i, 0], encounter.present[j, 0]))
        last = int(min(encounter.present[i, 1], encounter.present[j, 1]))
        if (last - first) * encounter.dt < SHORTEST_S:
            continue
        own = slice(first, last + 1)
        gap, when_a, when_b = space_time_gap(
            encounter.position[i, own], encounter.position[j, own], encounter.dt
        )
        if gap > interaction and len(encounter.vehicles) > 2:
            continue
        faster = float(encounter.speed[j, own].mean()) > float(encounter.speed[i, own].mean())
        order = [j, i] if when_b < when_a or (when_a == when_b and faster) else [i, j]
        vehicles = tuple(encounter.vehicles[n] for n in order)
        yield Encounter.sampled(
            vehicles,
            encounter.dt,
            encounter.position[order, own],
            encounter.heading[order, own],
            encounter.speed[order, own],
            f"{encounter.name} {vehicles[0].id} {vehicles[1].id}",
            encounter.start_ns + first * encounter.dt_ns,
            encounter.origin,
        )


def build(
    corpus: Place,
    config: SegmentationConfig = SHARED,
    *,
    most: int = 1000,
    seed: int = 0,
    workers: Workers = Workers(),
) -> Built:
    """Fit a library to the encounters of a corpus, assign all of them, and write `library/` in it.

    Args:
        corpus: that `mine` wrote.
        config: of the segmentation.
        most: pairs to fit at most; a sample by the digest of their names, the same whatever else is in the corpus.
        seed: of the sampler; the fit is repeated with `seed` + 1, to say how far two seeds agree.
        workers: who does it.

    Raises:
        InputError: the corpus has no pairs, or its encounters have several sampling periods.
    """
    tables = tables_of(corpus)
    encounters = (encounter_of(row, table) for table in tables for row in rows_of([table]))
    pairs = [
        pair
        for encounter in encounters
        for pair in pair_encounters(encounter, CorpusConfig().interaction)
    ]
    pairs.sort(key=lambda pair: sha256(pair.name.encode()).digest())
    sample = pairs[:most]
    if not sample:
        raise InputError(
            f"{corpus} holds no two vehicles that have to do with each other for {SHORTEST_S:g} s"
        )
    library, assignments = build_library(sample, config, seed)
    labels = _labels(assignments, sample)
    again = _labels(build_library(sample, config, seed + 1)[1], sample)
    request = {"most": most, "seed": seed, "parameters": parameter_texts(config)}
    request["corpus"] = [sha256_of(here) for _, here in each_fetched(tables)]
    with _replaced(corpus / "library", request) as folder, spread(workers) as go:
        with arriving(folder / NAME) as part:
            library.save(part)
        tasks = [
            AssignTask(table.stem, folder / NAME, table, folder / SEGMENTS / table.name, config)
            for table in tables
        ]
        failed = go(assign_table, undone(tasks))
        if isinstance(folder, Path):
            sweep_tree(folder)  # what killed workers left
        segments: list[Place] = sorted((folder / SEGMENTS).glob("*.parquet"), key=str)
        rows = list(rows_of(segments))
        assigned = {row["pair"]: row for row in rows}
        own = [(assigned[pair.name], pair) for pair in sample]
        fresh = np.concatenate(
            [labels_of(row["changepoints"], row["primitives"], pair) for row, pair in own]
        )
        built = Built(
            primitives=len(library.means),
            fitted=len(sample),
            assigned=len(rows),
            segments=sum(len(row["primitives"]) for row in rows),
            r_hat=max(one.segmentation.r_hat for one in assignments),
            agreement=adjusted_rand(labels, fresh),
            seeds=adjusted_rand(labels, again),
            limit=config.sampler.states,
            failed=tuple(failed),
        )
        with arriving(folder / SUMMARY) as part:
            write_text(part, json.dumps(vars(built), indent=1) + "\n")
        with arriving(folder / PAGE) as part:
            _write_page(part, library, rows, {pair.name: pair for pair in pairs}, built)
    return built


@contextmanager
def _replaced(folder: Place, request: Mapping[str, Any]) -> Iterator[Place]:
    """Give the folder to write to: a new one, which replaces an earlier library at the end; in a store, one that is gone on with.

    Raises:
        InputError: the store holds a library of another request, or the folder is no library.
    """
    if isinstance(folder, Path):
        with replaced_folder(folder, LIBRARY) as own:
            yield own
        return
    agree(folder, REQUEST, request, "library")
    yield folder


def labels_of(
    points: Sequence[int] | Ints, primitives: Sequence[int] | Ints, pair: Encounter
) -> Ints:
    """(T,) primitive of each sample, from the changepoints (K,) and the primitive (K + 1,) of each segment."""
    edges = np.array([0, *points, len(pair.time)])
    return np.repeat(np.asarray(primitives, dtype=np.int64), np.diff(edges))


def _labels(assignments: Sequence[Assignment], pairs: Sequence[Encounter]) -> Ints:
    """(T,) primitive of each sample of all pairs, one after the other."""
    return np.concatenate([
        labels_of(found.segmentation.changepoints, found.primitives, pair)
        for found, pair in zip(assignments, pairs, strict=True)
    ])  # fmt: skip


def assign_table(task: AssignTask) -> None:
    """Write, for each pair of a table's encounters, its changepoints and the primitive of each segment."""
    with fetched([task.library]) as (here,):
        library = PrimitiveLibrary.load(here)
    rows = []
    for row in rows_of([task.table]):
        for pair in pair_encounters(encounter_of(row, task.table), CorpusConfig().interaction):
            found = assign(pair, library, task.config)
            rows.append({
                "encounter": row["name"], "kind": row["kind"], "pair": pair.name, "seconds": pair.duration,
                "reactions": json.dumps(Situation.of(pair).reactions.document(pair.vehicles)),
                "changepoints": found.segmentation.changepoints.tolist(), "primitives": found.primitives.tolist(),
            })  # fmt: skip
    texts, ints = dict.fromkeys(("encounter", "kind", "pair", "reactions"), "string"), "int64[]"
    write_table(
        task.target, rows, {**texts, "seconds": "double", "changepoints": ints, "primitives": ints}
    )


def adjusted_rand(one: Ints, other: Ints) -> float:
    """Return how far two labellings (T,) agree: 1 the same, 0 as by chance (Hubert & Arabie 1985)."""
    table = crosstab(one, other).count

    def choices(counts: Ints) -> float:
        return float((counts * (counts - 1) // 2).sum())

    together, rows, columns = (
        choices(table),
        choices(table.sum(axis=1)),
        choices(table.sum(axis=0)),
    )
    expected, most = rows * columns / choices(np.array([len(one)])), (rows + columns) / 2.0
    return 1.0 if most == expected else (together - expected) / (most - expected)


def _write_page(
    path: Path,
    library: PrimitiveLibrary,
    rows: Sequence[Mapping[str, Any]],
    pairs: Mapping[str, Encounter],
    built: Built,
) -> None:
    """Write the page of primitives: how frequent, how long, what follows, and examples."""
    segments: dict[
        int, list[tuple[str, str, int, int]]
    ] = {}  # pair, kind, begin and end of each, by primitive
    follows: Counter[tuple[int, int]] = Counter()
    for row in rows:
        edges = pairwise([0, *row["changepoints"], len(pairs[row["pair"]].time)])
        for primitive, (begin, end) in zip(row["primitives"], edges, strict=True):
            segments.setdefault(primitive, []).append((row["pair"], row["kind"], begin, end))
        follows.update(pairwise(row["primitives"]))
    dt = next(iter(pairs.values())).dt
    total = sum(end - begin for own in segments.values() for _, _, begin, end in own)
    cards = []
    for k, own in sorted(segments.items(), key=lambda item: -len(item[1])):
        lasts = sum(end - begin for _, _, begin, end in own)
        kinds = Counter(kind for _, kind, _, _ in own).most_common(4)
        answers = Counter(
            answer for name, *_ in own for answer in _answers(pairs[name])
        ).most_common()
        after = sorted(
            ((n, to) for (start, to), n in follows.items() if start == k), reverse=True
        )[:3]
        lines = [
            f"{len(own)} segments, {100.0 * lasts / total:.1f} % of the time, {lasts * dt / len(own):.1f} s each",
            "in " + ", ".join(f"{n} × {kind}" for kind, n in kinds),
            "; ".join(f"{message} in {n} of them" for message, n in answers),
            "followed by "
            + (", ".join(f"primitive {to} ({n} ×)" for n, to in after) or "nothing"),
            *(
                f"{name}, {begin * dt:.1f} to {end * dt:.1f} s"
                for name, _, begin, end in own[:EXAMPLES]
            ),
        ]
        pictures = [sketch(pairs[name], (begin, end)) for name, _, begin, end in own[:EXAMPLES]]
        cards.append(
            {
                "title": f"primitive {k}: {library.descriptions[k]}",
                "lines": lines,
                "pictures": pictures,
            }
        )
    first, *rest = built.lines()
    write_page(path, "Primitives of pairs of vehicles", f"{first}. {LEGEND}", cards, rest)


def _answers(pair: Encounter) -> set[str]:
    """Return who reacts in a pair, and how."""
    edges = Situation.of(pair).reactions.edges
    return {f"the {('first', 'second')[edge.who]} {VERBS[edge.kind]}" for edge in edges} or {
        "nobody reacts"
    }
