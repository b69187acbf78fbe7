# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every recorded encounter on two roads, under every setting that another CPU would choose: same decisions, within 1 cm."""

from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from figures import Figure, kept
from support.cpu_settings import apart, CODE, MOST_APART_M, results_under, SETTINGS
from support.lengths import DATA

ROADS = ("corridor", "t_intersection")
COUNT, SEED = 30, 7


def results(setting: dict[str, str], logs: list[Path], state: Path) -> Iterator[tuple[str, Any]]:
    """Yield the results of each log on each road; what lies in `state` already is not run again."""
    state.mkdir(parents=True, exist_ok=True)
    for log in logs:
        pairs = [word for road in ROADS for word in (str(log), road)]
        found = kept(
            state / f"{log.stem}.json", partial(results_under, setting, COUNT, SEED, *pairs)
        )
        yield from ((f"{log.stem}: {name}", each) for name, each in found.items())


def run(state: Path) -> Iterable[Figure]:
    """Compare every setting with the machine as it is."""
    logs = sorted((DATA / "trajectories").glob("*/encounter_*.csv"))
    every = SETTINGS | {
        name: value | {"NUMBA_CACHE_DIR": str(state.resolve() / "numba")}
        for name, value in CODE.items()
    }
    own = dict(results({}, logs, state / "as it is"))
    for name, setting in list(every.items())[1:]:
        found = {
            label: apart(own[label], each) for label, each in results(setting, logs, state / name)
        }
        worst = max(found, key=lambda label: found[label], default="none")
        seen = f"at most {found.get(worst, float('inf')) * 1e3:.4f} mm, {worst}"
        bound = f"{len(logs)} encounters × {len(ROADS)} roads: the same decisions, < {MOST_APART_M * 1e3:.0f} mm"
        yield Figure(
            name, bound, seen, bool(own) and all(each < MOST_APART_M for each in found.values())
        )
