# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Segmentation: accuracy and speed on sequences with known states, beside the peers.

Every figure is the median over seeds that were not used during development; the interquartile range
is beside it. Speed is the CPU time of the configuration that is scored: features, starts, all
chains and the point estimate.
"""

from collections.abc import Iterator, Sequence
import time
from typing import Any
import warnings

import numpy as np

from benchmarks import _segmentation_peers as peers
from benchmarks._sampling_cases import DATA
from benchmarks._segmentation_data import driving, gaussian_hmm, with_gaps, with_outliers
from benchmarks._segmentation_scores import changes, f1, hamming, smoother
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.method.segmentation import (
    Posterior,
    segment,
    SegmentationConfig,
    SegmentationWarning,
    StickyHDPHMM,
)
from scenario_gen.numerics.arrays import Floats, Ints

SEEDS = range(9101, sized(9113, quick=9102))
SEEDS_OF_A = range(9101, sized(9141, quick=9102))
"""Sequences of cell A are short, so there are more of them."""
ROBUST_SEEDS = range(9201, sized(9206, quick=9202))
LABELLED_SEEDS = range(1, sized(11, quick=2))
RECORDINGS = sized(None, quick=1)
MAX_LOST = {"A": (0.01, 0.03), "B": (0.01, 0.03), "C": (0.02, 0.05)}
"""By cell: how far Hamming distance and F1 may be from the smoother's."""
DRIVING_CONFIG = SegmentationConfig(max_rate=10.0)


def run() -> list[Row]:
    """Return all rows."""
    _posterior(np.random.default_rng(0).normal(size=(50, 2)), 0)
    cells = [row for cell in MAX_LOST for row in _cell(cell)]
    return [*cells, *_driving(), *_robust(), *_labelled()]


def _posterior(x: Floats, seed: int, **options: Any) -> Posterior:
    """Return the posterior of a series (T, D)."""
    with warnings.catch_warnings(action="ignore", category=SegmentationWarning):
        return StickyHDPHMM(random_state=seed, **options).fit(x).posterior_


def _row(
    name: str, values: Sequence[float], unit: str, target: float | None, peer: str = ""
) -> Row:
    """Return a figure that is better when it is lower: the median over seeds."""
    return lower(name, float(np.median(values)), unit, target, spread(values) + peer)


def _f1_row(name: str, values: Sequence[float], target: float, peer: str = "") -> Row:
    return higher(f"{name}: F1", float(np.median(values)), "", target, spread(values) + peer)


def spread(values: Sequence[float]) -> str:
    """Return the interquartile range as text."""
    low, high = np.quantile(values, [0.25, 0.75])
    return f"IQR {low:.3g}-{high:.3g}"


def _cell(cell: str) -> list[Row]:
    """Compare one Gaussian cell with the smoother that knows the true parameters."""
    lost_hamming, lost_f1, r_hat, seconds = (
        list[float](),
        list[float](),
        list[float](),
        list[float](),
    )
    short = 0
    for seed in SEEDS_OF_A if cell == "A" else SEEDS:
        sequence = gaussian_hmm(cell, seed)
        best = smoother(sequence)
        started = time.process_time()
        found = _posterior(sequence.x, seed)
        seconds.append(time.process_time() - started)
        best_f1 = f1(sequence.changepoints, changes(best), 5)
        lost_hamming.append(
            hamming(sequence.labels, found.labels) - hamming(sequence.labels, best)
        )
        lost_f1.append(best_f1 - f1(sequence.changepoints, found.changepoints, 5))
        short += len(np.unique(found.labels)) < len(np.unique(best))
        r_hat.append(float(np.max(found.r_hat)))
    name = f"{cell}: seeds with fewer states than the smoother, of {len(seconds)}"
    high_r_hat = float(np.quantile(r_hat, 0.9))
    return [
        _row(f"{cell}: Hamming above the smoother's", lost_hamming, "", MAX_LOST[cell][0]),
        _row(f"{cell}: F1 below the smoother's", lost_f1, "", MAX_LOST[cell][1]),
        lower(name, short, "", len(seconds) / 40.0),
        lower(f"{cell}: split R-hat, worst trace, 90 %", high_r_hat, "", 1.2),
        _row(f"{cell}: CPU", seconds, "s", 2.0 if cell == "C" else None),
    ]


