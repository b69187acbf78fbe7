# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The clocks of a bag: header stamps of each topic against the time of reception."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from scenario_gen.bags.storage.bag import open_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.doubts import Doubt, Quantity
from scenario_gen.logs.growing import Span

LARGE_COUNT = 200_000
"""Messages above which a window is read alone; a smaller log is read whole, and cut afterwards."""

_RECEPTION_SLACK_S = 10.0
_LATEST_NS = 2**63 - 1
_MAX_CLOCK_DIFFERENCE_S = 0.5  # of two vehicles; latencies differ by less
_MAX_JITTER_S = 0.25  # of the latency; with more, the time of reception tells nothing
_MIN_MESSAGES_COUNT = 5
_SAME_RATE_RATIO = 0.1
_STAMP_UNITS_S = (1e-3, 1e-6, 1e-9)


@dataclass
class TopicClock:
    """Stamps [ns] of a topic's headers, and of the reception of its messages.

    Attributes:
        topic: its name.
        vehicle: its owner.
        stride: every how many messages the stamps are kept.
        header: stamps of some messages.
        received: stamps of the same messages.
        has_stamps: whether all headers have stamps.
    """

    topic: str
    vehicle: str
    stride: int = 1
    header: list[int] = field(default_factory=list)
    received: list[int] = field(default_factory=list)
    has_stamps: bool = True

    def add(self, number: int, header_ns: int, received_ns: int) -> None:
        """Add a message by its number."""
        self.has_stamps = self.has_stamps and header_ns != 0
        if number % self.stride == 0:
            self.header.append(header_ns)
            self.received.append(received_ns)

    @property
    def rate(self) -> float:
        """How fast the headers' clock runs against the recorder's; NaN if unknown."""
        header = self.header[-1] - self.header[0] if self.header else 0
        received = self.received[-1] - self.received[0] if self.received else 0
        if len(self.header) < _MIN_MESSAGES_COUNT or received <= 0 or not self.has_stamps:
            return np.nan
        return header / received

    def ahead_s(self) -> float:
        """Return how far the headers are ahead of the reception [s]; NaN if it varies."""
        if len(self.header) < _MIN_MESSAGES_COUNT or not self.has_stamps:
            return np.nan
        ahead = np.array(self.header) - np.array(self.received)
        low, median, high = np.percentile(ahead * 1e-9, [10.0, 50.0, 90.0]).tolist()
        return median if high - low < _MAX_JITTER_S else np.nan


def stamp_factor(clocks: Sequence[TopicClock]) -> float:
    """Return the factor to seconds of headers that have another unit; 1.0 if they have not."""
    rates = np.array([clock.rate for clock in clocks])
    if not len(rates) or not np.isfinite(rates).all():
        return 1.0
    for factor in _STAMP_UNITS_S:
        if (np.abs(rates * factor - 1.0) < _SAME_RATE_RATIO).all():
            return factor
    return 1.0


def clock_doubt(clocks: Sequence[TopicClock]) -> Doubt | None:
    """Return a doubt if the clocks of two vehicles differ; None if they do not, or are unknown."""
    ahead: dict[str, float] = {}
    for clock in clocks:
        seconds = clock.ahead_s()
        if np.isfinite(seconds):
            ahead.setdefault(clock.vehicle, seconds)
    if len(ahead) < 2:
        return None
    difference = max(ahead.values()) - min(ahead.values())
    if difference < _MAX_CLOCK_DIFFERENCE_S:
        return None
    listed = ", ".join(f"{name} {seconds:+.2f} s" for name, seconds in ahead.items())
    return Doubt(
        "",
        0.0,
        0.0,
        Quantity.CLOCK,
        difference,
        "s",
        f"the header clocks differ by {difference:.1f} s (header minus reception: {listed})",
        "--set log.stamps=received uses the recorder's clock",
    )


def check_rates(label: str, clocks: Sequence[TopicClock], config: LogConfig) -> None:
    """Check that a window of the time of reception is one of the headers' time.

    Raises:
        InputError: the clocks of the headers are slower or faster.
    """
    if config.stamps == "header" and any(
        abs(clock.rate - 1.0) > _SAME_RATE_RATIO for clock in clocks
    ):
        raise InputError(
            f"{label}: the clock of the headers is not as fast as that of the recorder, so a "
            "window of a large bag cannot be read by the headers: --set log.stamps=received uses "
            "the recorder's clock"
        )


def received_window(
    paths: Sequence[Path], is_used: Callable[[str, str], bool], config: LogConfig
) -> Span:
    """Return the stamps of reception [ns] between which a large log is read.

    Headers are cut afterwards: their stamps may differ by `_RECEPTION_SLACK_S`.

    Raises:
        InputError: a bag is damaged.
    """
    first_ns = []
    for path in paths:
        with open_bag(
            path, BagConfig(most_bytes=config.size_limit << 20), "log.size_limit"
        ) as bag:
            first_ns += [message.stamp_ns for message in islice(bag.messages(is_used), 1)]
    start_ns = min(first_ns, default=0)
    begin_ns = start_ns + round(1e9 * (config.start - _RECEPTION_SLACK_S))
    if not config.end:
        return begin_ns, _LATEST_NS
    return begin_ns, start_ns + round(1e9 * (config.end + _RECEPTION_SLACK_S))
