# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Many drives of one planner: from a bag or from scenarios, in parallel, with the same results for any number of workers."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
import math
import multiprocessing
import os
from pathlib import Path
import pickle
import pkgutil
import sys
from typing import Any

import numpy as np

from scenario_gen.bags.recordings.read import (
    INFO,
    read_recording,
    ScenarioEntry,
    SCENARIOS,
    WITNESS,
)
from scenario_gen.bags.storage.bag import naming_bag
from scenario_gen.bags.storage.config import BagConfig
from scenario_gen.base.errors import did_you_mean, InputError, ScenarioGenError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.base.signals import ctrl_c_blocked, end_with_parent
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.origin import Origin, origins_of, Trial, units_of
from scenario_gen.closed_loop.simulation import ClosedLoop, Drive, Planner
from scenario_gen.closed_loop.timeouts import bounded, Decisions, Timed, TooLongError
from scenario_gen.closed_loop.verdict import DriveVerdict, judge
from scenario_gen.method.evaluation import clustered_wilson
from scenario_gen.types import (
    GenerationResult,
    Interval,
    join_ego,
    Road,
    Scenario,
    token,
)

MakePlanner = Callable[[], Planner]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one trial came to.

    Attributes:
        name: of the trial.
        verdict: on the drive.
        drive: what was driven.
        origin: where the scenario comes from.
        decisions: how long the planner's decisions took here; nothing that is written hangs on it.
    """

    name: str
    verdict: DriveVerdict
    drive: Drive
    origin: Origin = Origin()
    decisions: Decisions = Decisions()


@dataclass(frozen=True)
class Bars(Parameters):
    """What a planner must keep to pass."""

    collisions: float = parameter(
        0.0, "largest share of drives with a collision", low=0.0, high=1.0
    )
    off_road: float = parameter(
        0.0, "largest share of drives that leave the road", low=0.0, high=1.0
    )
    goals: float = parameter(
        1.0, "smallest share of drives that reach the goal", low=0.0, high=1.0
    )
    at_fault: float = parameter(
        0.0, "largest share of drives with a collision by the ego's fault", low=0.0, high=1.0
    )
    jumps: float = parameter(
        0.0, "largest share of drives in which the ego teleports", low=0.0, high=1.0
    )
    progress: float = parameter(
        0.9, "smallest share of drives with progress: 20 % of the reference drive's path, as in nuPlan; who never moves has none",
        low=0.0, high=1.0,
    )  # fmt: skip


def find_planner(name: str) -> MakePlanner:
    """Return what makes a planner, named MODULE:CLASS; modules of the current folder are found, too.

    Raises:
        InputError: there is no such module or class.
    """
    module, colon, attribute = name.partition(":")
    if not (colon and module and attribute):
        raise InputError(
            f"--planner {name}: write it as MODULE:CLASS, e.g. scenario_gen.closed_loop.planners:IdmFollower"
        )
    if str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))
    try:
        found: Any = pkgutil.resolve_name(name)
    except ImportError as error:
        raise InputError(
            f"--planner {name}: {error}; run in the folder of the module, or put it on PYTHONPATH"
        ) from error
    except AttributeError as error:
        near = did_you_mean(
            attribute, [one for one in vars(sys.modules[module]) if one[:1].isupper()]
        )
        raise InputError(
            f"--planner {name}: {error}; name a class of that module{near}"
        ) from error
    except (Exception, SystemExit) as error:  # the module runs
        raise InputError(f"--planner {name}: {type(error).__name__}: {error}") from error
    if not callable(found):
        raise InputError(
            f"--planner {name}: that is no class; a planner has reset(task) and act(observation)"
        )
    return found  # type: ignore[no-any-return]


def read_trials(
    bag: Path, ego: str = "", count: int = 0, config: BagConfig = BagConfig()
) -> list[Trial]:
    """Return the scenarios of a bag, in order, each on its road.

    Args:
        bag: of this suite.
        ego: id of the vehicle in whose place the ego drives. "": that of the scenario's ego slot,
            or the first if it has none.
        count: how many at most; all if 0.
        config: how much is read at most.

    Raises:
        InputError: the bag is damaged or holds no scenario, or one has no vehicle `ego`, or a slot
            for another.
    """
    trials: list[Trial] = []
    with naming_bag(bag):
        for namespace in read_recording(
            bag, config, ("map", "road/lanes", "fit/info", SCENARIOS, INFO)
        ).namespaces.values():
            for k in range(len(namespace.hashes)):
                if count and len(trials) >= count:
                    break
                stamp, scenario = namespace.scenario(k)
                entry = namespace.entry(k)
                where = f"{namespace.where(SCENARIOS)}, scenario {scenario.index}"
                name = (
                    f"{namespace.name} {scenario.index}" if namespace.name else str(scenario.index)
                )
                trial = trial_of(
                    name, scenario, entry, namespace.road_of(entry, stamp), ego, where
                )
                trials.append(replace(trial, encounter=_encounter_of(entry)))
    if not trials:
        raise InputError(
            f"{bag}: no topic `scenarios` in any namespace; there is nothing to drive in"
        )
    return trials


def trial_of(
    name: str,
    scenario: Scenario,
    entry: ScenarioEntry | None,
    road: Road | None,
    ego: str,
    where: str,
) -> Trial:
    """Return the trial of a scenario, with its witness among the vehicles where it has one.

    Args:
        name: for people.
        scenario: as it was recorded or heard.
        entry: its own on `scenarios/info`, if there is one.
        road: its road, if it is known.
        ego: id of the vehicle in whose place the ego drives; "": that of the ego slot, or the
            first.
        where: names it in messages.

    Raises:
        InputError: naming `where`, there is no such vehicle, the scenario was made for another, or
            the witness is missing.
    """
    return Trial(
        name, join_ego(scenario), _ego_of(scenario, entry.ego if entry else "", ego, where), road
    )


def trials_of(result: GenerationResult, ego: str = "") -> list[Trial]:
    """Return the scenarios of a result as trials; `ego` as in `read_trials`.

    Raises:
        InputError: a scenario has no vehicle `ego`, or a slot for another.
    """
    name = result.encounter.name
    trials = [
        trial_of(str(one.index), one, None, result.road, ego, f"scenario {one.index}")
        for one in result
    ]
    return [replace(trial, encounter=name) for trial in trials]


def _encounter_of(entry: ScenarioEntry | None) -> str:
    """Return the name of the template of a scenario, and what tells it from others of that name; "" if it is not known."""
    values = entry.status.values if entry is not None else {}
    return f"{values.get('template', '')} {(entry.template_hash or '')[:8] if entry is not None else ''}".strip()


def named_vehicle(ids: Sequence[str], name: str) -> str:
    """Return the id that is a name, or whose token it is; "" if there is none."""
    return next((one for one in ids if name in (one, token(one))), "")


def _ego_of(scenario: Scenario, slot: str, asked: str, where: str) -> str:
    """Return the id of the vehicle in whose place the ego drives.

    Raises:
        InputError: naming `where`, there is no such vehicle, the scenario was made for another, or
            the witness is missing.
    """
    if scenario.reference_drive is not None:
        own = scenario.reference_drive.vehicles[0].id
        if asked and not named_vehicle([own], asked):
            raise InputError(
                f"{where}: it was made for ego {own!r}; leave --ego out, or name that one"
            )
        return own
    ids = [vehicle.id for vehicle in scenario.vehicles]
    if slot and asked in ("", slot):
        raise InputError(
            f"{where}: it was made for ego {slot!r}, whose reference drive is not in the bag (it was recorded before 0.6, or "
            f"without `{WITNESS}`): make it again, or name another vehicle with --ego; it has {', '.join(ids)}"
        )
    wanted = named_vehicle(ids, asked or ids[0])
    if not wanted:
        raise InputError(
            f"{where}: no vehicle {asked!r} to be the ego; it has {', '.join(ids)}{did_you_mean(asked, ids)}"
        )
    return wanted


def with_origins(outcomes: Sequence[Outcome], trials: Sequence[Trial]) -> list[Outcome]:
    """Return the outcomes with the whole origin of their scenarios: encounter, digest, and which are copies."""
    return [
        replace(outcome, origin=origin)
        for outcome, origin in zip(outcomes, origins_of(trials), strict=True)
    ]


RunTrials = Callable[[Sequence[Trial]], Iterator["Outcome"]]


def run_trials(
    trials: Sequence[Trial],
    planner: MakePlanner | str,
    config: ClosedLoopConfig = ClosedLoopConfig(),
    workers: int = 1,
    progress: Callable[[int, int], None] = lambda *_: None,
) -> list[Outcome]:
    """Drive every trial with a planner of its own, and judge it; results are in the order of the trials.

    Args:
        trials: what is driven.
        planner: makes a planner, or its name as MODULE:CLASS; with several workers, a name or what
            can be pickled.
        config: the parameters.
        workers: processes.
        progress: called with how many are done, and how many there are.

    Raises:
        InputError: the planner is not found, or fails; the message names the scenario.
    """
    outcomes: list[Outcome] = []
    with (
        trial_runner(planner, config, min(workers, max(len(trials), 1))) as run,
        saying_what_was_before(outcomes),
    ):
        for outcome in run(trials):
            outcomes.append(outcome)
            progress(len(outcomes), len(trials))
    return outcomes


@contextmanager
def saying_what_was_before(outcomes: Sequence[Outcome]) -> Iterator[None]:
    """Add to an InputError what the drives before it came to."""
    try:
        yield
    except InputError as error:
        if not outcomes:
            raise
        found = ", ".join(f"{name} {rate.count}" for name, rate in rates(outcomes).items())
        raise InputError(f"{error}\nof the {len(outcomes)} drives before: {found}") from error


def too_long(trial: Trial, config: ClosedLoopConfig) -> InputError:
    """Return the error of a planner that takes too long for a drive."""
    return InputError(
        f"scenario {trial.name}: the planner did not come to an end in {config.drive_time:g} s (drive_time): it hangs, or "
        "needs more time for a drive"
    )


@contextmanager
def trial_runner(
    planner: MakePlanner | str, config: ClosedLoopConfig, workers: int
) -> Iterator[RunTrials]:
    """Yield what drives trials, in their order, again and again with the same processes; arguments as in `run_trials`.

    Raises:
        InputError: as `run_trials`.
    """
    if isinstance(planner, str):
        find_planner(planner)  # what is wrong with it is reported before there are processes

    if workers <= 1:
        yield lambda trials: map(_run, ((trial, planner, config) for trial in trials))
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=end_with_parent) as pool:

        def run(trials: Sequence[Trial]) -> Iterator[Outcome]:
            tasks = (
                (replace(trial, road=None), road, planner, config)
                for trial, road in zip(trials, _packed_roads(trials), strict=True)
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
                    f"a process that drove the planner has ended after {done} of {len(trials)} drives: it crashed, called "
                    "os._exit, hung in compiled code for longer than drive_time, or was killed for want of memory; --workers 1 "
                    "shows where"
                ) from error

        yield run


def _packed_roads(trials: Sequence[Trial]) -> list[bytes]:
    """Return the pickled road of each trial, "" without one; a road that several trials share is pickled once."""
    roads = {id(trial.road): trial.road for trial in trials}
    packed = {key: pickle.dumps(road) if road else b"" for key, road in roads.items()}
    return [packed[id(trial.road)] for trial in trials]


@lru_cache(maxsize=4)
def _unpacked(road: bytes) -> Road:
    """Return the road of a task: one object for all tasks, so that what is derived from it is derived once."""
    known: Road = pickle.loads(road)
    return known


def _run_packed(task: tuple[Trial, bytes, MakePlanner | str, ClosedLoopConfig]) -> Outcome:
    trial, road, planner, config = task
    return _run((replace(trial, road=_unpacked(road)) if road else trial, planner, config))


def _run(task: tuple[Trial, MakePlanner | str, ClosedLoopConfig]) -> Outcome:
    trial, planner, config = task
    make = find_planner(planner) if isinstance(planner, str) else planner
    loop, process = ClosedLoop(trial.scenario, trial.ego, trial.road, config), os.getpid()
    try:
        timed = Timed(make(), config.decision_time)
        with bounded(config.drive_time):
            drive = loop.drive(timed)
    except TooLongError as error:
        raise too_long(trial, config) from error
    except InputError as error:
        raise InputError(f"scenario {trial.name}: {error}") from error
    except ScenarioGenError:
        raise
    except (
        Exception,
        SystemExit,
    ) as error:  # one that leaves would take its exit code for the result
        raise InputError(
            f"scenario {trial.name}: the planner failed: {type(error).__name__}: {error}"
        ) from error
    finally:
        if os.getpid() != process:  # the planner has forked: there is one result of this drive
            os._exit(1)
    return Outcome(trial.name, judge(loop, drive), drive, Origin(trial.encounter), timed.found)


LEVEL = 0.95  # of the intervals


@dataclass(frozen=True)
class Rate:
    """How many of the drives, and the share with its 95 % interval (Wilson 1927), and how many encounters they are of."""

    count: int
    of: int
    share: Interval
    encounters: int = 1

    def __str__(self) -> str:
        low, high = 100.0 * self.share.low, 100.0 * self.share.high
        return f"{self.count} of {self.of} ({100.0 * self.share.value:.1f} %, {low:.1f} to {high:.1f} %)"

    def document(self) -> dict[str, Any]:
        """Return it as JSON's types."""
        shares = {"share": self.share.value, "low": self.share.low, "high": self.share.high}
        return {"count": self.count, "of": self.of, **shares, "encounters": self.encounters}


