# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A folder of results from logs: scenarios, bag, report and figures."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from scenario_gen.base.errors import did_you_mean, InputError, RefusedError
from scenario_gen.base.folders import replaced_folder
from scenario_gen.base.provenance import RECORDING
from scenario_gen.logs import LogResult, NoEncounterError, read_log
from scenario_gen.method.chain import AUTO, with_suitable_roads
from scenario_gen.method.sampling import TargetError
from scenario_gen.output.results import BAG, GENERATED, provenance_of, write_results
from scenario_gen.pipeline import generate_outcomes, PipelineConfig
from scenario_gen.types import (
    Encounter,
    GenerationResult,
    NoteKind,
    Request,
)

if TYPE_CHECKING:
    from scenario_gen.closed_loop.reacting import TestSets

Advance = Callable[[str, int, int], None]
"""Called with the progress of a case: its name, scenarios so far, scenarios requested."""
Progress = Callable[[], AbstractContextManager[Advance]]
Notify = Callable[[str], None]
EGO_AUTO = "auto"  # value of --ego: the vehicle that has to react
MAX_LOG_NOTES_COUNT = 5  # on the terminal; the report has all


@dataclass(frozen=True)
class FolderRequest:
    """The contents of a folder of results.

    Attributes:
        jobs: files that together are one log, and the roads for its encounters.
        config: the parameters of every stage.
        count: scenarios per encounter and road.
        seed: of all random numbers.
        title: heading of the report; the names of the logs by default.
        encounters: names of the encounters to use; all by default.
        request: a vehicle to leave out, start and end states, targets.
        also_read: further inputs, which the folder must not contain: maps, a parameter file.
        for_testing: whether to search for scenarios in which the ego has to react.
        budget: computing time [s] of that search, per encounter and road.
    """

    jobs: Sequence[tuple[Sequence[Path], Sequence[str]]]
    config: PipelineConfig
    count: int
    seed: int
    title: str = ""
    encounters: Sequence[str] = ()
    request: Request = Request()
    also_read: Sequence[Path] = ()
    for_testing: bool = False
    budget: float = 60.0

    @property
    def logs(self) -> list[Path]:
        """The files of all logs."""
        return [path for group, _ in self.jobs for path in group]

    @property
    def roads(self) -> list[str]:
        """The roads of all jobs."""
        return [road for _, names in self.jobs for road in names]

    @property
    def inputs(self) -> list[Path]:
        """All files that are read."""
        return [*self.logs, *map(Path, self.roads), *self.also_read]

    def provenance(self) -> dict[str, str]:
        """Return what is needed to generate the folder again."""
        return provenance_of(
            self.logs, self.seed, self.count, self.roads, self.config, self.request
        )


@dataclass(frozen=True)
class Source:
    """An encounter, its roads, and the names of the recordings from which its vehicles come."""

    encounter: Encounter
    roads: Sequence[str]
    recording: str


def no_progress() -> AbstractContextManager[Advance]:
    """Show no progress."""
    return nullcontext(lambda *_: None)


def generate_folder(
    out: Path,
    requested: FolderRequest,
    *,
    record: Callable[[Path, Sequence[GenerationResult]], None] | None = None,
    progress: Progress = no_progress,
    notify: Notify = lambda _: None,
) -> tuple[list[GenerationResult], list[str]]:
    """Generate scenarios for all encounters of some logs; write bag, report and figures to `out`.

    Args:
        out: the folder; an earlier result in it is replaced.
        requested: the contents.
        record: writes the bag, given its path and the cases, instead of this process.
        progress: a context manager whose value is called with the progress of each case.
        notify: called with notes on logs and maps, and, with an ego slot, with the number of
            scenarios that need no reaction.

    Returns:
        The cases, and a sentence on each encounter and road that was refused or incomplete.

    Raises:
        InputError: a log cannot be read, an encounter is unknown, or `out` must not be replaced.
        RefusedError: nothing could be generated.
    """
    with replaced_folder(out, GENERATED, requested.inputs) as folder:
        readings = read_logs(requested, progress, notify)
        sources = sources_of(readings)
        templates = chosen([source.encounter for source in sources.values()], requested.encounters)
        pairs = [
            (template, road) for template in templates for road in sources[template.name].roads
        ]
        with progress() as advance:
            cases, refusals = generate_all(pairs, requested, advance, notify)
        if not cases:
            raise RefusedError("nothing could be generated:", *refusals)
        cases = [_with_recording(case, sources) for case in cases]
        blind_rates = _blind_rates(cases, requested)
        for line in (*map_faults(cases), *blind_rates):
            notify(line)
        if record is not None:
            record(folder / BAG, cases)
        quality = [line for log, _ in readings for line in log.quality.lines()]
        write_results(
            folder,
            cases,
            title=requested.title or ", ".join(path.stem for path in requested.logs),
            quality=[*quality, *refusals, *blind_rates],
            provenance=requested.provenance(),
        )
    return cases, refusals


