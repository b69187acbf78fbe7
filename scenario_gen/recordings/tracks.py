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

"""One encounter as bytes, both ways, for whoever keeps very many of them: the same that a bag holds on `tracks`."""

from dataclasses import replace

from msg_conventions.tracks import decode_tracks, encode_tracks
from scenario_gen.types.encounter import Encounter


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