def _driving() -> list[Row]:
    """Score the changepoints of two simulated vehicles, also with outliers and lost samples."""
    scores: dict[str, list[float]] = {"D": [], "D, 1 % outliers": [], "D, 5 % lost": []}
    seconds = []
    for seed in SEEDS:
        sequence, rng = driving(seed), np.random.default_rng([seed, 5])
        assert sequence.encounter is not None
        encounters = {
            "D": sequence.encounter,
            "D, 1 % outliers": with_outliers(sequence.encounter, rng),
            "D, 5 % lost": with_gaps(sequence.encounter, np.random.default_rng([seed, 5])),
        }
        for name, encounter in encounters.items():
            started = time.process_time()
            found = segment(encounter, DRIVING_CONFIG, seed)
            seconds.append(time.process_time() - started)
            scores[name].append(f1(sequence.changepoints, found.changepoints, 5))
    targets = {"D": 0.9, "D, 1 % outliers": 0.9, "D, 5 % lost": 0.92}
    rows = [_f1_row(name, scores[name], target) for name, target in targets.items()]
    return [*rows, _row("D: CPU", seconds, "s", None)]


def _robust() -> list[Row]:
    """Score cell B with heavy tails, outliers and dependent channels."""
    lost: dict[str, list[float]] = {}
    heavy_tails = []
    for seed in ROBUST_SEEDS:
        rng = np.random.default_rng([seed, 6])
        heavy = gaussian_hmm("B", seed, dof=3.0)
        heavy_tails.append(hamming(heavy.labels, _posterior(heavy.x, 1).labels))
        sequence = gaussian_hmm("B", seed)
        x = sequence.x
        far = (rng.uniform(size=(len(x), 1)) < 0.01) * rng.normal(size=x.shape)
        variants = {
            "twin channel": np.column_stack([x, 2.0 * x[:, 0]]),
            "summed channel": np.column_stack([x[:, 0] + x[:, 1], x]),
            "1 % outliers of 20 deviations": x + 20.0 * far,
            "1 % outliers of 1000 deviations": x + 1000.0 * far,
        }
        base = hamming(sequence.labels, _posterior(x, 1).labels)
        for name, changed in variants.items():
            found = _posterior(changed, 1)
            lost.setdefault(name, []).append(hamming(sequence.labels, found.labels) - base)
    return [
        _row("B, Student-t noise of 3 degrees: Hamming", heavy_tails, "", 0.06),
        *(
            lower(f"B, {name}: Hamming above that without, worst seed", max(values), "", 0.01)
            for name, values in lost.items()
        ),
    ]


def _mocap6() -> Iterator[tuple[Floats, Ints]]:
    """Yield sequences of mocap6: 12 channels and an action per step."""
    files = sorted((DATA / "labelled_series" / "mocap6").glob("*.csv"))
    tables = [[line.split(",") for line in path.read_text().splitlines()[1:]] for path in files]
    actions = sorted({row[-1] for rows in tables for row in rows})
    for rows in tables:
        labels = np.array([actions.index(row[-1]) for row in rows])
        yield np.array([row[2:14] for row in rows], dtype=np.float64), labels


def _bee_dance() -> Iterator[tuple[Floats, Ints]]:
    """Yield sequences of bee_dance: 3 channels and a segment per frame."""
    for path in sorted((DATA / "labelled_series" / "bee_dance").glob("*.csv")):
        values = np.loadtxt(path, delimiter=",", skiprows=1)
        yield values[:, 1:4], values[:, 5].astype(np.int64)


def _labelled() -> list[Row]:
    """Score labelled recordings; the best peer's figure is the target."""
    autoregressive: dict[str, Any] = {"emission": "autoregressive", "order": 2}
    rows = []
    for name, series, options, states, tolerance in (
        ("mocap6", list(_mocap6())[:RECORDINGS], {}, None, 5),
        ("bee_dance, AR(2)", list(_bee_dance())[:RECORDINGS], autoregressive, 3, 15),
    ):
        if not series:
            continue
        scores, peer_scores = [], dict[str, list[float]]()
        for x, labels in series:
            truth = changes(labels)
            for seed in LABELLED_SEEDS:
                found = _posterior(x, seed, **options)
                scores.append(f1(truth, found.changepoints, tolerance))
            learned = peers.hmmlearn(x, states or len(np.unique(labels)))
            found_by = {
                "hmmlearn": None if learned is None else changes(learned),
                "ruptures": peers.ruptures(x),
            }
            for peer, changepoints in found_by.items():
                if changepoints is not None:
                    score = f1(truth, changepoints, tolerance)
                    peer_scores.setdefault(peer, []).append(score)
        means = {peer: float(np.mean(values)) for peer, values in peer_scores.items()}
        text = ", ".join(f"{peer} {mean:.3f}" for peer, mean in means.items())
        best = max(means.values(), default=None)
        rows.append(higher(f"{name}: F1", float(np.mean(scores)), "", best, text))
    return rows
