# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A library of primitives shared by many encounters, by the hierarchy of the HDP."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
import json
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.base.documents import check_shape, COUNT, NUMBER, read_json
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.method.segmentation.descriptions import describe_accelerations, describe_segments
from scenario_gen.method.segmentation.estimates import whitened
from scenario_gen.method.segmentation.features import driving_features
from scenario_gen.method.segmentation.hdp_hmm.smoother import log_densities, smooth
from scenario_gen.method.segmentation.posterior import in_order
from scenario_gen.method.segmentation.segmenter import (
    cut,
    DEFAULT,
    on_trends,
    relabel,
    SegmentationConfig,
)
from scenario_gen.method.segmentation.series import segment_series
from scenario_gen.numerics import Floats, frozen, frozen_ints, Ints
from scenario_gen.types import Encounter, Segmentation

FORMAT = "scenario_gen primitive library 1"
_ROW = {
    "type": "array",
    "minItems": 1,
    "items": {**NUMBER, "minimum": -1e9, "maximum": 1e9},
}
_SHARES = {
    "type": "array",
    "minItems": 1,
    "items": {"type": "number", "minimum": 0.0, "maximum": 1.0},
}
SCHEMA: dict[str, Any] = {
    "type": "object",
    "properties": {
        "format": {"const": FORMAT},
        "vehicles": {**COUNT, "minimum": 2, "maximum": 64},
        "means": {"type": "array", "minItems": 1, "maxItems": 1000, "items": _ROW},
        "covariances": {"type": "array", "items": {"type": "array", "items": _ROW}},
        "transition": {"type": "array", "items": _SHARES},
        "initial": _SHARES,
        "segments": {"type": "array", "items": COUNT},
        "seconds": _ROW,
        "weight": {"type": "number", "exclusiveMinimum": 0.0, "maximum": 1.0},
        "windows": {
            "type": "array",
            "minItems": 4,
            "maxItems": 4,
            "items": {"type": "number", "minimum": 0.0, "maximum": 3600.0},
        },
        "descriptions": {"type": "array", "items": {"type": "string", "maxLength": 10_000}},
    },
}
SCHEMA["required"] = list(SCHEMA["properties"])
"""JSON Schema of the file that `save` writes; `load` also checks shapes and values."""