def rates(outcomes: Sequence[Outcome]) -> dict[str, Rate]:
    """Return how often what happened: failures of any kind, collisions, those by the ego's fault, and so on.

    Drives of one encounter are alike, so intervals are for encounters that are drawn at random;
    with one encounter alone they hold for that one, and copies of one scenario count as one.
    """
    verdicts = [outcome.verdict for outcome in outcomes]
    flags = {
        "failures": [not v.passed for v in verdicts],
        "collisions": [v.collision is not None for v in verdicts],
        "at_fault": [v.at_fault for v in verdicts],
        "at_fault_nuplan": [v.terms.no_at_fault_collision == 0.0 for v in verdicts],
        "off_road": [not math.isnan(v.off_road) for v in verdicts],
        "jumps": [v.jumps > 0 for v in verdicts],
        "goals": [not math.isnan(v.goal) for v in verdicts],
        "progress": [v.terms.making_progress > 0.0 for v in verdicts],
    }
    return {name: _rate(outcomes, each) for name, each in flags.items()}


def passed_of(outcomes: Sequence[Outcome]) -> Rate:
    """Return how many drives passed."""
    return _rate(outcomes, [outcome.verdict.passed for outcome in outcomes])


def _rate(outcomes: Sequence[Outcome], flags: Sequence[bool]) -> Rate:
    unit, encounters = units_of(
        [outcome.name for outcome in outcomes], [outcome.origin for outcome in outcomes]
    )
    hits = np.array(flags, dtype=np.bool_)
    return Rate(sum(flags), len(flags), clustered_wilson(hits, unit, LEVEL), encounters)


LEAST = ("goals", "progress")  # shares of which a bar asks for so many at least


def broken_bars(found: dict[str, Rate], bars: Bars) -> list[str]:
    """Return a sentence for each bar that was not kept."""
    messages = []
    for name, wanted in asdict(bars).items():
        value = found[name].share.value
        if (value < wanted) if name in LEAST else (value > wanted):
            side = "at least" if name in LEAST else "at most"
            messages.append(
                f"{name}: {100 * value:.1f} %; {side} {100 * wanted:.1f} % is required"
            )
    return messages
