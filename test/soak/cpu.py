# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every recorded encounter on two roads, under every setting that another CPU would choose: the same bytes."""

from collections.abc import Iterable, Iterator
import json
import os
from pathlib import Path

from cpu_settings import CODE, digests, ROOT, SETTINGS
from figures import Figure

DATA = Path(os.environ.get("SCENARIO_GEN_DATA", ROOT.parent / "shared" / "data"))
ROADS = ("corridor", "t_intersection")
COUNT, SEED = 30, 7


def results(setting: dict[str, str], logs: list[Path], file: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield the digests of each log on each road; what `file` holds already is not run again."""
    known: dict[str, dict[str, str]] = json.loads(file.read_text()) if file.exists() else {}
    for log in logs:
        for road in ROADS:
            label = f"{log.stem} {road}"
            if label not in known:
                known[label] = json.loads(digests(setting, COUNT, SEED, str(log), road))
                file.write_text(json.dumps(known))
            yield label, known[label]


def run(state: Path) -> Iterable[Figure]:
    """Compare every setting with the machine as it is."""
    logs = sorted((DATA / "trajectories").glob("*/encounter_*.csv"))
    every = SETTINGS | {name: value | {"NUMBA_CACHE_DIR": str(state.resolve() / "numba")} for name, value in CODE.items()}
    own = dict(results({}, logs, state / "as it is.json"))
    for name, setting in list(every.items())[1:]:
        differ = [label for label, found in results(setting, logs, state / f"{name}.json") if found != own[label]]
        seen = f"{len(own) - len(differ)} of {len(own)}" + (f"; not {differ[0]}" if differ else "")
        yield Figure(f"the same bytes: {name}", f"{len(logs)} encounters × {len(ROADS)} roads", seen, bool(own) and not differ)
