# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Hashes of messages that belong together, by topic ⇄ `road/info` and `fit/info`.

The type is diagnostic_msgs/DiagnosticArray.

Most types have no field for them. Stamp: the template's. QoS: reliable, transient_local, depth 1.
"""

from collections.abc import Mapping
import hashlib
import re

from msg_conventions import lanes
from msg_conventions.diagnostics import decode_diagnostics, encode_diagnostics, Level, Status
from scenario_gen.base.errors import InputError

INFOS = ("road/info", "fit/info")
HASH_DIGITS = 12
TEMPLATE_HASH = "template_hash"
MAP_HASH = "map_hash"


def hash_of(topic: str, data: bytes) -> str:
    """Return the first 12 hexadecimal digits of the SHA-256 of a message's CDR bytes.

    The stamps of a map are excluded, so that equal maps for different templates have one hash.
    """
    if topic == lanes.TOPIC:
        data = data[: len(data) - (len(data) - lanes.TAIL_BYTES) % 4]  # without DDS's padding
    if topic == "map":
        data = _without_stamps(data)
    return hashlib.sha256(data).hexdigest()[:HASH_DIGITS]


def _without_stamps(grid: bytes) -> bytes:
    """Return the bytes of a map without stamp, load time and padding.

    A damaged map gives some of its bytes.

    DDS pads small messages to a multiple of 4 bytes. All other hashed messages end at one, except
    `road/lanes`.
    """
    load_time = 16 + int.from_bytes(grid[12:16], "little")  # after the frame, aligned to 4
    load_time += -load_time % 4
    # After resolution, width and height, aligned to 8 from the end of the encapsulation header.
    origin = load_time + 20
    origin += -(origin - 4) % 8
    cells = origin + 60
    end = cells + int.from_bytes(grid[cells - 4 : cells], "little")
    return grid[:4] + grid[12:load_time] + grid[load_time + 8 : end]


def template_hashes(messages: Mapping[str, bytes]) -> dict[str, str]:
    """Return the hashes of the template (its `tracks`) and the map.

    Diagnostics and `scenarios/info` contain them.
    """
    keys = {"tracks": TEMPLATE_HASH, "map": MAP_HASH}
    return {
        key: hash_of(topic, messages[topic]) for topic, key in keys.items() if topic in messages
    }


def encode_hashes(name: str, messages: Mapping[str, bytes], stamp_ns: int) -> bytes:
    """Return the hashes of messages (by topic) as CDR bytes.

    `name` is the subject of the status.
    """
    hashes = {
        topic: hash_of(topic, data)
        for topic, data in sorted(messages.items())
        if topic not in INFOS
    }
    return encode_diagnostics([Status(name, Level.OK, "these belong together", hashes)], stamp_ns)


def decode_hashes(data: bytes, source: str) -> dict[str, str]:
    """Return the hashes by topic.

    Raises:
        InputError: the message is damaged, or has no hashes.
    """
    _, statuses = decode_diagnostics(data, source)
    hashes = {topic: text for status in statuses for topic, text in status.values.items()}
    if not hashes or not all(
        re.fullmatch(rf"[0-9a-f]{{{HASH_DIGITS}}}", text) for text in hashes.values()
    ):
        raise InputError(
            f"{source}: it must list by topic a hash of {HASH_DIGITS} hexadecimal digits of each "
            "message"
        )
    return hashes
