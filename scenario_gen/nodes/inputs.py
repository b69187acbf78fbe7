# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Latched inputs that belong together: complete once all bear the same stamp."""

from collections.abc import Iterable

from msg_conventions.cdr import CdrReader
from msg_conventions.tracks import decode_tracks
from scenario_gen.encounter import Encounter
from scenario_gen.errors import InputError
from scenario_gen.size import MOST_SAMPLES, refuse_too_large

MOST_BYTES = 200 * MOST_SAMPLES  # of tracks: a sample of a vehicle takes 176 at most, and an instant 36


def stamp_of(data: bytes, topic: str) -> int:
    """Return the header stamp [ns] of a CDR message that begins with a header."""
    return CdrReader(data, topic).stamp()


def take_tracks(data: bytes) -> Encounter:
    """Return the encounter of a `tracks` message that a node can work on; what is too large is refused before it is read.

    Raises:
        InputError: it is too large, damaged, or no encounter.
        RefusedError: it is too large, or its vehicles are not where they can be.
    """
    if len(data) > MOST_BYTES:
        raise InputError(
            f"tracks: the message has {len(data)} bytes, at most {MOST_BYTES} are read; cut the encounter, or resample it "
            "(10 Hz is usual)"
        )
    encounter = decode_tracks(data)
    refuse_too_large(encounter)
    return encounter


class Inputs:
    """The newest message of each topic.

    Args:
        paired: topics that must bear the same stamp.
        unpaired: topics whose newest message counts, whatever its stamp.
    """

    def __init__(self, paired: Iterable[str], unpaired: Iterable[str] = ()) -> None:
        self._paired = set(paired)
        self._unpaired = set(unpaired)
        self._newest: dict[str, bytes] = {}

    def expect(self, topics: Iterable[str]) -> None:
        """Add topics to the paired ones, e.g. the routes of the vehicles of the tracks."""
        self._paired |= set(topics)

    def forget(self, topics: Iterable[str]) -> None:
        """Remove topics and what they said."""
        for topic in topics:
            self._paired.discard(topic)
            self._newest.pop(topic, None)

    def clear(self) -> None:
        """Forget what was said."""
        self._newest.clear()

    def put(self, topic: str, data: bytes) -> None:
        """Take a message in."""
        self._newest[topic] = data

    def get(self, topic: str) -> bytes | None:
        """Return the newest message of a topic."""
        return self._newest.get(topic)

    def missing(self) -> list[str]:
        """Return the topics from which nothing came yet, or nothing of the newest template's stamp."""
        silent = [topic for topic in sorted(self._paired | self._unpaired) if topic not in self._newest]
        stamps = {topic: stamp_of(self._newest[topic], topic) for topic in self._paired if topic in self._newest}
        newest = stamps.get("tracks", max(stamps.values(), default=0))
        return silent + sorted(topic for topic, stamp in stamps.items() if stamp != newest)

    def complete(self) -> dict[str, bytes] | None:
        """Return all messages if none is missing and the paired ones bear one stamp."""
        return None if self.missing() else dict(self._newest)
