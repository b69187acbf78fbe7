# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Samples as they arrive -> changepoints as they are confirmed, for the vehicles present."""

from collections import deque
from collections.abc import Sequence

import numpy as np

from scenario_gen.method.segmentation.online import Changepoint, OnlineConfig, OnlineSegmenter
from scenario_gen.method.segmentation.trends import course
from scenario_gen.types import LiveChangepoints, Sample


class LiveSegmenter:
    """An `OnlineSegmenter` for vehicles that come and go; it restarts at each such change."""

    def __init__(self, dt_ns: int, config: OnlineConfig = OnlineConfig()) -> None:
        """Start without samples; they are `dt_ns` nanoseconds apart."""
        self._dt_ns = dt_ns
        self._config = config
        self._past: deque[Sample] = deque(maxlen=round(config.window * 1e9 / dt_ns))
        self._online: OnlineSegmenter | None = None
        self._start_ns = 0

    def push(self, sample: Sample) -> LiveChangepoints | None:
        """Add the next sample, and return the changepoints that it confirms, if any."""
        last = self._past[-1] if self._past else None
        if self._online is None or last is None or not self._follows(last, sample):
            self._past.clear()
            self._online = OnlineSegmenter(sample.vehicles, self._dt_ns * 1e-9, self._config)
            self._start_ns = sample.stamp_ns
        self._past.append(sample)
        changepoints = self._online.push(sample.position, sample.speed)
        return self._states(changepoints) if changepoints else None

    def _follows(self, last: Sample, sample: Sample) -> bool:
        return sample.stamp_ns == last.stamp_ns + self._dt_ns and sample.vehicles == last.vehicles

    def _states(self, changepoints: Sequence[Changepoint]) -> LiveChangepoints:
        samples = np.array([changepoint.sample for changepoint in changepoints], dtype=np.int64)
        time_ns = samples * self._dt_ns
        index = (self._start_ns + time_ns - self._past[0].stamp_ns) // self._dt_ns
        position = np.stack([sample.position for sample in self._past], axis=1)
        speed = np.stack([sample.speed for sample in self._past], axis=1)
        vehicles = self._past[-1].vehicles
        rows = zip(position, speed, vehicles, strict=True)
        heading = np.array(
            [course(xy, v, self._dt_ns * 1e-9, of.kind.least_course)[0] for xy, v, of in rows]
        )
        return LiveChangepoints(
            self._start_ns,
            vehicles,
            time_ns,
            position[:, index],
            heading[:, index],
            speed[:, index],
            probability=np.array([changepoint.probability for changepoint in changepoints]),
        )
