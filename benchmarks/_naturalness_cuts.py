# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounters cut at random from the full recordings: files, vehicles and seconds.

`_naturalness_cuts.json` lists them, so that every version is measured on the same rows of the same
files. The list was drawn once (seed 2016): windows of 8 to 30 s of encounters in each recording,
with all vehicles or two of them, without overlap. Its last third is held out.
"""

from dataclasses import dataclass
import json
from pathlib import Path

from scenario_gen.logs import LogConfig, read_log
from scenario_gen.types.encounter import Encounter

TABLE = Path(__file__).with_suffix(".json")
MAPS = {"lanker-2_13": "USA_Lanker-2_13_T-1", "peach-4_2": "USA_Peach-4_2_T-1"}
"""Recordings with a map."""


@dataclass(frozen=True)
class Cut:
    """Some vehicles of a recording during some seconds from its first stamp; `end` 0: all."""

    name: str
    files: tuple[str, ...]
    vehicles: tuple[str, ...] = ()
    start: float = 0.0
    end: float = 0.0
    map: str = ""

    def read(self, data: Path) -> Encounter:
        """Return the longest encounter of the cut.

        Raises:
            InputError: the file cannot be read, or has no encounter.
        """
        names = ",".join(self.vehicles)
        config = LogConfig(vehicles=names, start=self.start, end=self.end, whole=True)
        encounters = read_log(self._paths(data), config).encounters
        return max(encounters, key=lambda encounter: encounter.duration)

    def _paths(self, data: Path) -> list[Path]:
        return [data / "trajectories" / file for file in self.files]

    def exists(self, data: Path) -> bool:
        """Whether all files exist."""
        return all(path.is_file() for path in self._paths(data))


def cuts() -> tuple[list[Cut], list[Cut]]:
    """Return the cuts for development, and the held-out cuts."""
    known = [
        Cut(**row | {"files": tuple(row["files"]), "vehicles": tuple(row["vehicles"])})
        for row in json.loads(TABLE.read_text())
    ]
    shown = len(known) - len(known) // 3
    return known[:shown], known[shown:]


def chosen_cuts(data: Path, *, held_out: bool) -> list[Cut]:
    """Return the cuts with existing files: the held-out ones, or all others and those by people."""
    shown, hidden = cuts()
    chosen = hidden if held_out else [*shown, *_cut_by_people(data)]
    return [cut for cut in chosen if cut.exists(data)]


def _cut_by_people(data: Path) -> list[Cut]:
    """Return the encounters beside the recordings."""
    found = []
    for path in sorted((data / "trajectories").glob("*/encounter_*.csv")):
        place = next((name for key, name in MAPS.items() if key in path.stem.lower()), "")
        file = str(path.relative_to(data / "trajectories"))
        found.append(Cut(path.stem.removeprefix("encounter_")[:32], (file,), map=place))
    return found
