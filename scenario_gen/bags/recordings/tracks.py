# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""An encounter as bytes, for storing very many: the message of the topic `tracks`."""

from dataclasses import replace

from msg_conventions.tracks import decode_tracks, encode_tracks
from scenario_gen.types import Encounter


def tracks_bytes(encounter: Encounter) -> bytes:
    """Return the encounter as CDR bytes, without its name and geodetic origin."""
    return encode_tracks(encounter)


def tracks_of(data: bytes, name: str, origin: tuple[float, float] | None = None) -> Encounter:
    """Return the encounter of `tracks_bytes`, exactly.

    Args:
        data: CDR bytes.
        name: of the encounter.
        origin: latitude and longitude [degrees] of its frame, or None.

    Raises:
        InputError: the bytes are damaged.
    """
    return replace(decode_tracks(data, name), name=name, origin=origin)
