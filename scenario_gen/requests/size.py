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
"""How large an encounter can be, so that its scenarios are had in minutes and in a few gigabytes."""

from scenario_gen.encounter import Encounter
from scenario_gen.errors import RefusedError

MOST_VEHICLES = 64  # as many as a log is cut into at most
MOST_VEHICLE_SECONDS = 4000.0  # two vehicles for 1,000 s take some two minutes and 1 GB; effort grows faster than the duration


def refuse_too_large(encounter: Encounter) -> None:
    """Refuse an encounter that would take hours, before anything is done with it.

    Raises:
        RefusedError: it is too long for its number of vehicles, or has too many; the message says what would fit.
    """
    count, seconds = len(encounter.vehicles), encounter.duration
    if count > MOST_VEHICLES:
        raise RefusedError(
            f"{encounter.name}: {count} vehicles, {MOST_VEHICLES} are possible; keep fewer with --set "
            f"log.most_vehicles={MOST_VEHICLES}, or name those that matter with --set log.vehicles=ID,ID"
        )
    if count * seconds > MOST_VEHICLE_SECONDS:
        longest, fewer = int(MOST_VEHICLE_SECONDS / count), int(MOST_VEHICLE_SECONDS / seconds)
        instead = f", or keep {fewer} vehicles: --set log.most_vehicles={fewer}" if fewer >= 2 else ""
        raise RefusedError(
            f"{encounter.name}: {count} vehicles for {seconds:.0f} s are {count * seconds:.0f} vehicle seconds, "
            f"{MOST_VEHICLE_SECONDS:.0f} are possible; cut it to {longest} s: --set log.longest={longest}{instead}"
        )
