# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One encounter as bytes and back, for stores of very many of them: the message that a bag holds on `tracks`."""

from dataclasses import replace

from msg_conventions.tracks import decode_tracks, encode_tracks
from scenario_gen.types import Encounter


def tracks_bytes(encounter: Encounter) -> bytes:
    """Return the encounter as CDR bytes; its name and its geodetic origin are not in them."""
    return encode_tracks(encounter)


def tracks_of(data: bytes, name: str, origin: tuple[float, float] | None = None) -> Encounter:
    """Return the encounter that `tracks_bytes` wrote, bit for bit.

    Args:
        data: CDR bytes.
        name: of the encounter.
        origin: latitude and longitude [degrees] of its frame, or None.

    Raises:
        InputError: the bytes are damaged.
    """
    return replace(decode_tracks(data, name), name=name, origin=origin)
