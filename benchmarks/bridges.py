# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bridges: exported scenarios before other people's programs, and back again. The judges are installed by `make judges`."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
import json
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np
import pandas as pd

from benchmarks._sampling_cases import DATA
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.cli.demo import ROADS
from scenario_gen.cli.folder import FolderRequest, generate_all
from scenario_gen.logs import LogConfig, read_log, read_raw
from scenario_gen.logs.synthetic import bundled
from scenario_gen.output.exchange.cases import Case, Exported, read_cases
from scenario_gen.output.exchange.commonroad import write_commonroad
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.output.exchange.export import export_bag
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.types import VEHICLE_TYPES
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.scenario import Scenario

BEGUN = time.monotonic()
ROOT = Path(__file__).resolve().parents[1]
ROADS_IN_TURN = (
    "t_intersection",
    "corridor",
    "four_way",
    "straight",
    "roundabout",
    "merge",
    "curve",
)
MIN_EGO_DISTANCE_M = 15.0


@dataclass(frozen=True)
class Sizes:
    """How much is made and judged: scenarios of a demo's case and of a recorded one, cases, cuts, problems; files for ASAM."""

    demo: int
    recorded: int
    cases: int
    cuts: int
    problems: int
    asam: int  # scenarios of a case: a checker takes a second or two for each


USUAL = sized(
    Sizes(demo=10, recorded=2, cases=20, cuts=10, problems=40, asam=2), Sizes(2, 1, 1, 1, 1, 1)
)
FULL = sized(Sizes(demo=50, recorded=5, cases=20, cuts=10, problems=40, asam=50), USUAL)


def run(full: bool | None = None) -> list[Row]:
    """Export the demo's scenarios and those of recorded encounters; let every judge that is here look at them.

    Args:
        full: all scenarios that the demo makes, and all of them before ASAM's checkers too, which takes several times as long.
    """
    sizes = FULL if full else USUAL
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(2) as judges:
        folder = Path(scratch)
        bags = list(_bags(folder, sizes))
        _say(f"{len(bags)} bags made")
        problems = _problems(bags, folder / "problems", sizes.problems)
        _say(f"{problems} problems written")
        driven = judges.submit(_driven, folder / "problems", problems)
        rows = [higher("bridges.cases", len(bags), "cases")]
        others = []
        for target, judge in (
            ("commonroad", _commonroad),
            ("openscenario", _asam),
        ):
            few = sizes.asam if target == "openscenario" else None
            for k, bag in enumerate(bags):
                known = [one.index for case in read_cases(bag) for one in case.scenarios][:few]
                export_bag(bag, folder / target / str(k), target, indices=known)
            others.append(judges.submit(judge, folder / target))
            if target == "commonroad":  # which is a log, too
                rows += _round_trip(folder / target, bags, target)
            _say(f"exported to {target} and read back")
        for judged_rows in (*others, driven):
            rows += judged_rows.result()
        return rows


def _say(sentence: str) -> None:
    print(f"{time.monotonic() - BEGUN:.0f} s: {sentence}", file=sys.stderr, flush=True)


def _bags(folder: Path, sizes: Sizes) -> Iterator[Path]:
    """Yield a bag of each case: the demo's, recorded ones on roads in turn, and random cuts."""
    for case, road in ROADS.items():
        yield from _bag(folder, read_log(bundled(case)).encounters, road, sizes.demo)
    yield from _bag(folder, read_log(_all_types()).encounters, "corridor", sizes.demo)
    logs = sorted((DATA / "trajectories").glob("*/*.csv"))
    cut = [path for path in logs if path.name.startswith("encounter_")]
    recorded = [read_log(path).encounters[0] for path in cut]
    yield from islice(_turns(folder, recorded, sizes.recorded), sizes.cases)
    whole = [path for path in logs if path.name.endswith("_all_vehicles.csv")]
    found = [encounter for path in whole for encounter in read_log(path).encounters]
    chosen = [found[k] for k in np.random.default_rng(7).permutation(len(found))]
    yield from islice(_turns(folder, chosen, 1), sizes.cuts)


def _all_types() -> pd.DataFrame:
    """A bus, a truck and a car in one lane, a bicycle before a motorcycle in the other, and a pedestrian that crosses behind."""
    t, rows = np.arange(0.0, 12.05, 0.1), []
    lanes = {
        "bus": (10.0, 0.0, 0.0, 7.0),
        "truck": (-15.0, 0.0, 0.0, 7.0),
        "car": (-36.0, 0.0, 0.0, 7.0),
    }
    lanes |= {"motorcycle": (90.0, 3.5, np.pi, 8.0), "bicycle": (60.0, 3.5, np.pi, 4.5)}
    lanes |= {"pedestrian": (-40.0, -14.5, np.pi / 2.0, 1.3)}
    for n, (kind, (x, y, yaw, speed)) in enumerate(lanes.items(), start=1):
        way, size = speed * t + 0.5 * np.sin(t / 2.0 + n), VEHICLE_TYPES[kind]
        driven = speed + 0.25 * np.cos(t / 2.0 + n)
        place = {
            "x": x + way * np.cos(yaw),
            "y": y + way * np.sin(yaw),
            "heading": yaw,
            "speed": driven,
        }
        fixed = {"id": str(n), "agent_type": kind, "length": size.length, "width": size.width}
        rows.append(pd.DataFrame({"t": t} | fixed | place))
    return pd.concat(rows)


