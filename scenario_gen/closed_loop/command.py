# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The work of `scenario-gen drive`: bags and planners' names in, a folder of verdicts out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial, reduce
import os
from pathlib import Path

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import replaced_folder
from scenario_gen.base.parameters import assigned
from scenario_gen.closed_loop.bars import Bars, broken_bars
from scenario_gen.closed_loop.blind import blind_rate, BlindRate
from scenario_gen.closed_loop.comparison import (
    compared,
    Comparison,
    Earlier,
    read_drives,
    refuse_others,
)
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.mutants import mutation_score
from scenario_gen.closed_loop.origin import origins_of, Trial
from scenario_gen.closed_loop.results import DRIVEN, Drives
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.suite import bags_in, read_suite, Suite, write_selection
from scenario_gen.closed_loop.trials import (
    MakePlanner,
    Outcome,
    run_trials,
    trials_in,
    with_origins,
)
from scenario_gen.types import GenerationResult

Progress = Callable[[int, int], None]  # numbers of finished and of all drives
RunTrials = Callable[..., list[Outcome]]  # arguments as of `run_trials`
MAX_BASELINE_COUNT = 200
BASELINE = "scenario_gen.closed_loop.planners:NonReactive"


@dataclass(frozen=True)
class DriveCommandConfig:
    """The parameters of the command: those of a drive, and the bars."""

    drive: ClosedLoopConfig = field(default_factory=ClosedLoopConfig)
    bars: Bars = field(default_factory=Bars)


@dataclass(frozen=True)
class DriveRequest:
    """The arguments of the command.

    Attributes:
        sources: bags that scenario_gen recorded, folders with bags, or lists of them.
        planners: MODULE:CLASS of each; over DDS the commands that start their nodes.
        ego: id of the vehicle that the planner replaces.
        count: greatest number of scenarios of each bag; 0: all.
        assignments: parameters as name=value; those of a drive without prefix, those of the bars
            as bars.name.
        against: drives.json of an earlier planner on the same scenarios, or its folder; with one
            planner only.
        baseline: also drive the non-reactive baseline, in at most MAX_BASELINE_COUNT scenarios,
            and the best open-loop speed laws.
        mutants: also drive the mutants of each planner.
        workers: number of processes; 0: one per core.
    """

    sources: Sequence[Path]
    planners: Sequence[str]
    ego: str = ""
    count: int = 0
    assignments: Sequence[str] = ()
    against: Path | None = None
    baseline: bool = False
    mutants: bool = False
    workers: int = 0

    def config(self) -> DriveCommandConfig:
        """Return the parameters of the drives and the bars.

        Raises:
            InputError: a name or a value is invalid.
        """
        named = (
            text if text.startswith(("bars.", "drive.")) else f"drive.{text}"
            for text in self.assignments
        )
        return reduce(assigned, named, DriveCommandConfig())

    def earlier(self) -> Earlier | None:
        """Return the drives of `against`, if it is given.

        Raises:
            InputError: they cannot be read, or there are several planners.
        """
        if self.against is None:
            return None
        if len(self.planners) > 1:
            raise InputError("--against compares with one planner; give one --planner")
        return read_drives(self.against)


def drive(
    scenarios: GenerationResult | Path | str,
    planner: MakePlanner | str,
    ego: str = "",
    config: ClosedLoopConfig = ClosedLoopConfig(),
    workers: int = 1,
) -> Drives:
    """Drive a planner through scenarios in the place of a vehicle.

    Args:
        scenarios: a result of `generate`, or the path of a bag.
        planner: its class or its name as MODULE:CLASS, built-in ones without MODULE. Every drive
            has a new planner.
        ego: id of the vehicle that it replaces; "": that for which the scenarios were made, or
            the first.
        config: the parameters.
        workers: number of processes; for several the planner must be a name or importable.

    Raises:
        InputError: there is no such planner or vehicle, or the bag cannot be read.
    """
    if not (isinstance(planner, str) or callable(planner)):
        name = type(planner).__name__
        raise InputError(f"drive: pass the class {name}, not an object; every drive makes its own")
    trials = trials_in(scenarios, ego)
    outcomes = with_origins(run_trials(trials, planner, config, workers), trials)
    name = planner if isinstance(planner, str) else f"{planner.__module__}:{planner.__qualname__}"
    return Drives(outcomes, name, config, trials)