def _with_recording(case: GenerationResult, sources: dict[str, Source]) -> GenerationResult:
    recording = {RECORDING: sources[case.encounter.recording].recording}
    return replace(case, provenance={**case.provenance, **recording})


def _blind_rates(cases: Sequence[GenerationResult], requested: FolderRequest) -> list[str]:
    """Return a sentence on each encounter and road with an ego slot: the best speed law."""
    if not requested.request.ego:
        return []
    from scenario_gen.closed_loop.blind import blind_sentence
    from scenario_gen.closed_loop.config import ClosedLoopConfig

    config = ClosedLoopConfig(limits=requested.config.limits)
    groups: dict[tuple[str, str], list[GenerationResult]] = {}
    for case in cases:
        place = case.road.name if case.road else ""
        groups.setdefault((case.encounter.recording, place), []).append(case)
    return [text for group in groups.values() if (text := blind_sentence(group, config))]


def sources_of(readings: Sequence[tuple[LogResult, Sequence[str]]]) -> dict[str, Source]:
    """Return all encounters by name; further logs of the same name are numbered."""
    sources: dict[str, Source] = {}
    logs: Counter[str] = Counter()
    for log, roads in readings:
        name = log.quality.name
        logs[name] += 1
        number = f" ({logs[name]})" if logs[name] > 1 else ""
        for encounter in log.encounters:
            numbered = replace(encounter, name=encounter.name + number)
            sources[numbered.name] = Source(numbered, roads, name + number)
    return sources


def read_logs(
    requested: FolderRequest, progress: Progress, notify: Notify
) -> list[tuple[LogResult, Sequence[str]]]:
    """Return each log with its roads; of several logs, those without an encounter are skipped.

    Raises:
        InputError: a log cannot be read, or the only log has no encounter.
    """
    readings = []
    with progress() as advance:
        for k, (group, roads) in enumerate(requested.jobs):
            advance("logs read", k, len(requested.jobs))
            log = _read_job(group, requested, notify)
            if log is not None:
                readings.append((log, roads))
    for line in log_notes([log for log, _ in readings]):
        notify(line)
    return readings


def _read_job(group: Sequence[Path], requested: FolderRequest, notify: Notify) -> LogResult | None:
    """Return a log; None, with a notification, if one of several logs has no encounter."""
    try:
        return read_log(group, requested.config.log)
    except NoEncounterError as error:
        if len(requested.jobs) == 1:
            raise
        notify(f"no encounter: {error}")
        return None


def map_faults(cases: Sequence[GenerationResult]) -> list[str]:
    """Return notes on faulty elements that were left out of the maps of cases."""
    networks = {
        case.road.name: case.road.lanes
        for case in cases
        if case.road is not None and case.road.lanes is not None
    }
    return [
        f"map {name}: {note}"
        for name, network in networks.items()
        for note in network.notes
        if note.kind is NoteKind.FAULTY
    ]


def log_notes(readings: Sequence[LogResult]) -> list[str]:
    """Return notes on how logs were read, at most MAX_LOG_NOTES_COUNT; the report has all."""
    notes = [f"{log.quality.name}: {note}" for log in readings for note in log.quality.remarks()]
    more = len(notes) - MAX_LOG_NOTES_COUNT
    if more <= 0:
        return notes
    return [*notes[:MAX_LOG_NOTES_COUNT], f"{more} more notes on the log are in the report"]