@dataclass(frozen=True, eq=False)
class PrimitiveLibrary:
    """K primitives of encounters of N vehicles.

    Attributes:
        vehicles: N; their order matters.
        means: (K, 3N) longitudinal and lateral acceleration [m/s²], and moving (0 to 1), vehicle
            by vehicle.
        covariances: (K, 3N, 3N).
        transition: (K, K) probability of the next sample's primitive.
        initial: (K,) probability of being the first.
        segments: (K,) number of segments.
        seconds: (K,) mean duration of a segment.
        weight: of a sample.
        windows: (4,) windows [s] and noises [m/s²] of the features, see `driving_features`.
        descriptions: K sentences.
    """

    vehicles: int
    means: Floats
    covariances: Floats
    transition: Floats
    initial: Floats
    segments: Ints
    seconds: Floats
    weight: float
    windows: Floats
    descriptions: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("means", "covariances", "transition", "initial", "seconds", "windows"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "segments", frozen_ints(self.segments))

    def features(self, encounter: Encounter) -> Floats:
        """Return the features (T, 3N) of an encounter, with the windows of this library.

        Raises:
            InputError: the encounter has another number of vehicles.
        """
        count = len(encounter.vehicles)
        if count != self.vehicles:
            raise InputError(
                f"encounter {encounter.name!r} has {count} vehicles; the primitive library is for "
                f"{self.vehicles}"
            )
        return driving_features(encounter, *(float(w) for w in self.windows))[0]

    def save(self, path: Path) -> None:
        """Write the library as JSON."""
        values: dict[str, Any] = {"format": FORMAT}
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            values[name] = value.tolist() if isinstance(value, np.ndarray) else value
        path.write_text(json.dumps(values, indent=1, ensure_ascii=False), encoding="utf-8")

    @classmethod
    def load(cls, path: Path) -> "PrimitiveLibrary":
        """Read a library that `save` wrote.

        Raises:
            InputError: the file cannot be read or is no such library.
        """
        problem = f"{path} is not a primitive library"
        values = read_json(path, SCHEMA, problem)
        k, width = len(values["means"]), 3 * values["vehicles"]
        shapes = {
            "means": (k, width),
            "covariances": (k, width, width),
            "transition": (k, k),
            **dict.fromkeys(("initial", "segments", "seconds", "descriptions"), (k,)),
        }
        for name, shape in shapes.items():
            check_shape(values[name], shape, f"{problem}: {name}")
        for name, part in (("transition", "row"), ("initial", "list")):
            sums = np.sum(values[name], axis=-1)
            if (np.abs(sums - 1.0) > 1e-6).any():
                raise InputError(
                    f"{problem}: {name} holds probabilities; each {part} must sum to 1, not "
                    f"{np.ravel(sums)[0]:g}"
                )
        remedy = "each must be symmetric and positive definite"
        with guarded(f"{problem}: covariances", remedy=remedy):
            covariances = np.array(values["covariances"])
            for covariance in covariances:
                np.linalg.cholesky(covariance)
        if not np.allclose(covariances, covariances.swapaxes(1, 2)):
            raise InputError(f"{problem}: covariances must be symmetric")
        fields = {name: values[name] for name in cls.__dataclass_fields__}
        return cls(**fields | {"descriptions": tuple(values["descriptions"])})


@dataclass(frozen=True, eq=False)
class Assignment:
    """An encounter's segmentation, and the library's primitive (K + 1,) of each segment."""

    segmentation: Segmentation
    primitives: Ints


def build_library(
    encounters: Sequence[Encounter], config: SegmentationConfig = DEFAULT, seed: int = 0
) -> tuple[PrimitiveLibrary, tuple[Assignment, ...]]:
    """Segment many encounters together, so that they share their primitives.

    Args:
        encounters: all with the same number of vehicles and the same dt.
        config: as for one encounter; `max_rate` holds for each.
        seed: same seed, same answer.

    Raises:
        InputError: no encounter, or they differ in number of vehicles or dt.
    """
    kinds = {(len(e.vehicles), e.dt_ns) for e in encounters}
    if len(kinds) != 1:
        raise InputError(
            "a primitive library needs encounters with one number of vehicles and one sampling "
            "period, at least one"
        )
    windows = (config.speed_window, config.turn_window, config.speed_noise, config.turn_noise)
    parts = [driving_features(encounter, *windows) for encounter in encounters]
    x, blur = np.vstack([features for features, _ in parts]), parts[0][1]
    ends = tuple(np.cumsum([len(features) for features, _ in parts]).tolist())
    posterior = segment_series(x, config.sampler, seed, ends=ends, blur=blur)
    labels = posterior.labels.copy()
    bounds = list(pairwise((0, *ends)))
    for encounter, (start, stop) in zip(encounters, bounds, strict=True):
        part = posterior.part(start, stop)
        points = on_trends(encounter, part, cut(part, config, encounter.dt), config)
        labels[start:stop] = relabel(posterior.labels[start:stop], points, fresh=False)
    labels = in_order(labels)
    weight, dt = config.sampler.weight or 1.0, encounters[0].dt
    library = PrimitiveLibrary(
        vehicles=len(encounters[0].vehicles),
        weight=weight,
        windows=np.array(windows),
        **_statistics(x, labels, ends, blur, dt),
    )
    r_hat = float(posterior.r_hat.max())
    assignments = []
    for encounter, (start, stop) in zip(encounters, bounds, strict=True):
        probability = posterior.probability[start:stop]
        assignments.append(_assignment(encounter, labels[start:stop], probability, r_hat))
    return library, tuple(assignments)


