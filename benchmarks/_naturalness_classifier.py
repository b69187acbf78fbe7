# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The two-sample test by classifier: can windows of generated motion be told from windows of recorded motion?

Gradient boosting on windows of 3 s of one vehicle, cross-validated with whole encounters kept together; the area under the ROC
curve is 0.5 where they cannot be told. Source: Lopez-Paz & Oquab, Revisiting classifier two-sample tests, ICLR 2017.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks._naturalness_motion import ACCELERATION_BAND, DT, sign_changes, Signals, YAW_BAND
from scenario_gen.numerics.arrays import Floats, Ints

WINDOW, STRIDE = 30, 10  # steps of 0.1 s
HIGH = 1.0  # Hz: what is faster counts as high frequency
SERIES = {
    "speed": 0.05,
    "acceleration": ACCELERATION_BAND,
    "jerk": 0.5,
    "yaw rate": YAW_BAND,
    "lateral acceleration": ACCELERATION_BAND,
    "gap": 0.05,
    "closing speed": 0.1,
}
"""What a window holds, each with the band below which a value (of speed and gap: a step) has no sign."""
STATISTICS = (
    "mean",
    "spread",
    "least",
    "greatest",
    "step",
    "largest step",
    "sign changes",
    "high frequencies",
)
FEATURES = tuple(f"{series}: {statistic}" for series in SERIES for statistic in STATISTICS)
GROUPS = {
    "all features": tuple(SERIES),
    "longitudinal": ("speed", "acceleration", "jerk"),
    "lateral": ("yaw rate", "lateral acceleration"),
}
FOLDS, RATIO, FEW = 5, 2, 4000
"""Folds; generated windows for each recorded one; windows below which the folds are drawn twice."""


@dataclass(frozen=True)
class Progress:
    """The answer: mean area under the curve over folds, its error, and by how much it falls when a feature is shuffled."""

    area: float
    error: float
    importance: dict[str, float]

    def giveaways(self, count: int = 5) -> str:
        """Name the features that matter most."""
        best = sorted(self.importance.items(), key=lambda item: -item[1])[:count]
        return ", ".join(f"{name} {value:.3f}" for name, value in best if value > 0.001)


def windows(signals: Signals) -> Floats:
    """Return the features (W, F) of all windows of all vehicles of a recording or a sample."""
    count = len(signals.time) - 1
    rows = []
    for n in range(len(signals.speed)):
        others = [m for m in range(len(signals.speed)) if m != n]
        apart = np.hypot(*np.moveaxis(signals.position[others] - signals.position[n], -1, 0))
        for first in range(0, count - WINDOW + 1, STRIDE):
            last = first + WINDOW
            gap = apart[int(np.argmin(apart[:, first + WINDOW // 2])), first : last + 1]
            series = {
                "speed": signals.speed[n, first : last + 1],
                "acceleration": signals.acceleration[n, first:last],
                "jerk": signals.jerk[n, first : last - 1],
                "yaw rate": signals.yaw_rate[n, first:last],
                "lateral acceleration": signals.lateral[n, first:last],
                "gap": gap,
                "closing speed": -np.diff(gap) / DT,
            }
            rows.append(features(series))
    return np.array(rows).reshape(-1, len(FEATURES))


def features(series: dict[str, Floats]) -> Floats:
    """Return the statistics of each series of a window, in the order of FEATURES."""
    found: list[float] = []
    for name, band in SERIES.items():
        values = series[name]
        step = np.diff(values)
        signed = step if name in ("speed", "gap") else values
        line = np.linspace(values[0], values[-1], len(values))
        power = np.square(np.abs(np.fft.rfft(values - line)))
        fast = np.fft.rfftfreq(len(values), DT) > HIGH
        share = float(power[fast].sum() / power.sum()) if power.sum() > 1e-12 else 0.0
        found += [
            values.mean(),
            values.std(),
            values.min(),
            values.max(),
            step.std(),
            np.abs(step).max(),
        ]
        found += [float(sign_changes(signed, band)), share]
    return np.array(found)


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of one encounter: recorded (R, F) and generated (G, F)."""

    name: str
    recorded: Floats
    generated: Floats


def of_sets(
    name: str, template: Signals, samples: Sequence[Signals], rng: np.random.Generator
) -> Windows:
    """Take all windows of the template, and RATIO times as many of the samples, drawn without putting them back."""
    recorded = windows(template)
    generated = np.concatenate([windows(sample) for sample in samples])
    kept = min(len(generated), RATIO * len(recorded))
    return Windows(
        name, recorded, generated[np.sort(rng.choice(len(generated), kept, replace=False))]
    )


def told_apart(
    sets: Sequence[Windows], series: Sequence[str], *, importances: bool = False
) -> Progress | None:
    """Train and test; None where there are fewer encounters than folds, or scikit-learn is not installed."""
    try:
        from sklearn.ensemble import HistGradientBoostingClassifier
        from sklearn.metrics import roc_auc_score
        from threadpoolctl import threadpool_limits
    except ImportError:
        return None
    names = sorted({one.name for one in sets if len(one.recorded) and len(one.generated)})
    sets = [one for one in sets if one.name in names]
    if len(names) < FOLDS:
        return None
    columns = [k for k, name in enumerate(FEATURES) if name.split(":")[0] in series]
    parts = [part for one in sets for part in (one.recorded, one.generated)]
    sizes = [len(part) for part in parts]
    data = np.concatenate(parts)[:, columns]
    label = np.repeat(np.tile((0, 1), len(sets)), sizes)
    group = np.repeat(np.repeat([names.index(one.name) for one in sets], 2), sizes)
    weight = np.repeat(1.0 / np.array(sizes), sizes)
    weight *= len(weight) / weight.sum()
    areas: list[float] = []
    falls: dict[str, list[float]] = {FEATURES[k]: [] for k in columns}
    rng = np.random.default_rng(0)
    with threadpool_limits(
        1
    ):  # threads that wait for each other on a busy machine cost a hundred times the work
        for train, test in folds(group, len(names), rng, 2 if len(data) < FEW else 1):
            model = HistGradientBoostingClassifier(
                max_leaf_nodes=8, max_bins=64, min_samples_leaf=10, random_state=0
            )
            model.fit(data[train], label[train], sample_weight=weight[train])

            def area(
                table: Floats, model: HistGradientBoostingClassifier = model, test: Ints = test
            ) -> float:
                return float(
                    roc_auc_score(
                        label[test], model.predict_proba(table)[:, 1], sample_weight=weight[test]
                    )
                )

            areas.append(area(data[test]))
            for k, column in enumerate(columns) if importances else ():
                shuffled = data[test].copy()
                shuffled[:, k] = rng.permutation(shuffled[:, k])
                falls[FEATURES[column]].append(areas[-1] - area(shuffled))
    return Progress(
        float(np.mean(areas)),
        float(np.std(areas) / np.sqrt(len(areas))),
        {name: float(np.mean(values)) for name, values in falls.items() if values},
    )


def folds(
    group: Ints, count: int, rng: np.random.Generator, repeats: int
) -> Iterator[tuple[Ints, Ints]]:
    """Yield train and test rows: whole groups together, `repeats` times with other groups together."""
    for _ in range(repeats):
        of_group = rng.permutation(count) % FOLDS
        for fold in range(FOLDS):
            inside = of_group[group] == fold
            yield np.flatnonzero(~inside), np.flatnonzero(inside)
