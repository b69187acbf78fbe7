# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Segmentation: speed and accuracy on sequences with known states, on labelled recordings, and online, beside the peers.

Every figure is the median over seeds that were not looked at while developing; the interquartile range stands beside it.
Speed is the CPU time of exactly the configuration that is scored: features, starts, all chains, point estimate.
"""

from collections.abc import Callable, Iterator, Sequence
import os
from pathlib import Path
import pickle
import subprocess
import sys
import time

import numpy as np

from benchmarks import _segmentation_peers as peers
from benchmarks._segmentation_calibration import calibrate, Calibration, deciles, near
from benchmarks._segmentation_data import driving, gaussian_hmm, Labelled, with_gaps, with_outliers
from benchmarks._segmentation_scores import changes, f1, hamming, smoother
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.method.segmentation import (
    OnlineSegmenter,
    SamplerConfig,
    segment,
    segment_series,
    SegmentationConfig,
)
from scenario_gen.method.segmentation.hdp_hmm.chain import TRACE
from scenario_gen.method.segmentation.hdp_hmm.config import GAUSSIAN_DOF_COUNT
from scenario_gen.numerics.arrays import Floats, Ints

SEEDS = range(9101, sized(9113, quick=9102))
SEEDS_OF_A = range(9101, sized(9141, quick=9102))  # short sequences, so more of them
PRIORS, TICKS = sized(
    (400, 36_000), quick=(5, 80)
)  # sequences of the calibration, samples of the online hour
ROBUST_SEEDS = range(9201, sized(9206, quick=9202))
MANY_SEEDS = range(9301, sized(9304, quick=9301))
LABELLED = sized(None, quick=1)  # recordings of a set
MOST_SWEEPS, MOST_TIMES = sized((5000, 20.0), quick=(20, 1.0))  # of jax-moseq until its F1 is ours
TARGET_HAMMING = {"A": 0.01, "B": 0.01, "C": 0.02}
TARGET_F1 = {"A": 0.03, "B": 0.03, "C": 0.05}
DATA = (
    Path(
        os.environ.get(
            "SCENARIO_GEN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"
        )
    )
    / "labelled_series"
)
LABELLED_SEEDS = range(1, sized(11, quick=2))
NOT_INSTALLED = "peer not installed"


def spread(values: list[float]) -> str:
    """Interquartile range, as text."""
    low, high = np.quantile(values, [0.25, 0.75])
    return f"IQR {low:.3g}-{high:.3g}"


def run() -> list[Row]:
    """Return all rows."""
    segment_series(np.random.default_rng(0).normal(size=(50, 2)))
    rows = [_first_call()]
    seconds: dict[str, float] = {}
    for cell in ("A", "B", "C"):
        rows += _cell(cell, seconds)
    rows += _driving(seconds)
    rows += _speed()
    rows += _sweeps()
    rows += _robust()
    rows += _calibration()
    rows += _online()
    return rows + _labelled()


def _first_call() -> Row:
    """CPU seconds from starting an interpreter to its first answer, kernels in the cache: the median of three."""
    parts = {
        "numpy": "import numpy",
        "numba": "import numpy, numba",
        "all imports": "import numpy, scenario_gen.method.segmentation",
        "first answer": "import numpy, scenario_gen.method.segmentation as s; s.segment_series(numpy.eye(50)[:, :2])",
    }
    spent = {
        name: float(np.median([_fresh(code) for _ in range(sized(3, quick=1))]))
        for name, code in parts.items()
    }
    text = "CPU after: " + ", ".join(f"{name} {seconds:.2f} s" for name, seconds in spent.items())
    return lower("first call in a fresh process", spent["first answer"], "s", 2.0, text)


def _fresh(code: str) -> float:
    """CPU seconds of a fresh interpreter that runs `code`."""
    before = os.times()
    subprocess.run([sys.executable, "-c", code], check=True)
    after = os.times()
    return (
        after.children_user + after.children_system - before.children_user - before.children_system
    )


def _cell(cell: str, seconds: dict[str, float]) -> list[Row]:
    """One Gaussian cell: what is lost to the smoother that knows the truth, convergence, calibration, CPU time."""
    lost_hamming, lost_f1, best_hamming, best_f1, spurious, spent = [], [], [], [], [], []
    short, r_hats, sweeps, predicted, truth = 0, [], [], [], []
    for seed in SEEDS_OF_A if cell == "A" else SEEDS:
        sequence = gaussian_hmm(cell, seed)
        best = smoother(sequence)
        started = time.process_time()
        found = segment_series(sequence.x, seed=seed)
        spent.append(time.process_time() - started)
        best_hamming.append(hamming(sequence.labels, best))
        best_f1.append(f1(sequence.changepoints, changes(best), 5))
        lost_hamming.append(hamming(sequence.labels, found.labels) - best_hamming[-1])
        lost_f1.append(best_f1[-1] - f1(sequence.changepoints, found.changepoints, 5))
        spurious.append(float((np.bincount(found.labels) < 0.01 * len(found.labels)).sum()))
        short += len(np.unique(found.labels)) < len(np.unique(best))
        r_hats.append(found.r_hat)
        sweeps.append(peers.sweeps_run(found))
        apart = slice(seed % 10, None, 10)
        predicted.append(found.probability_within(5)[apart])
        truth.append(near(sequence.changepoints, len(sequence.x), 5)[apart])
    seconds[cell] = float(np.median(spent))
    known = f"true parameters: Hamming {np.median(best_hamming):.4f}, F1 {np.median(best_f1):.3f}"
    limit = 2.0 if cell == "C" else None
    traces = ", ".join(
        f"{name} {value:.2f}"
        for name, value in zip(TRACE, np.quantile(r_hats, 0.9, axis=0), strict=True)
    )
    calibration = Calibration(*deciles(np.concatenate(predicted), np.concatenate(truth)), 0.0, 0)
    return [
        lower(
            f"{cell}: Hamming above the smoother's",
            float(np.median(lost_hamming)),
            "",
            TARGET_HAMMING[cell],
            f"{known}; mean {np.mean(lost_hamming):.4f}, worst {max(lost_hamming):.3f}; {spread(lost_hamming)}",
        ),
        lower(
            f"{cell}: F1 below the smoother's",
            float(np.median(lost_f1)),
            "",
            TARGET_F1[cell],
            spread(lost_f1),
        ),
        lower(
            f"{cell}: seeds with fewer states than the smoother finds, of {len(spent)}",
            short,
            "",
            len(spent) / 40.0,
        ),
        lower(f"{cell}: spurious states, worst seed", max(spurious), "", 1.0),
        lower(
            f"{cell}: split R-hat, worst trace, median",
            float(np.median(np.max(r_hats, axis=1))),
            "",
            1.1,
        ),
        lower(
            f"{cell}: split R-hat, worst trace, 90 %",
            float(np.quantile(np.max(r_hats, axis=1), 0.9)),
            "",
            1.2,
            traces,
        ),
        lower(
            f"{cell}: calibration, worst decile with 30 samples or more",
            calibration.worst,
            "",
            0.1,
            calibration.table,
        ),
        lower(
            f"{cell}: CPU",
            seconds[cell],
            "s",
            limit,
            f"{spread(spent)}; {np.median(sweeps):.0f} sweeps in all",
        ),
    ]


def _driving(seconds: dict[str, float]) -> list[Row]:
    """Cell D: changepoints of two simulated vehicles, also with outliers and with samples lost."""
    config = SegmentationConfig(max_rate=10.0)
    scores, spent, ratios, pelt = [], [], [], []
    worse: dict[str, list[float]] = {"1 % outliers": [], "5 % lost": []}
    for seed in SEEDS:
        sequence = driving(seed)
        assert sequence.encounter is not None
        started = time.process_time()
        found = segment(sequence.encounter, config, seed)
        spent.append(time.process_time() - started)
        scores.append(f1(sequence.changepoints, found.changepoints, 5))
        ratios.append(len(found.changepoints) / len(sequence.changepoints))
        for name, change in (("1 % outliers", with_outliers), ("5 % lost", with_gaps)):
            changed = change(sequence.encounter, np.random.default_rng([seed, 5]))
            worse[name].append(
                f1(sequence.changepoints, segment(changed, config, seed).changepoints, 5)
            )
        rivals = (
            peers.ruptures(np.gradient(sequence.x[:, [2, 5]], axis=0))
            if seed < SEEDS[0] + 3
            else None
        )
        if rivals is not None:
            pelt.append(f1(sequence.changepoints, rivals, 5))
    seconds["D"] = float(np.median(spent))
    rival = (
        f"; ruptures PELT on accelerations {np.median(pelt):.3f}"
        if pelt
        else f"; ruptures: {NOT_INSTALLED}"
    )
    return [
        higher("D: F1", float(np.median(scores)), "", 0.90, spread(scores) + rival),
        higher(
            "D, 1 % outliers: F1",
            float(np.median(worse["1 % outliers"])),
            "",
            0.90,
            spread(worse["1 % outliers"]),
        ),
        higher(
            "D, 5 % lost: F1",
            float(np.median(worse["5 % lost"])),
            "",
            0.92,
            spread(worse["5 % lost"]),
        ),
        lower("D: changepoints found per true one", float(np.median(ratios)), ""),
        lower("D: CPU", seconds["D"], "s", None, spread(spent)),
    ]


def _speed() -> list[Row]:
    """CPU time of jax-moseq's sampler over ours of a whole call: for as many sweeps, and until its F1 reaches ours.

    Both run on one series, that of the first seed. jax-moseq is compiled before. Its search for our F1 is limited to
    `MOST_SWEEPS` and `MOST_TIMES` our CPU time; a ratio of one that ends there is a lower bound.
    """
    rows = []
    for cell in ("A", "B", "D"):
        sequence = driving(SEEDS[0]) if cell == "D" else gaussian_hmm(cell, SEEDS[0])
        config = SegmentationConfig(max_rate=10.0)
        started = time.process_time()
        if sequence.encounter is None:
            posterior = segment_series(sequence.x, seed=SEEDS[0])
            found = posterior.changepoints
        else:
            found = segment(sequence.encounter, config, SEEDS[0]).changepoints
        ours = time.process_time() - started
        if sequence.encounter is not None:
            posterior = peers.posterior_of(sequence.encounter, config, SEEDS[0])[
                1
            ]  # the same again, for its sweeps
        rows += _against_moseq(
            cell, sequence, ours, f1(sequence.changepoints, found, 5), peers.sweeps_run(posterior)
        )
    return rows


def _against_moseq(
    cell: str, sequence: Labelled, ours: float, own: float, sweeps: int
) -> list[Row]:
    """Rows of a cell, from our CPU seconds, our F1 and the sweeps that we ran."""

    def score(labels: Ints) -> float:
        return f1(sequence.changepoints, changes(labels), 5)

    titles = (
        f"{cell}: CPU of jax-moseq for as many sweeps, over ours",
        f"{cell}: CPU of jax-moseq to our F1, over ours",
    )
    same = peers.jax_moseq(sequence.x, sweeps)
    if same is None:
        return [higher(title, 0.0, "×", None, NOT_INSTALLED) for title in titles]
    until = peers.jax_moseq(
        sequence.x,
        MOST_SWEEPS,
        done=lambda labels: score(labels) >= own,
        every=10,
        most=MOST_TIMES * ours,
    )
    assert until is not None
    reached = "reached" if score(until.labels) >= own else "not reached, a lower bound"
    mine = f"ours {ours:.2f} s, F1 {own:.3f}, {sweeps} sweeps"
    told = [
        f"jax-moseq {chain.seconds:.2f} s, F1 {score(chain.labels):.3f}, Hamming {hamming(sequence.labels, chain.labels):.3f}"
        for chain in (same, until)
    ]
    return [
        higher(titles[0], same.seconds / ours, "×", None, f"{told[0]}; {mine}"),
        higher(
            titles[1],
            until.seconds / ours,
            "×",
            None,
            f"{reached} after {until.sweeps} sweeps: {told[1]}; {mine}",
        ),
    ]


def _sweeps() -> list[Row]:
    """CPU time of a sweep, Gaussian and Student-t."""
    rows = []
    for cell in ("A", "B", "C"):
        x = gaussian_hmm(cell, SEEDS[0]).x
        cost = {}
        for name, dof in (("Gaussian", GAUSSIAN_DOF_COUNT), ("Student-t", 4.0)):
            spent = []
            for sweeps in (50, 250):  # what a call costs besides its sweeps goes out
                config = SamplerConfig(sweeps=sweeps, r_hat=1.0, dof=dof, weight=1.0, chains=1)
                started = time.process_time()
                segment_series(x, config)
                spent.append(time.process_time() - started)
            cost[name] = (spent[1] - spent[0]) / 200.0
        rows.append(lower(f"{cell}: a sweep, Gaussian", 1e6 * cost["Gaussian"], "µs"))
        rows.append(
            lower(
                f"{cell}: a Student-t sweep over a Gaussian one",
                cost["Student-t"] / cost["Gaussian"],
                "",
            )
        )
    return rows


def _robust() -> list[Row]:
    """Cell B with heavy tails, outliers, gaps and channels that follow from others; and 30 states."""
    lost: dict[str, list[float]] = {}
    scores: dict[str, list[float]] = {}

    def note(name: str, sequence: Labelled, x: Floats, base: float, best: float) -> None:
        found = segment_series(x, seed=1)
        lost.setdefault(name, []).append(hamming(sequence.labels, found.labels) - base)
        scores.setdefault(name, []).append(best - f1(sequence.changepoints, found.changepoints, 5))

    for seed in ROBUST_SEEDS:
        rng = np.random.default_rng([seed, 6])
        heavy = gaussian_hmm("B", seed, dof=3.0)
        note("t3", heavy, heavy.x, 0.0, f1(heavy.changepoints, changes(smoother(heavy, 3.0)), 5))
        sequence = gaussian_hmm("B", seed)
        x = sequence.x
        plain = segment_series(x, seed=1)
        base, best = (
            hamming(sequence.labels, plain.labels),
            f1(sequence.changepoints, plain.changepoints, 5),
        )
        note("twin channel", sequence, np.column_stack([x, 2.0 * x[:, 0]]), base, best)
        note("summed channel", sequence, np.column_stack([x[:, 0] + x[:, 1], x]), base, best)
        note(
            "5 % of cells missing",
            sequence,
            np.where(rng.uniform(size=x.shape) < 0.05, np.nan, x),
            base,
            best,
        )
        far = (rng.uniform(size=(len(x), 1)) < 0.01) * rng.normal(size=x.shape)
        note("1 % outliers of 20 deviations", sequence, x + 20.0 * far, base, best)
        note("1 % outliers of 1000 deviations", sequence, x + 1000.0 * far, base, best)
    rows = [
        lower(
            "B, Student-t noise of 3 degrees: Hamming", float(np.median(lost.pop("t3"))), "", 0.06
        ),
        lower(
            "B, Student-t noise of 3 degrees: F1 below the smoother's",
            float(np.median(scores.pop("t3"))),
            "",
            0.05,
        ),
    ]
    for name, values in lost.items():
        rows.append(
            lower(
                f"B, {name}: Hamming above that without", max(values), "", 0.01, "the worst seed"
            )
        )
    many = [
        int(segment_series(gaussian_hmm("M", seed, distance=4.0).x).labels.max()) + 1
        for seed in MANY_SEEDS
    ]
    return [
        *rows,
        higher(
            "30 states: found",
            float(np.median(many)),
            "",
            30.0,
            f"T 12,000, means 4 apart; {many}",
        ),
    ]


def _calibration() -> list[Row]:
    """Sequences from the model's own prior: are probabilities and intervals right?"""
    found = calibrate(range(SEEDS[0], SEEDS[0] + PRIORS), d=1)
    return [
        lower(
            "calibration: worst decile with 30 samples or more", found.worst, "", 0.1, found.table
        ),
        higher(
            "calibration: coverage of 5-95 % intervals",
            found.coverage,
            "",
            0.85,
            f"{found.intervals} intervals; 0.85-0.95",
        ),
    ]


