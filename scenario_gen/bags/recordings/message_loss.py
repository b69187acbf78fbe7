# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a recorder did not record, by topic.

- If a topic has one publisher, by the numbers of its messages: gaps were lost; messages before the
  first one were published before the recording began, which does not count for streams (/tf).
- If a topic has several publishers, by the count of DDS.
- Scenarios, by their entries on `scenarios/info`.
- If a topic keeps its newest message only (a map, a route), overwritten messages do not count.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import monotonic

from msg_conventions.scenario_info import INFO
from msg_conventions.scenarios import digest
from scenario_gen.bags.recordings.request_tracker import RequestTracker
from scenario_gen.types import Quality

BEGAN_LATE = "began late"

_SETTLING_S = 5.0  # without messages, after which the missing scenarios of a request are lost


@dataclass(frozen=True)
class TopicLoss:
    """Messages of one topic that were not recorded.

    Attributes:
        lost: number of messages lost while recording.
        before: number of messages published before the recording began.
        requests: a sentence for each incomplete request.
        info_is_late: whether entries of these requests were published before the recording.
    """

    lost: int = 0
    before: int = 0
    requests: tuple[str, ...] = ()
    info_is_late: bool = False

    def __str__(self) -> str:
        numbers = [f"{self.lost} lost"] if self.lost else []
        if self.before:
            numbers.append(f"{self.before} not recorded: {BEGAN_LATE}")
        parts = [", ".join(numbers)] if numbers else []
        parts += self.requests
        if self.info_is_late and parts:
            parts.append(f"the recording {BEGAN_LATE}")
        return "; ".join(parts)

    @property
    def remedy(self) -> str:
        """What the user can do about it."""
        if not self.lost and (self.before or self.info_is_late):
            return "begin to record before the messages are published"
        return (
            "pace the publisher by its acknowledgements, or give the recorder a faster disk and "
            "processor"
        )


@dataclass
class _Numbers:
    """The numbers of one topic's messages.

    Attributes:
        last: number of the last message.
        before: number of messages before the first recorded one.
        lost: number of messages in gaps.
        lost_by_dds: number of lost messages as DDS counts them.
        are_mixed: whether several publishers number the messages.
    """

    last: int = 0
    before: int = 0
    lost: int = 0
    lost_by_dds: int = 0
    are_mixed: bool = False

    def add(self, number: int) -> bool:
        """Add the next number; return whether there is a gap before it."""
        gap = number - self.last - 1
        if self.last == 0:
            self.before = gap
        elif gap > 0:  # a smaller number: its publisher restarted, or repeats it
            self.lost += gap
        self.last = number
        return gap > 0

    def loss(self) -> TopicLoss:
        """Return the loss so far."""
        if self.are_mixed:
            return TopicLoss(self.lost_by_dds)
        return TopicLoss(max(self.lost, self.lost_by_dds), self.before)


class MessageLoss:
    """Counts what one recording lacks."""

    def __init__(self, publisher_count: Callable[[str], int]) -> None:
        """Begin; `publisher_count` returns the number of publishers of a topic."""
        self._publisher_count = publisher_count
        self._numbers: dict[str, _Numbers] = {}
        self._requests: dict[str, RequestTracker] = {}  # by namespace
        self._newest_only: set[str] = set()
        self._streams: set[str] = set()
        self._last_arrival_s = monotonic()

    def begin(self, topic: str, quality: Quality) -> None:
        """Begin with a topic; the quality of its publishers tells whether they repeat messages."""
        if not quality.transient_local:
            self._streams.add(topic)
        elif quality.depth == 1:
            self._newest_only.add(topic)

    def add(self, topic: str, data: bytes, number: int | None) -> None:
        """Add a recorded message, with the number that its publisher gave it."""
        if topic in self._newest_only:
            return
        numbers = self._numbers.setdefault(topic, _Numbers())
        if number and numbers.add(number) and self._publisher_count(topic) > 1:
            numbers.are_mixed = True
        if topic in self._streams:
            numbers.before = 0
        if topic.endswith(("/scenarios", f"/{INFO}")):
            self._last_arrival_s = monotonic()
            namespace = topic.removesuffix("/info").removesuffix("scenarios")
            requests = self._requests.setdefault(namespace, RequestTracker())
            if topic.endswith("/info"):
                requests.add_message(data)
            else:
                requests.add_scenario(digest(data))

    def count_by_dds(self, topic: str, total: int) -> None:
        """Set the number of lost messages of a topic, as DDS counts them."""
        if topic not in self._newest_only:
            self._numbers.setdefault(topic, _Numbers()).lost_by_dds = total

    def summary(self, *, ended: bool = False) -> Mapping[str, TopicLoss]:
        """Return losses by topic; at the end of the recording, also of open requests."""
        losses = {topic: numbers.loss() for topic, numbers in self._numbers.items()}
        is_settled = ended or monotonic() - self._last_arrival_s > _SETTLING_S
        for namespace, requests in self._requests.items():
            requests.forget_complete()
            if not is_settled:
                continue
            topic = f"{namespace}scenarios"
            sentences = tuple(
                request.sentence() for request in requests.incomplete(closed=not ended)
            )
            numbers = losses.get(topic, TopicLoss())
            info_is_late = losses.get(f"{topic}/info", TopicLoss()).before > 0
            losses[topic] = TopicLoss(numbers.lost, numbers.before, sentences, info_is_late)
        return {topic: loss for topic, loss in losses.items() if str(loss)}