def drive_bags(
    request: DriveRequest,
    out: Path,
    *,
    progress: Progress = lambda *_: None,
    run: RunTrials | None = None,
) -> Suite:
    """Drive planners through the scenarios of bags and write the results.

    Args:
        request: planners and bags.
        out: folder of the results.
        progress: called with the numbers of finished and of all drives.
        run: drives a planner; default: in the processes of the request.

    Raises:
        InputError: a bag, planner, folder, parameter or the file to compare with is invalid.
    """
    commanded = request.config()
    config = commanded.drive
    workers = request.workers or os.cpu_count() or 1
    in_processes = partial(run_trials, workers=workers)
    earlier = request.earlier()
    bags = bags_in(request.sources)
    trials = read_suite(bags, request.ego, request.count)
    if earlier is not None:  # refuses before the drives
        names = [trial.name for trial in trials]
        digests = [origin.digest for origin in origins_of(trials)]
        refuse_others(dict(zip(names, digests, strict=True)), config, earlier)
    total = len(trials) * len(request.planners)
    with replaced_folder(out, DRIVEN, bags) as folder:  # refuses before the drives
        unreactive, blind = _baseline(trials, config, workers) if request.baseline else ([], None)
        results = []
        for number, planner in enumerate(request.planners):
            advance = _after(number * len(trials), total, progress)
            driven = (run or in_processes)(trials, planner, config, progress=advance)
            outcomes = with_origins(driven, trials)
            comparison = compared(outcomes, config, earlier) if earlier is not None else None
            drives = Drives(
                outcomes,
                planner,
                config,
                trials,
                _broken(outcomes, commanded.bars, comparison),
                unreactive,
                blind,
                comparison,
            )
            if request.mutants:
                score = mutation_score(trials, planner, outcomes, config, workers)
                name = f"mutants-{number + 1}" if number else "mutants"
                score = replace(score, saved=_saved(folder / name, bags, score.smallest_set()))
                drives = replace(drives, mutants=score)
            results.append(drives)
        suite = Suite(results, bags)
        suite.write(folder)
    return suite


def _baseline(
    trials: Sequence[Trial], config: ClosedLoopConfig, workers: int
) -> tuple[list[Outcome], BlindRate | None]:
    """Return the outcomes of the non-reactive baseline, and how open-loop speed laws do."""
    chosen = trials[:: max(1, -(-len(trials) // MAX_BASELINE_COUNT))]
    outcomes = with_origins(run_trials(chosen, BASELINE, config, workers), chosen)
    loops = [ClosedLoop(trial.scenario, trial.ego, trial.road, config) for trial in chosen]
    return outcomes, blind_rate(loops)


def _after(before: int, total: int, progress: Progress) -> Progress:
    """Return the progress of drives that begin after others, among all."""
    return lambda done, _: progress(before + done, total)


def _broken(
    outcomes: Sequence[Outcome], bars: Bars, comparison: Comparison | None
) -> Sequence[str]:
    """Return sentences on the bars that are not met, unusable drives, and a worse planner."""
    worse = [comparison.sentence()] if comparison is not None and comparison.worse else []
    return [*broken_bars(outcomes, bars), *_unusable(outcomes), *worse]


def _saved(folder: Path, bags: Sequence[Path], names: Sequence[str]) -> str:
    """Write a bag of the scenarios that catch mutants, and return a remark about it."""
    if not names:
        return ""
    try:
        write_selection(folder, bags, names)
    except InputError as error:  # e.g. a live recording without a fit
        return f" (not saved as a bag: {error})"
    return f" (bag `{folder.name}`)"


def _unusable(outcomes: Sequence[Outcome]) -> list[str]:
    """Return sentences on drives that an error ended, or that differ when they are repeated."""
    errors = [outcome for outcome in outcomes if outcome.verdict.error]
    differ = [outcome for outcome in outcomes if not outcome.repeats]
    sentences = []
    if errors:
        first = f"scenario {errors[0].name}: {errors[0].verdict.error}"
        sentences.append(f"{len(errors)} drives ended with an error; first {first}")
    if differ:
        sentences.append(
            f"{len(differ)} of {len(outcomes)} drives differ when repeated (first: scenario "
            f"{differ[0].name}): the planner keeps state between drives, or draws at random"
        )
    return sentences
