# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Many drives with one planner, from a bag or from scenarios, in parallel.

The results do not depend on the number of workers.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain, islice, repeat
import math
import os
from pathlib import Path
import pickle
import sys
import traceback
from typing import Any, Protocol

import numpy as np

from scenario_gen.bags.recordings.read import (
    ego_of,
    INFO,
    Namespace,
    read_recording,
    ScenarioEntry,
    SCENARIOS,
)
from scenario_gen.bags.storage.bag import naming_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import did_you_mean, InputError
from scenario_gen.base.registry import load_class
from scenario_gen.base.signals import ctrl_c_blocked, worker_pool
from scenario_gen.closed_loop import planners
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.drive import Drive
from scenario_gen.closed_loop.origin import Origin, origins_of, Trial, units_of
from scenario_gen.closed_loop.simulation import ClosedLoop, Planner
from scenario_gen.closed_loop.timeouts import bounded, Decisions, end_named, Timed, TooLongError
from scenario_gen.closed_loop.verdict import DriveVerdict, judge
from scenario_gen.method.evaluation import clustered_wilson
from scenario_gen.numerics import Floats
from scenario_gen.types import (
    GenerationResult,
    Interval,
    join_ego,
    Road,
)

MakePlanner = Callable[[], Planner]


@dataclass(frozen=True, eq=False)
class Outcome:
    """The outcome of one trial.

    Attributes:
        name: name of the trial.
        verdict: the verdict on the drive.
        drive: the drive.
        origin: the origin of the scenario.
        decisions: durations of the planner's decisions on this machine; no file contains them.
        traceback: of the error that ended the drive; "" without one.
        repeats: whether a repeated drive was the same.
    """

    name: str
    verdict: DriveVerdict
    drive: Drive
    origin: Origin = Origin()
    decisions: Decisions = Decisions()
    traceback: str = ""
    repeats: bool = True


def find_planner(name: str) -> MakePlanner:
    """Return the class of a planner, named MODULE:CLASS, also from the current folder.

    A built-in planner's class needs no module.

    Raises:
        InputError: there is no such module or class.
    """
    if ":" in name:
        return load_class("--planner", name)  # type: ignore[no-any-return]
    if name not in planners.BUILT_IN:
        raise InputError(
            f"--planner {name}: write it as MODULE:CLASS, e.g. my_module:MyClass, or name one of "
            f"{', '.join(planners.BUILT_IN)}{did_you_mean(name, planners.BUILT_IN)}"
        )
    return getattr(planners, name)  # type: ignore[no-any-return]


def read_trials(
    bag: Path, ego: str = "", count: int = 0, config: BagConfig = BagConfig()
) -> list[Trial]:
    """Return the scenarios of a bag, in order, each on its road.

    Args:
        bag: a bag that scenario_gen recorded.
        ego: id of the vehicle that the ego replaces. "": that of the scenario's ego slot, or the
            first if it has none.
        count: greatest number of scenarios; 0: all.
        config: limits of reading.

    Raises:
        InputError: the bag is damaged or has no scenario, or a scenario has no vehicle `ego`, or
            it was made for another ego.
    """
    topics = ("map", "road/lanes", "fit/info", SCENARIOS, INFO)
    with naming_bag(bag):
        namespaces = read_recording(bag, config, topics).namespaces.values()
        every_trial = (_trials_in(namespace, ego) for namespace in namespaces)
        trials = list(islice(chain.from_iterable(every_trial), count or None))
    if not trials:
        raise InputError(f"{bag}: no scenario to drive: no namespace has a topic `scenarios`")
    return trials


def _trials_in(namespace: Namespace, ego: str) -> Iterator[Trial]:
    for k in range(len(namespace.hashes)):
        stamp, scenario = namespace.scenario(k)
        entry = namespace.entry(k)
        name = f"{namespace.name} {scenario.index}".strip()
        place = f"{namespace.where(SCENARIOS)}, scenario {scenario.index}"
        road = namespace.road_of(entry, stamp)
        who = ego_of(scenario, entry, ego, place)
        yield Trial(name, join_ego(scenario), who, road, _encounter_of(entry))


def trials_of(result: GenerationResult, ego: str | int = "") -> list[Trial]:
    """Return the scenarios of a result as trials; `ego` as in `read_trials`.

    Raises:
        InputError: it is no result, a scenario has no vehicle `ego`, or it was made for another
            ego.
    """
    if not isinstance(result, GenerationResult):
        raise InputError(
            f"trials_of: a result of generate or load is needed, not {type(result).__name__}"
        )
    ego, trials = str(ego), []
    for scenario in result:
        index = str(scenario.index)
        who = ego_of(scenario, None, ego, f"scenario {index}")
        recording = result.encounter.recording
        trials.append(Trial(index, join_ego(scenario), who, result.road, recording))
    return trials


