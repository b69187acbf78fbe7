# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Latched inputs that belong together: complete once all bear the same stamp and `road/info` and `fit/info` agree."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from msg_conventions import trajectory
from msg_conventions.cdr import stamp_of
from msg_conventions.fits import decode_fit
from msg_conventions.hashes import decode_hashes, hash_of, INFOS
from msg_conventions.lanes import decode_lanes
from msg_conventions.lanes import TOPIC as LANES
from msg_conventions.paths import decode_path
from msg_conventions.roads import decode_map, decode_poses
from msg_conventions.tracks import decode_tracks
from scenario_gen.base.errors import InputError
from scenario_gen.template import MOST_SAMPLES, refuse_too_large
from scenario_gen.types import Encounter

MOST_BYTES = 200 * MOST_SAMPLES  # of tracks: a sample of a vehicle takes 176 at most, and an instant 36


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


DECODERS: dict[str, Callable[[bytes, str], object]] = {
    "tracks": lambda data, _: take_tracks(data),
    "map": lambda data, what: decode_map(data, name=what),
    "road/entries": decode_poses,
    "road/exits": decode_poses,
    LANES: decode_lanes,
    "changepoints": trajectory.decode,
    "fit": decode_fit,
    "route": decode_path,
    **dict.fromkeys(INFOS, decode_hashes),
}


def refuse_damaged(topic: str, data: bytes) -> None:
    """Read a latched input as it arrives, so that what is damaged is named and does not take the place of what was there.

    Raises:
        InputError, RefusedError: it is damaged, or too large.
    """
    if decode := DECODERS.get("route" if topic.endswith("/route") else topic):
        decode(data, topic)


@dataclass(frozen=True)
class _Message:
    """A message with its stamp and hash; if it is an info, the hashes of those that belong together, by topic."""

    data: bytes
    stamp: int
    hash: str
    together: Mapping[str, str]


class Inputs:
    """The newest message of each topic.

    Args:
        paired: topics that must bear the same stamp.
        unpaired: topics whose newest message counts, whatever its stamp.
        if_named: topics that count only where an info names them, and are waited for there.
    """

    def __init__(self, paired: Iterable[str], unpaired: Iterable[str] = (), if_named: Iterable[str] = ()) -> None:
        self._paired = set(paired)
        self._unpaired = set(unpaired)
        self._if_named = set(if_named)
        self._newest: dict[str, _Message] = {}

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
        """Take a message in.

        Raises:
            InputError: it is damaged; what was there stays.
        """
        together = decode_hashes(data, topic) if topic in INFOS else {}
        self._newest[topic] = _Message(data, stamp_of(data, topic), hash_of(topic, data), together)

    def get(self, topic: str) -> bytes | None:
        """Return the newest message of a topic."""
        message = self._newest.get(topic)
        return message.data if message else None

    def named(self, info: str, topic: str) -> bool:
        """Say whether an info names a message of the topic as one that belongs to the others."""
        return info in self._newest and topic in self._newest[info].together

    def replaced(self, messages: Mapping[str, bytes]) -> bool:
        """Say whether one of these messages is no longer the newest of its topic."""
        return any(self.get(topic) != data for topic, data in messages.items())

    def missing(self) -> list[str]:
        """Return the topics from which nothing came yet, or nothing that belongs to the newest template and road."""
        silent = [topic for topic in sorted(self._paired | self._unpaired) if topic not in self._newest]
        held = dict(self._newest)
        stamps = {topic: held[topic].stamp for topic in self._paired if topic in held}
        newest = stamps.get("tracks", max(stamps.values(), default=0))
        old = sorted(topic for topic, stamp in stamps.items() if stamp != newest)
        others = [
            f"{info} of this {topic}"
            for info in INFOS
            for topic, named in (held[info].together.items() if info in held else ())
            if (topic in held and held[topic].hash != named) or (topic in self._if_named and topic not in held)
        ]
        if not any(info in held for info in INFOS):  # it may name them: what is done without would be done again
            others += [f"road/info of this {topic}" for topic in sorted(self._if_named & set(held))]
        return silent + old + others

    def complete(self) -> dict[str, bytes] | None:
        """Return all messages if none is missing and all belong together."""
        if self.missing():
            return None
        return {
            topic: message.data
            for topic, message in self._newest.items()
            if topic not in self._if_named or any(self.named(info, topic) for info in INFOS)
        }
