# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Hashes of messages, by which a document names those that it belongs to (documents.py).

Equal stamps alone do not show it: a second map, segmentation or reading of the log has the stamp
of the first.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from msg_conventions.documents import decode_document, short_hash

LANES, PLAN = "road/lanes", "fit/info"
DOCUMENTS = (LANES, PLAN)
TEMPLATE_HASH = "template_hash"
MAP_HASH = "map_hash"


@dataclass(frozen=True)
class Head:
    """What every document has: its stamp [ns], and the hashes of its inputs by topic."""

    stamp: int
    inputs: Mapping[str, str]


def head_of(data: bytes, source: str) -> Head:
    """Return the head of a document.

    Raises:
        InputError: it is damaged.
    """
    return decode_document(Head, data, source)


def hash_of(topic: str, data: bytes) -> str:
    """Return the first 12 hexadecimal digits of the SHA-256 of a message's CDR bytes.

    The stamps of a map are excluded, so that equal maps for different templates have one hash.
    DDS's padding is excluded; it adds up to 3 bytes to a map or a document.
    """
    if topic in DOCUMENTS:
        data = data[: 8 + int.from_bytes(data[4:8], "little")]
    if topic == "map":
        data = _without_stamps(data)
    return short_hash(data)


def _without_stamps(grid: bytes) -> bytes:
    """Return the bytes of a map without stamp, load time and padding.

    A damaged map gives some of its bytes.
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

    Diagnostics contain them.
    """
    keys = {"tracks": TEMPLATE_HASH, "map": MAP_HASH}
    return {
        key: hash_of(topic, messages[topic]) for topic, key in keys.items() if topic in messages
    }