def trials_in(scenarios: GenerationResult | Path | str, ego: str = "") -> list[Trial]:
    """Return the scenarios of a result or of a bag as trials; `ego` as in `read_trials`.

    Raises:
        InputError: as `trials_of` and `read_trials`.
    """
    if isinstance(scenarios, Path | str):
        return read_trials(Path(scenarios), ego)
    return trials_of(scenarios, ego)


def _encounter_of(entry: ScenarioEntry | None) -> str:
    """Return the name and the short hash of a scenario's template; "" if it is not known.

    The outcomes of a decision come from one encounter, and have its name alone.
    """
    if entry is None:
        return ""
    name, digest = entry.template, entry.template_hash or ""
    if entry.facts.decision is not None:
        return name
    return f"{name} {digest[:8]}".strip()


def with_origins(outcomes: Sequence[Outcome], trials: Sequence[Trial]) -> list[Outcome]:
    """Return the outcomes with the complete origins of their scenarios."""
    return [
        replace(outcome, origin=origin)
        for outcome, origin in zip(outcomes, origins_of(trials), strict=True)
    ]


class RunTrials(Protocol):
    """Drives trials in their order."""

    def __call__(
        self, trials: Sequence[Trial], planners: Sequence[MakePlanner | str] = ()
    ) -> Iterator[Outcome]:
        """Yield the outcomes; `planners` drive instead of one planner, one for each trial."""


