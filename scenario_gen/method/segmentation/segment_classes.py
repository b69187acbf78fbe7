# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a finished segment is, as soon as it is finished: like which of the segments before it, and how surely.

Each label is a class of segments with a mean and known spread; a new segment joins a class or begins one, with probabilities
under a Dirichlet process mixture whose earlier assignments stand (Anderson 1991; Wang & Dunson 2011). With a primitive library
the classes are its primitives, and there are no others.
"""

from dataclasses import dataclass

import numpy as np

from scenario_gen.method.segmentation.library import PrimitiveLibrary
from scenario_gen.numerics import Floats, frozen, frozen_ints, Ints

NEW = 1.0  # segments that the chance of a class never seen is worth
WITHIN = (0.25, 0.25, 0.2)  # spread in a class: longitudinal, lateral acceleration [m/s²], moving 0..1
BETWEEN = (1.5, 1.5, 0.5)  # spread of classes
MOST_CLASSES = 64  # kept at a time


@dataclass(frozen=True, eq=False)
class FinishedSegment:
    """A segment between two confirmed changepoints, or the first one.

    Attributes:
        start: its first sample, counted from the first one pushed.
        stop: one past its last.
        features: (3N,) longitudinal and lateral acceleration [m/s²] and moving 0..1, vehicle by vehicle.
        label: the most probable class; classes are numbered in the order in which they were first seen, or as in the library.
        labels: (C,) classes it may be; the last is a new one unless a library is given.
        probability: (C,) of each.
    """

    start: int
    stop: int
    features: Floats
    label: int
    labels: Ints
    probability: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "features", frozen(self.features))
        object.__setattr__(self, "labels", frozen_ints(self.labels))
        object.__setattr__(self, "probability", frozen(self.probability))


class SegmentClasses:
    """The classes seen so far, at most `MOST_CLASSES`: the one not met for the longest time is forgotten first."""

    def __init__(self, vehicles: int, library: PrimitiveLibrary | None = None) -> None:
        """Start with no class of segments of `vehicles` vehicles, or with a library's primitives."""
        size = 3 * vehicles
        self._library = library
        self._within, self._between = (np.tile(np.square(spread), vehicles) for spread in (WITHIN, BETWEEN))
        self._names = np.zeros(0, np.int64)
        self._counts = np.zeros(0)
        self._sums = np.zeros((0, size))
        self._next = 0

    def add(self, start: int, stop: int, features: Floats, variance: Floats) -> FinishedSegment:
        """Say what a segment of samples start .. stop - 1 is, and remember it.

        Args:
            start: its first sample.
            stop: one past its last.
            features: (3N,) see `FinishedSegment`.
            variance: (3N,) of the features' errors.
        """
        if self._library is not None:
            labels = np.arange(len(self._library.means))
            spread = np.array([np.diag(covariance) for covariance in self._library.covariances])
            score = log_normal(features, self._library.means, spread + variance)
            probability = normalised(score + np.log(np.maximum(self._library.segments, 0.5)))
            return FinishedSegment(start, stop, features, int(labels[probability.argmax()]), labels, probability)
        shrunk = self._counts[:, None] / self._within + 1.0 / self._between
        mean, spread = self._sums / self._within / shrunk, 1.0 / shrunk
        mean, spread = np.vstack([mean, np.zeros((1, len(features)))]), np.vstack([spread, self._between[None]])
        score = log_normal(features, mean, spread + self._within + variance)
        probability = normalised(score + np.log(np.append(self._counts, NEW)))
        labels = np.append(self._names, self._next)
        chosen = int(probability.argmax())
        if chosen == len(self._names):
            self._names, self._counts = labels, np.append(self._counts, 0.0)
            self._sums = np.vstack([self._sums, np.zeros((1, len(features)))])
            self._next += 1
        order = np.append(np.delete(np.arange(len(self._names)), chosen), chosen)[-MOST_CLASSES:]  # the last one met last
        share = self._within / (self._within + variance)
        self._sums[chosen] += share * features + (1.0 - share) * mean[chosen]
        self._counts[chosen] += 1.0
        self._names, self._counts, self._sums = self._names[order], self._counts[order], self._sums[order]
        return FinishedSegment(start, stop, features, int(labels[chosen]), labels, probability)


def log_normal(x: Floats, mean: Floats, variance: Floats) -> Floats:
    """(C,) log density of x (D,) under independent normals of mean and variance (C, D), up to a constant."""
    result: Floats = -0.5 * (np.square(x - mean) / variance + np.log(variance)).sum(axis=1)
    return result


def normalised(score: Floats) -> Floats:
    """Exponentials of score (C,), scaled to sum to 1."""
    likelihood: Floats = np.exp(score - score.max())
    share: Floats = likelihood / likelihood.sum()
    return share
