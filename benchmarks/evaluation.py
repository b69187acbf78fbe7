# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Evaluation: DTW beside dtaidistance, the feature matrix beside scipy, the report's cost, and figure 5 as numbers.

Figure 5 needs the recorded encounters (SCENARIO_GEN_DATA); without them only the bundled cases are measured. It takes some
minutes, and says on stderr what each case came to.
"""

from collections.abc import Callable, Sequence
import os
from pathlib import Path
import sys
from time import process_time
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from benchmarks._figure5 import LINEAR, measure, Measured, SEEDS
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.method.evaluation import dtw_distance, feature_matrix
from scenario_gen.types import UNIFORM, WITH, WITHOUT

DATA = Path(
    os.environ.get("SCENARIO_GEN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
)
STEPS = sized(3000, quick=100)
SIGNIFICANT = 0.03  # below it, E without changepoints leaves nothing to gain


def run() -> list[Row]:
    """Measure."""
    cases = list(measure(DATA, lambda line: print(line, file=sys.stderr, flush=True)))
    return [*_kernels(), *_figure5(cases)]


def _kernels() -> list[Row]:
    rng = np.random.default_rng(0)
    a, b = (rng.normal(size=(STEPS, 2)).cumsum(axis=0) for _ in range(2))
    rows = []
    ours, distance = _fastest(lambda: dtw_distance(a, b))
    try:
        from dtaidistance import dtw_ndim

        theirs, reference = _fastest(lambda: dtw_ndim.distance_fast(a, b, inner_dist="euclidean"))
        peer = f"dtaidistance C {1e3 * theirs:.1f} ms, ours {1e3 * ours:.1f} ms"
        rows += [
            higher(
                f"DTW, 2-D, T = {STEPS}: faster than dtaidistance", theirs / ours, "×", 4.0, peer
            ),
            lower(
                "DTW: difference from dtaidistance",
                abs(distance - reference),
                "",
                1e-9,
                "dtaidistance C",
            ),
        ]
    except ImportError:
        rows.append(
            lower(f"DTW, 2-D, T = {STEPS} (dtaidistance is not installed)", 1e3 * ours, "ms")
        )

    def normalised() -> Any:
        matrix = cdist(a, b)
        return (matrix - matrix.min()) / (matrix.max() - matrix.min())

    ours, matrix = _fastest(lambda: feature_matrix(a, b))
    theirs, reference = _fastest(normalised)
    peer = f"scipy cdist {1e3 * theirs:.0f} ms, ours {1e3 * ours:.0f} ms"
    rows.append(
        higher(f"feature matrix, T = {STEPS}: faster than scipy", theirs / ours, "×", 2.0, peer)
    )
    rows.append(
        lower(
            "feature matrix: difference from scipy",
            float(np.abs(matrix - reference).max()),
            "",
            1e-12,
            "scipy",
        )
    )
    return rows


def _figure5(cases: Sequence[Measured]) -> list[Row]:
    if not cases:
        return []
    own, others = (
        [case for case in cases if case.own_road],
        [case for case in cases if not case.own_road],
    )
    rows = [
        lower(
            "evaluation and report of 50 samples, most costly case",
            max(c.seconds for c in cases),
            "s CPU",
            10.0,
        ),
        Row(
            "figure 5: cases measured",
            len(cases),
            "",
            "higher",
            peer=f"seeds {', '.join(map(str, SEEDS))}",
        ),
        lower(
            "changepoints per second, most",
            max(c.evaluation.changepoints / c.evaluation.duration for c in cases),
            "1/s",
            0.5,
        ),
    ]
    for kind, targets in (("position", (0.15, 0.5, 0.7)), ("speed", (0.30, 0.5, 0.9))):
        key = f"e_{kind}"
        telling = [c for c in cases if c.value(WITHOUT, key) >= SIGNIFICANT]
        worse = [c for c in telling if not c.value(WITH, key) < c.value(WITHOUT, key)]
        label = f"E {kind}: with below without, of {len(telling)} cases"
        peer = ", ".join(
            f"not {c.evaluation.encounter} on {c.evaluation.road}, seed {c.seed}" for c in worse
        )
        rows.append(
            higher(
                label,
                1.0 - len(worse) / len(telling) if telling else float("nan"),
                "share",
                1.0,
                peer,
            )
        )
        for name, group, target in (
            ("own road", own, targets[0]),
            ("other roads", others, targets[1]),
        ):
            peer = f"uniform {_ratio(group, UNIFORM, key):.2f}, best linear pieces {_ratio(group, LINEAR, key):.2f}"
            rows.append(
                lower(
                    f"E {kind}: median with / without, {name}",
                    _ratio(group, WITH, key),
                    "",
                    target,
                    peer,
                )
            )
        even = [c for c in cases if np.isfinite(c.value(UNIFORM, key))]
        below = {c: c.value(WITH, key) < c.value(UNIFORM, key) for c in even}
        shares = (
            f"seed {seed} {_share([below[c] for c in even if c.seed == seed]):.2f}"
            for seed in SEEDS
        )
        label = f"E {kind}: below uniform, of {len(even)} cases"
        rows.append(
            higher(label, _share(list(below.values())), "share", targets[2], ", ".join(shares))
        )
        correlation = float(np.nanmedian([c.value(WITH, f"correlation_{kind}") for c in cases]))
        rows.append(
            higher(f"{kind}: correlation with the template's matrix, median", correlation, "", 0.9)
        )
    return rows


def _share(hits: Sequence[bool]) -> float:
    return float(np.mean(hits)) if hits else float("nan")


def _ratio(cases: Sequence[Measured], arm: str, key: str) -> float:
    """Median of E with / E without over the cases in which E without is worth speaking of."""
    ratios = [
        c.value(arm, key) / c.value(WITHOUT, key)
        for c in cases
        if c.value(WITHOUT, key) >= SIGNIFICANT
    ]
    known = [ratio for ratio in ratios if np.isfinite(ratio)]
    return float(np.median(known)) if known else float("nan")


def _fastest(call: Callable[[], Any], repeats: int = sized(7, quick=1)) -> tuple[float, Any]:
    """Return the least CPU time of some calls, and what they returned."""
    times, result = [], None
    for _ in range(repeats):
        started = process_time()
        result = call()
        times.append(process_time() - started)
    return min(times), result