def _assignment(
    encounter: Encounter, labels: Ints, probability: Floats, r_hat: float = float("nan")
) -> Assignment:
    """Return the assignment of an encounter whose samples have these primitives (T,)."""
    points = np.flatnonzero(np.diff(labels)) + 1
    descriptions = describe_segments(encounter, points)
    segmentation = Segmentation(in_order(labels), points, probability, descriptions, r_hat)
    return Assignment(segmentation, frozen_ints(labels[[0, *points]]))


def _statistics(
    x: Floats, labels: Ints, ends: tuple[int, ...], blur: Floats, dt: float
) -> dict[str, Any]:
    """Return every primitive's statistics from samples x (T, D) with labels (T,), by field."""
    k, d = int(labels.max()) + 1, x.shape[1]
    pairs = np.ones((k, k)) * 0.1 / k
    initial = np.full(k, 0.1)
    lengths: list[list[float]] = [[] for _ in range(k)]
    for start, stop in pairwise((0, *ends)):
        part = labels[start:stop]
        np.add.at(pairs, (part[:-1], part[1:]), 1.0)
        initial[part[0]] += 1.0
        edges = [0, *(np.flatnonzero(np.diff(part)) + 1), len(part)]
        for a, b in pairwise(edges):
            lengths[part[a]].append((b - a) * dt)
    means = np.array([x[labels == j].mean(axis=0) for j in range(k)])
    within = x - means[labels]
    within -= within.mean(axis=0)
    error = np.diag(np.square(blur))
    pooled = (within.T @ within) / (len(x) - 1) + error
    covariances = np.empty((k, d, d))
    prior = 3.0 * d  # samples that the pooled covariance is worth
    for j in range(k):
        residual = x[labels == j] - means[j]
        scatter = prior * pooled + residual.T @ residual + len(residual) * error
        covariances[j] = scatter / (prior + len(residual))
    return {
        "means": means,
        "covariances": covariances,
        "transition": pairs / pairs.sum(axis=1, keepdims=True),
        "initial": initial / initial.sum(),
        "segments": np.array([len(durations) for durations in lengths]),
        "seconds": np.array([np.mean(durations) for durations in lengths]),
        "descriptions": tuple(describe_accelerations(mean) for mean in means),
    }


def assign(
    encounter: Encounter, library: PrimitiveLibrary, config: SegmentationConfig = DEFAULT
) -> Assignment:
    """Cut a new encounter into the primitives of a library by forward-backward smoothing.

    Raises:
        InputError: the encounter has another number of vehicles than the library.
    """
    x = library.features(encounter)
    smoothed, changed = _smooth(library, x)
    labels = smoothed.argmax(axis=1).astype(np.int64)
    points = np.flatnonzero(np.diff(labels)) + 1
    gap = max(2, round(config.min_segment / encounter.dt))
    while len(points) and np.diff([0, *points, len(x)]).min() < gap:
        shortest = int(np.argmin(np.diff([0, *points, len(x)])))
        points = np.delete(points, min(shortest, len(points) - 1))
    return _assignment(encounter, relabel(labels, points, fresh=False), changed)


def _smooth(library: PrimitiveLibrary, x: Floats) -> tuple[Floats, Floats]:
    """Return probabilities of each primitive (T, K), and of a change (T,), in x (T, D)."""
    density = np.empty((len(x), len(library.means)))
    smoothed, changed = np.empty_like(density), np.empty(len(x))
    states = zip(library.means, library.covariances, strict=True)
    coef = np.stack([whitened(mean[:, None], covariance) for mean, covariance in states])
    rows = np.column_stack([np.ones(len(x)), np.nan_to_num(x)])
    log_densities(rows, np.isnan(x), coef, library.weight, 0.0, density)
    smooth(density, library.transition, library.initial, np.array([len(x)]), smoothed, changed)
    return smoothed, changed
