# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounters cut at random from the full recordings: which files, vehicles and seconds.

The list is kept in `_naturalness_cuts.json`, so that versions which cut logs in another way are measured on the same rows of the
same files. `python -m benchmarks._naturalness_cuts` drew it once (seed 2016): of every recording some of its encounters, without
putting them back; of each a window of 8 to 30 s, its vehicles, or, every other time, two of them. Windows of the same vehicles do
not overlap. Then the list was shuffled; its last third is held out.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
import json
from pathlib import Path
import sys

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, read_log, read_raw

TABLE = Path(__file__).with_suffix(".json")
SEED = 2016
SHORTEST, LONGEST = 8.0, 30.0  # s
RECORDINGS = {
    "cats": (9, tuple(f"cats_av_lane_change/cats_vehicle{n}_full.csv" for n in (1, 2, 3, 4))),
    "openacc": (6, ("openacc_zalazone/openacc_no_ACC_handling_part22_first150s.csv",)),
    "psu": (7, ("psu_2obu/psu_meet_full.csv",)),
    "lanker-2_8": (4, ("ngsim_commonroad/USA_Lanker-2_8_T-1_all_vehicles.csv",)),
    "lanker-2_13": (4, ("ngsim_commonroad/USA_Lanker-2_13_T-1_all_vehicles.csv",)),
    "lanker-2_15": (4, ("ngsim_commonroad/USA_Lanker-2_15_T-1_all_vehicles.csv",)),
    "peach-4_2": (3, ("ngsim_commonroad/USA_Peach-4_2_T-1_all_vehicles.csv",)),
}
"""How many encounters of which files (below `trajectories`)."""
MAPS = {"lanker-2_13": "USA_Lanker-2_13_T-1", "peach-4_2": "USA_Peach-4_2_T-1"}
"""Recordings whose map is there."""


@dataclass(frozen=True)
class Cut:
    """Some vehicles of a recording during some seconds, counted from its first stamp; `end` 0: all of it."""

    name: str
    files: tuple[str, ...]
    vehicles: tuple[str, ...] = ()
    start: float = 0.0
    end: float = 0.0
    map: str = ""

    def config(self) -> LogConfig:
        """How the log is read."""
        return LogConfig(vehicles=",".join(self.vehicles), start=self.start, end=self.end)


def cuts() -> tuple[list[Cut], list[Cut]]:
    """Return the cuts that one may look at, and those that are held out."""
    known = [
        Cut(**row | {"files": tuple(row["files"]), "vehicles": tuple(row["vehicles"])})
        for row in json.loads(TABLE.read_text())
    ]
    kept = len(known) - len(known) // 3
    return known[:kept], known[kept:]


def recorded(data: Path) -> list[Cut]:
    """Return the encounters that lie beside the recordings, cut by people."""
    found = []
    for path in sorted((data / "trajectories").glob("*/encounter_*.csv")):
        place = next((name for key, name in MAPS.items() if key in path.stem.lower()), "")
        found.append(
            Cut(
                path.stem.removeprefix("encounter_")[:32],
                (str(path.relative_to(data / "trajectories")),),
                map=place,
            )
        )
    return found


def draw(data: Path, rng: np.random.Generator) -> Iterator[Cut]:
    """Draw the list."""
    for recording, (wanted, files) in RECORDINGS.items():
        paths = [data / "trajectories" / file for file in files]
        raw = read_raw(paths, LogConfig())
        first = min(int(vehicle.fix_ns.min()) for vehicle in raw.vehicles)
        encounters = read_log(paths).encounters
        taken: list[tuple[str, float, float]] = []
        tries = [int(k) for _ in range(20) for k in rng.permutation(len(encounters))]
        number = 0
        for k in tries:
            encounter = encounters[k]
            length = min(float(rng.uniform(SHORTEST, LONGEST)), encounter.duration)
            offset = 1e-9 * (encounter.start_ns - first) + float(
                rng.uniform(0.0, encounter.duration - length)
            )
            ids = [vehicle.id for vehicle in encounter.vehicles]
            if len(ids) > 2 and rng.random() < 0.5:
                ids = [ids[n] for n in sorted(rng.choice(len(ids), 2, replace=False))]
            start, end = round(max(offset, 0.0), 1), round(max(offset, 0.0) + length, 1)
            if any(name in ids and begin < end and start < until for name, begin, until in taken):
                continue
            cut = Cut(
                f"{recording}-{number + 1}", files, tuple(ids), start, end, MAPS.get(recording, "")
            )
            try:
                found = read_log(paths, cut.config()).encounters
            except InputError:
                continue
            if (
                len(found) != 1
                or len(found[0].vehicles) != len(ids)
                or found[0].duration < min(SHORTEST, 0.8 * length) - 1.0
            ):
                continue
            yield cut
            taken += [(name, start, end) for name in ids]
            number += 1
            if number == wanted:
                break
        print(
            f"{recording}: {number} of {wanted} from {len(encounters)} encounters",
            file=sys.stderr,
            flush=True,
        )


def main() -> None:
    """Draw the list and write it."""
    data = Path(sys.argv[1])
    rng = np.random.default_rng(SEED)
    found = list(draw(data, rng))
    rows = [asdict(found[k]) for k in rng.permutation(len(found))]
    TABLE.write_text("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n")


if __name__ == "__main__":
    main()