def _online() -> list[Row]:
    """The online segmenter on D, its memory over an hour, and its time with 8 vehicles."""
    scores, delays = [], []
    for seed in SEEDS:
        sequence = driving(seed)
        encounter = sequence.encounter
        assert encounter is not None
        online = OnlineSegmenter(2, 0.1)
        found = [
            c
            for t in range(len(sequence.x))
            for c in online.push(encounter.position[:, t], encounter.speed[:, t])
        ]
        samples = np.array([c.sample for c in found], dtype=np.int64)
        scores.append(f1(sequence.changepoints, samples, 5))
        for change in found:
            truth = sequence.changepoints[np.abs(sequence.changepoints - change.sample).argmin()]
            if abs(truth - change.sample) <= 5:
                delays.append((change.confirmed - truth) * 0.1)
    return [
        higher("online D: F1", float(np.median(scores)), "", 0.85, spread(scores)),
        lower("online D: median delay", float(np.median(delays)), "s", 1.5),
        *_hour(),
    ]


def _hour() -> list[Row]:
    """How much the segmenter's pickled state grows, and CPU time per sample, over an hour of 8 vehicles."""
    four = []
    for seed in range(4):
        encounter = driving(SEEDS[0] + seed, 6000).encounter
        assert encounter is not None
        four.append(encounter)
    position = np.concatenate([e.position for e in four])
    speed = np.concatenate([e.speed for e in four])
    online = OnlineSegmenter(8, 0.1)
    sizes, started = [], time.process_time()
    for t in range(TICKS):
        online.push(position[:, t % 6000], speed[:, t % 6000])
        if t in (TICKS // 4, TICKS - 1):
            sizes.append(len(pickle.dumps(online)))
    spent = time.process_time() - started
    return [
        lower(
            "online: growth of its state over an hour, 8 vehicles",
            (sizes[1] - sizes[0]) / 1024.0,
            "KiB",
            64.0,
        ),
        lower("online: CPU per sample, 8 vehicles", 1e3 * spent / TICKS, "ms", 100.0),
    ]


def _mocap6() -> Iterator[tuple[Floats, Ints]]:
    """Sequences of mocap6: 12 channels and an action per step, numbered alike in all."""
    files = [path.read_text().splitlines()[1:] for path in sorted((DATA / "mocap6").glob("*.csv"))]
    tables = [[line.split(",") for line in lines] for lines in files]
    actions = sorted({row[-1] for rows in tables for row in rows})
    for rows in tables:
        yield (
            np.array([[float(v) for v in row[2:14]] for row in rows]),
            np.array([actions.index(row[-1]) for row in rows]),
        )


def _bee_dance() -> Iterator[tuple[Floats, Ints]]:
    """Sequences of bee_dance: 3 channels and a segment per frame."""
    for path in sorted((DATA / "bee_dance").glob("*.csv")):
        values = np.loadtxt(path, delimiter=",", skiprows=1)
        yield values[:, 1:4], values[:, 5].astype(np.int64)


def _labelled() -> list[Row]:
    """Labelled recordings; each peer's figure beside ours is the target."""
    if not DATA.is_dir():
        return []
    mocap, bees = list(_mocap6())[:LABELLED], list(_bee_dance())[:LABELLED]
    moves = [[segment_series(x, seed=seed) for x, _ in mocap] for seed in LABELLED_SEEDS]
    dancing = SamplerConfig(emission="autoregressive", order=2)
    dances = [[segment_series(x, dancing, seed=seed) for x, _ in bees] for seed in LABELLED_SEEDS]
    rows = []
    learned = [peers.hmmlearn(x, len(np.unique(z))) for x, z in mocap]
    wrong = [_mean(mocap, [p.labels for p in found], hamming) for found in moves]
    eight = [int(segment_series(x, SamplerConfig(chains=8), seed=1).kept.sum()) for x, _ in mocap]
    rows.append(higher("mocap6: chains of 8 that agree, worst sequence", min(eight), "", 6.0))
    stops, actions = (
        tuple(np.cumsum([len(x) for x, _ in mocap]).tolist()),
        np.concatenate([z for _, z in mocap]),
    )
    joint = [
        hamming(
            actions, segment_series(np.vstack([x for x, _ in mocap]), seed=k, ends=stops).labels
        )
        for k in LABELLED_SEEDS
    ]
    rows.append(
        lower(
            "mocap6, all sequences at once: Hamming",
            float(np.mean(joint)),
            "",
            0.2,
            f"ours by seed {joint}",
        )
    )
    rows.append(
        lower(
            "mocap6, all sequences at once: its standard deviation", float(np.std(joint)), "", 0.02
        )
    )
    rows.append(
        _against(
            "mocap6: Hamming", wrong, "lower", {"hmmlearn, true K": _mean(mocap, learned, hamming)}
        )
    )
    rivals = {
        "hmmlearn, true K": _mean(
            mocap,
            [None if z is None else changes(z) for z in learned],
            lambda z, c: f1(changes(z), c, 5),
        ),
        "ruptures": _mean(
            mocap, [peers.ruptures(x) for x, _ in mocap], lambda z, c: f1(changes(z), c, 5)
        ),
    }
    scores = [
        _mean(mocap, [p.changepoints for p in found], lambda z, c: f1(changes(z), c, 5))
        for found in moves
    ]
    rows.append(_against("mocap6: F1 (5 samples)", scores, "higher", rivals))
    learned = [peers.hmmlearn(x, 3) for x, _ in bees]
    rivals = {
        "hmmlearn, 3 dances": _mean(
            bees,
            [None if z is None else changes(z) for z in learned],
            lambda z, c: f1(changes(z), c, 15),
        ),
        "ruptures": _mean(
            bees, [peers.ruptures(x) for x, _ in bees], lambda z, c: f1(changes(z), c, 15)
        ),
    }
    scores = [
        _mean(bees, [p.changepoints for p in found], lambda z, c: f1(changes(z), c, 15))
        for found in dances
    ]
    rows.append(_against("bee_dance: F1 (15 frames), AR(2)", scores, "higher", rivals))
    return rows


def _mean(
    series: list[tuple[Floats, Ints]],
    found: Sequence[Ints | None],
    score: Callable[[Ints, Ints], float],
) -> float | None:
    """Mean score over a set; None if the peer is missing."""
    scores = [score(z, f) for (_, z), f in zip(series, found, strict=True) if f is not None]
    return float(np.mean(scores)) if len(scores) == len(series) else None


def _against(
    name: str, ours: Sequence[float | None], better: str, rivals: dict[str, float | None]
) -> Row:
    """Return a row of the mean over our seeds, whose target is the best rival's figure."""
    each = [value for value in ours if value is not None]
    known = [value for value in rivals.values() if value is not None]
    text = ", ".join(
        f"{rival} {NOT_INSTALLED if value is None else f'{value:.3f}'}"
        for rival, value in rivals.items()
    )
    text += f"; ours by seed {', '.join(f'{value:.3f}' for value in each)}"
    if better == "lower":
        return lower(name, float(np.mean(each)), "", min(known) if known else None, text)
    return higher(name, float(np.mean(each)), "", max(known) if known else None, text)