def generate_all(
    pairs: Sequence[tuple[Encounter, str]],
    requested: FolderRequest,
    advance: Advance = lambda *_: None,
    notify: Notify = lambda _: None,
) -> tuple[list[GenerationResult], list[str]]:
    """Generate scenarios for encounters on their roads.

    Returns:
        The cases, and a sentence on each encounter and road that was refused or incomplete.
    """
    cases: list[GenerationResult] = []
    refusals: list[str] = []
    for encounter, road in pairs:
        name = f"{encounter.name} on {Path(road).stem}"
        advance(name, 0, requested.count)
        report = partial(advance, name)
        try:
            if requested.for_testing:
                tests = _generate_tests(encounter, road, requested, report, notify)
                sets, shortages = tests.results, [tests.shortage] if tests.shortage else []
            else:
                sets = _generate_sets(encounter, road, requested, report)
                shortages = list(_shortages(sets))
        except RefusedError as error:
            refusals.append(f"{encounter.name} on {road}: {error}")
            continue
        cases += sets
        refusals += [f"{encounter.name} on {road}: {shortage}" for shortage in shortages]
    return cases, refusals


def _generate_tests(
    encounter: Encounter,
    road: str,
    requested: FolderRequest,
    advance: Callable[[int, int], None],
    notify: Notify,
) -> "TestSets":
    """Generate scenarios that test, with the first vehicle of --ego auto that gives some.

    Raises:
        RefusedError: nothing could be generated.
    """
    from scenario_gen.closed_loop.reacting import Testing

    egos = _egos(encounter, requested.request)
    for k, ego in enumerate(egos):
        testing = Testing(
            encounter,
            road,
            requested.config,
            replace(requested.request, ego=ego),
            requested.seed,
            requested.budget / (len(egos) - k),
            notify,
        )
        try:
            return testing.run(requested.count, lambda done, total, _: advance(done, total))
        except RefusedError:
            if k + 1 == len(egos):
                raise
    raise AssertionError("there is a vehicle in any case")


def _egos(encounter: Encounter, request: Request) -> list[str]:
    """Return the vehicles that may be the ego, for --ego auto those that have to react.

    Raises:
        TargetError: nobody has to react.
    """
    if request.ego != EGO_AUTO:
        return [request.ego]
    from scenario_gen.closed_loop.reacting import reacting_vehicles

    egos = reacting_vehicles(encounter)
    if not egos:
        raise TargetError(
            "--ego auto: no vehicle has to react in this encounter; name one with --ego, or use "
            "an encounter in which a vehicle yields or follows"
        )
    return egos


def _generate_sets(
    encounter: Encounter,
    road: str,
    requested: FolderRequest,
    advance: Callable[[int, int], None],
) -> list[GenerationResult]:
    """Generate scenarios for one encounter and road, a set for each outcome of its decision.

    Raises:
        RefusedError: nothing could be generated; the message names suitable roads.
    """
    config, count, seed = requested.config, requested.count, requested.seed
    request = replace(requested.request, ego=_egos(encounter, requested.request)[0])
    try:
        return generate_outcomes(
            encounter,
            road,
            config,
            count=count,
            seed=seed,
            request=request,
            progress=lambda done, total, _: advance(done, total),
        )
    except RefusedError as error:
        if road == AUTO or request.moves or isinstance(error, TargetError):
            raise
        raise with_suitable_roads(error, encounter, road, config, seed) from error


def _shortages(sets: Sequence[GenerationResult]) -> Iterator[str]:
    """Yield why sets have fewer scenarios than requested."""
    for case in sets:
        wanted = case.generated.requested
        if len(case) < wanted:
            counts = case.generated.refused.most_common()
            causes = ", ".join(f"{count} × {cause}" for cause, count in counts)
            yield f"only {len(case)} of {wanted} scenarios: {causes or 'no candidate was drawn'}"


def chosen(encounters: Sequence[Encounter], names: Sequence[str]) -> list[Encounter]:
    """Return the encounters with these names, or all.

    Raises:
        InputError: a name is unknown; the message lists the known ones.
    """
    known = {encounter.name: encounter for encounter in encounters}
    for name in names:
        if name not in known:
            raise InputError(
                f"the log has no encounter {name!r}; it has {', '.join(known)}"
                f"{did_you_mean(name, known)}"
            )
    return [known[name] for name in names] or list(encounters)
