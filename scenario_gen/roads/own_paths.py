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

"""The template on its own ground: cleaned, and pulled apart where the record has vehicles overlap."""

from dataclasses import replace

from scenario_gen.encounter import Encounter
from scenario_gen.roads.separation import separate, Separation
from scenario_gen.roads.tracks import clean_tracks

OWN_CLEARANCE = 0.5  # metres between footprints
OWN_MAX_SHIFT = 3.0


def own_paths(encounter: Encounter) -> Separation:
    """Clean the template's paths and separate its vehicles.

    Raises:
        RefusedError: they overlap so far that shifts of up to 3 m do not separate them.
    """
    tracks = clean_tracks(encounter)
    separation = separate(tracks, OWN_CLEARANCE, OWN_MAX_SHIFT)
    notes = [
        f"vehicle {track.vehicle.id}: the record was smoothed by up to {track.deviation:.2f} m into a path that can be driven"
        for track in tracks
        if track.deviation > 1.0
    ]
    return replace(separation, notes=(*notes, *separation.notes))
