# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Hashes of messages ⇄ `road/info` and `fit/info` (diagnostic_msgs/DiagnosticArray): which messages belong together, by topic.

Most types have no field for it, and frames must stay those that tf knows. Stamp: the template's.
QoS: reliable, transient_local, depth 1.
"""

from collections.abc import Mapping
import hashlib
import re

from msg_conventions import lanes
from msg_conventions.diagnostics import decode_diagnostics, encode_diagnostics, Level, Status
from scenario_gen.base.errors import InputError

INFOS = ("road/info", "fit/info")
DIGITS = 12
TEMPLATE_HASH, MAP_HASH = "template_hash", "map_hash"


def hash_of(topic: str, data: bytes) -> str:
    """Return the first 12 hexadecimal digits of the SHA-256 of a message's CDR bytes; of a map's without its two stamps.

    So the same geometry has the same hash, whatever its template.
    """
    if topic == lanes.TOPIC:
        data = data[: len(data) - (len(data) - lanes.TAIL) % 4]  # without the padding of DDS
    return hashlib.sha256(_timeless(data) if topic == "map" else data).hexdigest()[:DIGITS]


def _timeless(grid: bytes) -> bytes:
    """Return the bytes of a map without stamp, load time, and the bytes behind its cells; of a damaged one, some of its bytes.

    DDS fills small messages up to a multiple of 4 bytes. All others that are named by a hash end at one, but for `road/lanes`.
    """
    load_time = 16 + int.from_bytes(grid[12:16], "little")  # behind the frame, at a multiple of 4
    load_time += -load_time % 4
    origin = (
        load_time + 20
    )  # behind resolution, width and height, at a multiple of 8 from the encapsulation on
    origin += -(origin - 4) % 8
    cells = origin + 60
    end = cells + int.from_bytes(grid[cells - 4 : cells], "little")
    return grid[:4] + grid[12:load_time] + grid[load_time + 8 : end]


def template_hashes(messages: Mapping[str, bytes]) -> dict[str, str]:
    """Return the key-values that name the template (its `tracks`) and the map in diagnostics and `scenarios/info`."""
    keys = {"tracks": TEMPLATE_HASH, "map": MAP_HASH}
    return {
        key: hash_of(topic, messages[topic]) for topic, key in keys.items() if topic in messages
    }


def encode_hashes(name: str, messages: Mapping[str, bytes], stamp_ns: int) -> bytes:
    """Return as CDR bytes that these messages (by topic) belong together; `name` names their subject."""
    hashes = {
        topic: hash_of(topic, data)
        for topic, data in sorted(messages.items())
        if topic not in INFOS
    }
    return encode_diagnostics([Status(name, Level.OK, "these belong together", hashes)], stamp_ns)


def decode_hashes(data: bytes, what: str) -> dict[str, str]:
    """Return the hashes by topic.

    Raises:
        InputError: the message is damaged, or holds no hashes.
    """
    _, statuses = decode_diagnostics(data, what)
    hashes = {topic: text for status in statuses for topic, text in status.values.items()}
    if not hashes or not all(
        re.fullmatch(rf"[0-9a-f]{{{DIGITS}}}", text) for text in hashes.values()
    ):
        raise InputError(
            f"{what}: it must say by topic which messages belong together, {DIGITS} hexadecimal digits of each"
        )
    return hashes