def _turns(folder: Path, encounters: Sequence[Encounter], count: int) -> Iterator[Path]:
    """Yield bags of every encounter on one road, then of every one on another, and so on."""
    for turn in range(len(ROADS_IN_TURN)):
        for k, encounter in enumerate(encounters):
            yield from _bag(
                folder, [encounter], ROADS_IN_TURN[(k + turn) % len(ROADS_IN_TURN)], count
            )


def _bag(folder: Path, encounters: Sequence[Encounter], road: str, count: int) -> Iterator[Path]:
    pairs = [(encounter, road) for encounter in encounters]
    made, _ = generate_all(pairs, FolderRequest([], PipelineConfig(), count, 7))
    for case in made:
        if case.generated.scenarios:
            yield write_recording(folder / f"bag_{len(list(folder.glob('bag_*')))}", case)


def _round_trip(folder: Path, bags: Sequence[Path], target: str) -> list[Row]:
    """Return the largest differences of positions and speeds after writing and importing."""
    position = speed = 0.0
    for k, bag in enumerate(bags):
        entries = json.loads((folder / str(k) / "export.json").read_text())["scenarios"]
        known = {one.sha256: one.others for case in read_cases(bag) for one in case.scenarios}
        for entry in entries:
            scenario: Scenario = known[entry["sha256"]]
            tracks = read_raw([folder / str(k) / entry["files"][0]], LogConfig()).vehicles
            for n, track in enumerate(tracks):
                present = slice(int(scenario.present[n, 0]), int(scenario.present[n, 1]) + 1)
                offset = np.abs(track.fix - scenario.position[n, present]).max()
                position = max(position, float(offset))
                difference = np.abs(track.speed - scenario.speed[n, present]).max()
                speed = max(speed, float(difference))
    return [
        lower(f"bridges.{target}.round_trip.position", position, "m", 1e-3),
        lower(f"bridges.{target}.round_trip.speed", speed, "m/s", 1e-2),
    ]


def judged(environment: str, program: str, *arguments: str) -> Any:
    """Return what a judge says; None if its environment is not here."""
    python = ROOT / f".venv-judges-{environment}" / "bin" / "python"
    if not python.is_file():
        return None
    run = subprocess.run(
        [python, ROOT / "test" / "judges" / program, *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
    lines = [line for line in run.stdout.splitlines() if line.startswith("{")]
    if not lines:
        raise RuntimeError(f"{program} said nothing: {run.stderr[-500:]}")
    return json.loads(lines[-1])


def _faults(found: Any, target: str, lists: Sequence[str], peer: str) -> list[Row]:
    """Return a row for each list of faults that a judge found."""
    return [
        lower(f"bridges.{target}.{name}", len(found[name]), "faults", 0, peer) for name in lists
    ]


def _commonroad(folder: Path) -> list[Row]:
    found = judged("commonroad", "commonroad_files.py", "check", str(folder))
    if found is None:
        return []
    peer = f"commonroad-io, drivability checker: {found['files']} files"
    lists = ("invalid", "collisions", "off_road", "not_found")
    error = lower("bridges.commonroad.read_error", found["read_error"], "m", 1e-6, peer)
    return [error, *_faults(found, "commonroad", lists, peer)]


def _asam(folder: Path) -> list[Row]:
    found = judged("asam", "asam_files.py", str(folder))
    if found is None:
        return []
    rows = []
    for kind, name in (("xosc", "openscenario"), ("xodr", "opendrive")):
        peer = f"asam-qc-{name}: {found[kind]} files, {found['rules'].get(kind, 0)} rules"
        issues = sum(path.endswith(kind) for path in found["issues"])
        rows.append(lower(f"bridges.{name}.files_with_issues", issues, "files", 0, peer))
    return rows


def _problems(bags: Sequence[Path], folder: Path, most: int) -> int:
    """Write planning problems, one after the other from each case and each vehicle that drives; return how many."""
    folder.mkdir()
    written = 0
    for case, one in islice(_egos(bags), most):
        data, _ = write_commonroad(case, one)
        (folder / f"problem_{written:02d}.xml").write_bytes(data)
        written += 1
    return written


def _egos(bags: Sequence[Path]) -> Iterator[tuple[Case, Exported]]:
    """Yield the first scenario of each case with each vehicle as ego, then the second, ..."""
    groups: list[list[tuple[Case, Exported]]] = []
    for bag in bags:
        vehicles = [v for case in read_cases(bag) for v in case.scenarios[0].others.vehicles]
        for vehicle in vehicles:
            cases = read_cases(bag, ExportConfig(ego=vehicle.id))
            pairs = [(case, one) for case in cases for one in case.scenarios]
            groups.append([pair for pair in pairs if _drives(pair[1])])
    for turn in range(max(map(len, groups), default=0)):
        yield from (group[turn] for group in groups if turn < len(group))


def _drives(one: Exported) -> bool:
    ego = one.ego
    return (
        ego is not None
        and float(np.abs(np.diff(ego.position[0], axis=0)).sum()) >= MIN_EGO_DISTANCE_M
    )


def _driven(folder: Path, problems: int) -> list[Row]:
    found = judged("commonroad", "commonroad_files.py", "drive", str(folder)) if problems else None
    if found is None:
        return []
    peer = f"commonroad-reactive-planner: {found['reached']} of {found['problems']} problems"
    for name, (outcome, step) in found["outcomes"].items():
        peer += "" if outcome == "reached" else f"; {name}: {outcome} at step {step}"
    share = found["reached"] / found["problems"]
    return [higher("bridges.commonroad.problems_solved", share, "share", 0.9, peer)]
