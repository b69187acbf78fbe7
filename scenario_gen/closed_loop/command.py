# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The work of `scenario-gen drive`: a bag and a planner's name in, a folder of verdicts out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import os
from pathlib import Path

from scenario_gen.base.folders import replaced_folder
from scenario_gen.base.parameters import assigned
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.results import DRIVEN, JSON, JUNIT, PAGE, write_drives
from scenario_gen.closed_loop.trials import Bars, broken_bars, Outcome, Rate, rates, read_trials, run_trials, Trial

Progress = Callable[[int, int], None]  # of drives done, of how many
RunTrials = Callable[[Sequence[Trial], str, ClosedLoopConfig, Progress], list[Outcome]]
WORST = 5  # drives that the terminal names


@dataclass(frozen=True)
class DriveCommandConfig:
    """The parameters of the command: those of a drive, and the bars."""

    drive: ClosedLoopConfig = field(default_factory=ClosedLoopConfig)
    bars: Bars = field(default_factory=Bars)


@dataclass(frozen=True, eq=False)
class DriveResult:
    """What a planner came to: rates, the bars that were not kept, the worst drives that failed, and the files written."""

    found: dict[str, Rate]
    broken: Sequence[str]
    worst: Sequence[Outcome]
    written: Sequence[Path]


def in_processes(workers: int = 0) -> RunTrials:
    """Return what drives trials in so many processes; 0: one for each core."""
    return lambda trials, planner, config, progress: run_trials(trials, planner, config, workers or os.cpu_count() or 1, progress)


def drive_bag(
    bag: Path,
    planner: str,
    *,
    ego: str = "",
    count: int = 0,
    out: Path,
    assignments: Sequence[str] = (),
    progress: Progress = lambda *_: None,
    run: RunTrials | None = None,
) -> DriveResult:
    """Drive a planner through the scenarios of a bag and write what it came to.

    Args:
        bag: of this suite.
        planner: MODULE:CLASS; over DDS the command that starts its node.
        ego: id of the vehicle in whose place it drives.
        count: scenarios at most; 0: all.
        out: folder of the results.
        assignments: parameters as name=value; those of a drive without prefix, those of the bars as bars.name.
        progress: called with how many are done of how many.
        run: drives them; `in_processes()` if None, or over DDS, one after the other.

    Raises:
        InputError: bag, planner, folder or a parameter is wrong; the message names it.
    """
    config = DriveCommandConfig()
    for assignment in assignments:
        config = assigned(config, assignment if assignment.startswith(("bars.", "drive.")) else f"drive.{assignment}")
    trials = read_trials(bag, ego, count)
    with replaced_folder(out, DRIVEN, [bag]) as folder:  # before there is work that might not be kept
        outcomes = (run or in_processes())(trials, planner, config.drive, progress)
        found = rates(outcomes)
        broken = broken_bars(found, config.bars)
        write_drives(folder, outcomes, trials, planner, config.drive, broken)
    failed = [outcome for outcome in outcomes if not outcome.verdict.passed]
    worst = sorted(failed, key=lambda outcome: outcome.verdict.severity, reverse=True)[:WORST]
    return DriveResult(found, broken, worst, tuple(out / name for name in (JSON, JUNIT, PAGE)))
