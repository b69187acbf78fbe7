# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a recorder did not record, by topic, and how it knows.

- Where a topic has one publisher, by the numbers that it gives its messages: what is left out was lost, what came before the
  first one was published before the recording began. Of a stream (/tf, /clock) only what comes while it is recorded counts.
- Where it has several, by what DDS tells.
- Scenarios, by their entries on `scenarios/info`.
- Of a topic that keeps its newest message only (a map, a route) older ones that were overwritten are not missed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import monotonic

from msg_conventions.scenario_info import INFO
from msg_conventions.scenarios import digest
from scenario_gen.bags.recordings.requests import RequestTracker
from scenario_gen.types import Quality

SETTLED_S = 5.0  # seconds without news after which what a closed request lacks is missing
LATE = "began late"
LOST = (
    "pace the publisher by its acknowledgements, or give the recorder a faster disk and processor"
)
BEGIN = "begin to record before what is to be recorded is published"


@dataclass
class Numbers:
    """The numbers of one topic's messages. `late`: published before the recording; `several`: publishers, whose numbers mix."""

    last: int = 0
    late: int = 0
    lost: int = 0
    by_dds: int = 0  # lost as DDS counts it
    several: bool = False

    def take(self, number: int) -> bool:
        """Take the next message's number; return whether some are left out."""
        left_out = number - self.last - 1
        if self.last == 0:
            self.late = left_out
        elif left_out > 0:  # a smaller number: its publisher was started again, or says it again
            self.lost += left_out
        self.last = number
        return left_out > 0

    def summary(self) -> str:
        """Say what was not recorded; "" if all was."""
        lost = self.by_dds if self.several else max(self.lost, self.by_dds)
        messages = [f"{lost} lost"] if lost else []
        if self.late and not self.several:
            messages.append(f"{self.late} not recorded: {LATE}")
        return ", ".join(messages)


class Losses:
    """What one recording lacks."""

    def __init__(self, publishers: Callable[[str], int]) -> None:
        """Begin; `publishers` returns how many a topic has."""
        self._publishers = publishers
        self._numbers: dict[str, Numbers] = {}
        self._requests: dict[str, RequestTracker] = {}  # by namespace
        self._of_newest: set[str] = set()
        self._streams: set[str] = set()
        self._news = monotonic()

    def begin(self, topic: str, quality: Quality) -> None:
        """Begin with a topic, whose publishers offer `quality`: it says whether older messages are to be had from them."""
        if not quality.transient_local:
            self._streams.add(topic)
        elif quality.depth == 1:
            self._of_newest.add(topic)

    def take(self, topic: str, data: bytes, number: int | None) -> None:
        """Take a message that was recorded, with its publisher's number for it."""
        if topic in self._of_newest:
            return
        numbers = self._numbers.setdefault(topic, Numbers())
        if number and numbers.take(number) and self._publishers(topic) > 1:
            numbers.several = True
        if topic in self._streams:
            numbers.late = 0
        if topic.endswith(("/scenarios", f"/{INFO}")):
            self._news = monotonic()
            requests = self._requests.setdefault(
                topic.removesuffix("/info").removesuffix("scenarios"), RequestTracker()
            )
            if topic.endswith("/info"):
                requests.add_message(data)
            else:
                requests.add_scenario(digest(data))

    def count_by_dds(self, topic: str, total: int) -> None:
        """Take what DDS says: so many messages of a topic have been lost up to now."""
        if topic not in self._of_newest:
            self._numbers.setdefault(topic, Numbers()).by_dds = total

    def summary(self, *, ended: bool = False) -> Mapping[str, str]:
        """Say by topic what is not recorded; at the end of the recording also of requests that are not closed."""
        messages = {
            topic: text for topic, numbers in self._numbers.items() if (text := numbers.summary())
        }
        for space, requests in self._requests.items():
            requests.settle()
            if ended or monotonic() - self._news > SETTLED_S:
                topic = f"{space}scenarios"
                for request in requests.incomplete(closed=not ended):
                    messages[topic] = "; ".join(
                        filter(None, (messages.get(topic), request.sentence()))
                    )
                if topic in messages and messages.get(f"{topic}/info", "").endswith(LATE):
                    messages[topic] += f"; the recording {LATE}"
        return messages


def remedy(losses: str) -> str:
    """Return what can be done about it."""
    return BEGIN if LATE in losses and " lost" not in losses else LOST