def run_trials(
    trials: Sequence[Trial],
    planner: MakePlanner | str,
    config: ClosedLoopConfig = ClosedLoopConfig(),
    workers: int = 1,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> list[Outcome]:
    """Drive every trial with a new planner and judge it; outcomes are in the order of the trials.

    Args:
        trials: the trials.
        planner: makes a planner, or its name as MODULE:CLASS; with several workers, a name or a
            function that can be pickled.
        config: the parameters.
        workers: number of processes.
        progress: called with the number of finished trials and the number of all trials.

    Raises:
        InputError: the planner is not found, or ends its process.
    """
    outcomes: list[Outcome] = []
    with trial_runner(planner, config, min(workers, max(len(trials), 1))) as run:
        for outcome in run(trials):
            outcomes.append(outcome)
            progress(len(outcomes), len(trials))
    return outcomes


@contextmanager
def trial_runner(
    planner: MakePlanner | str, config: ClosedLoopConfig, workers: int
) -> Iterator[RunTrials]:
    """Yield a function that drives trials in their order, always with the same processes.

    Arguments are as in `run_trials`.

    Raises:
        InputError: as `run_trials`.
    """
    if isinstance(planner, str):
        find_planner(planner)  # reports errors before any process starts
    if workers <= 1:
        with end_named():
            yield lambda trials, planners=(): (
                _run((trial, make, config))
                for trial, make in zip(trials, planners or repeat(planner), strict=False)
            )
        return
    with worker_pool(workers) as pool:

        def run(
            trials: Sequence[Trial], planners: Sequence[MakePlanner | str] = ()
        ) -> Iterator[Outcome]:
            makers = planners or repeat(planner)
            tasks = (
                (replace(trial, road=None), road, make, config)
                for trial, road, make in zip(trials, _packed_roads(trials), makers, strict=False)
            )
            with ctrl_c_blocked():
                results = pool.map(
                    _run_packed, tasks, chunksize=min(max(len(trials) // workers, 1), 4)
                )
            done = 0
            try:
                for outcome in results:
                    yield outcome
                    done += 1
            except BrokenProcessPool as error:
                raise InputError(
                    f"a planner process ended after {done} of {len(trials)} drives: it crashed, "
                    "called os._exit, hung in compiled code for longer than drive_time, or was "
                    "killed for lack of memory; use --workers 1 to see where"
                ) from error

        yield run


def _packed_roads(trials: Sequence[Trial]) -> list[bytes]:
    """Return the pickled road of each trial, b"" without one; shared roads are pickled once."""
    roads = {id(trial.road): trial.road for trial in trials}
    packed = {key: pickle.dumps(road) if road else b"" for key, road in roads.items()}
    return [packed[id(trial.road)] for trial in trials]


@lru_cache(maxsize=4)
def _unpacked(road: bytes) -> Road:
    """Return the road of a task: one object for all tasks that share its cached fields."""
    unpacked: Road = pickle.loads(road)
    return unpacked


def _run_packed(task: tuple[Trial, bytes, MakePlanner | str, ClosedLoopConfig]) -> Outcome:
    trial, road, planner, config = task
    return _run((replace(trial, road=_unpacked(road)) if road else trial, planner, config))


def _run(task: tuple[Trial, MakePlanner | str, ClosedLoopConfig]) -> Outcome:
    trial, planner, config = task
    make = find_planner(planner) if isinstance(planner, str) else planner
    loop = ClosedLoop(trial.scenario, trial.ego, trial.road, config)
    outcome = _drive(trial.name, loop, make)
    for _ in range(1, config.repeat):
        again = _drive(trial.name, loop, make).drive.motion
        if not np.array_equal(again.position, outcome.drive.motion.position):
            outcome = replace(outcome, repeats=False)
    return replace(outcome, origin=Origin(trial.encounter))


def _drive(name: str, loop: ClosedLoop, make: MakePlanner) -> Outcome:
    """Drive with a new planner; an error of the planner or of a criterion ends the drive.

    What the planner prints goes to the standard error stream.
    """
    process, config = os.getpid(), loop.config
    states, timed = [loop.start()], None
    error: BaseException | None = None
    try:
        with redirect_stdout(sys.stderr), bounded(config.drive_time):
            timed = Timed(make(), config.step)
            states.extend(loop.steps(timed))
        drive = loop.record(states)
        verdict = judge(loop, drive)
    except (Exception, SystemExit, TooLongError) as failure:
        error = failure
    finally:
        if os.getpid() != process:  # the planner has forked: only the parent has a result
            os._exit(1)
    decisions = Decisions() if timed is None else timed.decisions
    text = ""
    if error is not None:
        if len(states) == 1:
            states.append(loop.step(states[0], None))
        drive = loop.record(states)
        verdict = replace(judge(loop, drive, ()), error=_where(error, config))
        text = "".join(traceback.format_exception(error))
    return Outcome(name, verdict, drive, decisions=decisions, traceback=text)


def _where(error: BaseException, config: ClosedLoopConfig) -> str:
    """Return an error in one line, with the file and the line that raised it."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    message = f"{type(error).__name__}: {error}"
    if isinstance(error, TooLongError):
        message = (
            f"not finished in {config.drive_time:g} s; if it does not hang, increase drive_time"
        )
    return f"{' '.join(message.split())} ({Path(frame.filename).name}, line {frame.lineno})"


CONFIDENCE = 0.95
MIN_PROGRESS_SHARE = 0.2  # of the reference path, as in nuPlan


@dataclass(frozen=True)
class Rate:
    """A number of drives.

    Attributes:
        count: number of drives to which something happened.
        of: number of all drives.
        share: their ratio, with its 95 % interval (Wilson 1927).
        encounters: number of encounters that the drives come from.
    """

    count: int
    of: int
    share: Interval
    encounters: int = 1

    def __str__(self) -> str:
        low, high = 100.0 * self.share.low, 100.0 * self.share.high
        share = f"{100.0 * self.share.value:.1f} %, {low:.1f} to {high:.1f} %"
        return f"{self.count} of {self.of} ({share})"

    def document(self) -> dict[str, Any]:
        """Return it as JSON's types."""
        shares = {"share": self.share.value, "low": self.share.low, "high": self.share.high}
        return {"count": self.count, "of": self.of, **shares, "encounters": self.encounters}


def rates(outcomes: Sequence[Outcome]) -> dict[str, Rate]:
    """Return the rates of failures, of collisions, of collisions by the ego's fault, and others.

    Drives from one encounter are similar, so the intervals are for encounters that are drawn at
    random. With a single encounter they hold for that encounter, and copies of one scenario count
    as one.
    """
    each = [_events(outcome.verdict) for outcome in outcomes]
    names = each[0] if each else ()
    return {name: _rate(outcomes, [events[name] for events in each]) for name in names}


def _events(v: DriveVerdict) -> dict[str, bool]:
    """Return what happened in a drive, by the names of rates."""
    events = {
        "failures": not v.passed,
        "collisions": v.collision is not None,
        "at_fault": v.at_fault,
        "off_road": not math.isnan(v.off_road),
        "jumps": v.jumps > 0,
        "faults": v.faults > 0,
        "took_turn": v.took_turn,
        "goals": not math.isnan(v.goal),
        "progress": v.progress >= MIN_PROGRESS_SHARE,
    }
    if v.criteria:
        events["criteria"] = bool(v.missed)
    return events | {f"criterion {result.name}": result.missed for result in v.criteria}


def passed_of(outcomes: Sequence[Outcome], weight: Floats | None = None) -> Rate:
    """Return the rate of drives that passed; with weights (S,) the share is weighted."""
    return _rate(outcomes, [outcome.verdict.passed for outcome in outcomes], weight)


def _rate(
    outcomes: Sequence[Outcome], flags: Sequence[bool], weight: Floats | None = None
) -> Rate:
    unit, encounters = units_of(
        [outcome.name for outcome in outcomes], [outcome.origin for outcome in outcomes]
    )
    hits = np.array(flags, dtype=np.bool_)
    share = clustered_wilson(hits, unit, CONFIDENCE, weight)
    return Rate(sum(flags), len(flags), share, encounters)
