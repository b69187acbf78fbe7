# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A folder of results from logs: scenarios of every encounter on every road, with bag, report and figures."""

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from scenario_gen.base.errors import did_you_mean, InputError, RefusedError
from scenario_gen.base.folders import replaced_folder
from scenario_gen.base.provenance import RECORDING
from scenario_gen.logs import LogResult, NoEncounterError, read_log
from scenario_gen.method.nearest import answer_refusal
from scenario_gen.method.recombination import recombinations
from scenario_gen.output.results import BAG, GENERATED, provenance_of, write_results
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.types import Encounter, GenerationResult, NoteKind, Recombined, Recorded, Request

if TYPE_CHECKING:
    from scenario_gen.closed_loop.reacting import Testing

Advance = Callable[[str, int, int], None]
"""Called with the progress of a case: its name, scenarios so far, scenarios requested."""
EGO_AUTO = "auto"  # the vehicle that has to react, by --ego
NOTES = 5  # on logs, that the terminal shows
OPTIONS = {
    "starts:='": "--start '", "goals:='": "--goal '", "sampling.max_stretch:=": "--set sampling.max_stretch=",
    "fitting.allow=": "--allow ",
}  # fmt: skip
"""Parameters of nodes, as the nearest possible request names them, and the command line's options for them."""


@dataclass(frozen=True)
class FolderRequest:
    """What a folder of results is to hold.

    Attributes:
        jobs: files that are read as one log, and the roads for its encounters.
        config: the parameters of every stage.
        count: scenarios per encounter and road.
        seed: of all randomness.
        title: heading of the report; the logs' names by default.
        encounters: names of those to take; all by default.
        request: a vehicle to be left out, and start and end states.
        for_testing: scenarios in which the ego has to react.
        recombine: encounters to recombine of those that were recorded, at most.
        also_read: what else is read, so that the folder may not hold it: maps, a parameter file.
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
    recombine: int = 0

    @property
    def logs(self) -> list[Path]:
        """All files that are read as logs."""
        return [path for group, _ in self.jobs for path in group]

    @property
    def roads(self) -> list[str]:
        """The roads of all jobs."""
        return [road for _, names in self.jobs for road in names]


@dataclass(frozen=True)
class Source:
    """An encounter, the roads that it is to drive on, and the name of the recording, or of both, that it is of."""

    encounter: Encounter
    roads: Sequence[str]
    recording: str


def generate_folder(
    out: Path,
    requested: FolderRequest,
    *,
    record: Callable[[Path, Sequence[GenerationResult]], None] | None = None,
    progress: Callable[[], AbstractContextManager[Advance]] = lambda: nullcontext(lambda *_: None),
    notify: Callable[[str], None] = lambda _: None,
) -> tuple[list[GenerationResult], list[str]]:
    """Generate scenarios of all encounters of some logs; write bag, report and figures to `out`.

    Args:
        out: the folder; an earlier result there is replaced.
        requested: what it is to hold.
        record: writes the bag (its path and the cases are given) instead of this process.
        progress: a context whose value is called with the progress of each case.
        notify: called with notes on the logs, and for each set with an ego slot with how many scenarios need no reaction.

    Returns:
        The cases, and a sentence for each encounter and road that was refused or came out short.

    Raises:
        InputError: a log cannot be read, an encounter is unknown, or `out` may not be replaced.
        RefusedError: nothing could be generated.
    """
    with replaced_folder(
        out, GENERATED, [*requested.logs, *map(Path, requested.roads), *requested.also_read]
    ) as folder:
        readings = read_logs(requested, progress, notify)
        sources = sources_of(readings)
        taken = chosen([source.encounter for source in sources.values()], requested.encounters)
        if requested.recombine:
            taken += recombine(taken, sources, requested, notify)
        pairs = [
            (encounter, road) for encounter in taken for road in sources[encounter.name].roads
        ]
        with progress() as advance:
            cases, refusals = generate_all(pairs, requested, advance)
        cases = [
            replace(
                case,
                provenance={**case.provenance, RECORDING: sources[case.encounter.name].recording},
            )
            for case in cases
        ]
        if not cases:
            raise RefusedError("nothing could be generated:\n" + "\n".join(refusals))
        untested: list[str] = []
        if requested.request.ego:
            from scenario_gen.closed_loop.config import ClosedLoopConfig
            from scenario_gen.closed_loop.reacting import baseline_passes

            drives = ClosedLoopConfig(limits=requested.config.limits)
            untested = [sentence for case in cases if (sentence := baseline_passes(case, drives))]
        for line in (*faults_of(cases), *untested):
            notify(line)
        if record is not None:
            record(folder / BAG, cases)
        quality = [line for log, _ in readings for line in log.quality.lines()]
        write_results(
            folder,
            cases,
            title=requested.title or ", ".join(path.stem for path in requested.logs),
            quality=[*quality, *refusals, *untested],
            provenance=({"recombine": str(requested.recombine)} if requested.recombine else {})
            | provenance_of(
                requested.logs,
                requested.seed,
                requested.count,
                requested.roads,
                requested.config,
                requested.request,
            ),
        )
    return cases, refusals


def sources_of(readings: Sequence[tuple[LogResult, Sequence[str]]]) -> dict[str, Source]:
    """Return all encounters by name; of logs of one name the further ones are numbered, and so are their encounters."""
    sources: dict[str, Source] = {}
    seen: Counter[str] = Counter()
    for log, roads in readings:
        seen[log.quality.name] += 1
        number = f" ({seen[log.quality.name]})" if seen[log.quality.name] > 1 else ""
        for encounter in log.encounters:
            own = replace(encounter, name=encounter.name + number) if number else encounter
            sources[own.name] = Source(own, roads, log.quality.name + number)
    return sources


def recombine(
    recorded: Sequence[Encounter],
    sources: dict[str, Source],
    requested: FolderRequest,
    notify: Callable[[str], None],
) -> list[Encounter]:
    """Return encounters recombined of recorded ones, which are put among the sources; notify how many, and why not more."""
    made, refused = recombinations(recorded, requested.recombine, requested.seed)
    for encounter in made:
        assert isinstance(encounter.source, Recombined)
        one, other = sources[encounter.source.first], sources[encounter.source.second]
        sources[encounter.name] = Source(
            encounter, one.roads, ", ".join(dict.fromkeys((one.recording, other.recording)))
        )
    why = "; ".join(f"{count} × {cause}" for cause, count in refused.most_common())
    why = (
        f" ({why or 'no more pairs are of one kind; --recording adds some'})"
        if len(made) < requested.recombine
        else ""
    )
    notify(f"recombined encounters: {len(made)} of {requested.recombine}{why}")
    return made


def read_logs(
    requested: FolderRequest,
    progress: Callable[[], AbstractContextManager[Advance]],
    notify: Callable[[str], None],
) -> list[tuple[LogResult, Sequence[str]]]:
    """Return each log with the roads for its encounters; of several logs, those without an encounter are told and left out.

    Raises:
        InputError: a log cannot be read, or is the only one and has no encounter.
    """
    readings = []
    with progress() as advance:
        for k, (group, roads) in enumerate(requested.jobs):
            advance("logs read", k, len(requested.jobs))
            try:
                readings.append((read_log(group, requested.config.log), roads))
            except NoEncounterError as error:
                if len(requested.jobs) == 1:
                    raise
                notify(f"no encounter: {error}")  # a result; the other logs may have some
    for line in notes_of([log for log, _ in readings]):
        notify(line)
    return readings


def faults_of(cases: Sequence[GenerationResult]) -> list[str]:
    """Return what was left out of the cases' maps, because it is faulty."""
    maps = {
        case.road.name: case.road.lanes.notes
        for case in cases
        if case.road is not None and case.road.lanes is not None
    }
    return [
        f"map {name}: {note}"
        for name, notes in maps.items()
        for note in notes
        if note.kind is NoteKind.FAULTY
    ]


def notes_of(readings: Sequence[LogResult]) -> list[str]:
    """Return what there is to say about how logs were read, at most `NOTES` lines; the report has all."""
    notes = [f"{log.quality.name}: {note}" for log in readings for note in log.quality.remarks()]
    more = len(notes) - NOTES
    return (
        notes if more <= 0 else [*notes[:NOTES], f"{more} more notes on the log are in the report"]
    )


def generate_all(
    pairs: Sequence[tuple[Encounter, str]],
    requested: FolderRequest,
    advance: Advance = lambda *_: None,
) -> tuple[list[GenerationResult], list[str]]:
    """Generate scenarios of each encounter on its road; return the cases, and a sentence for each refused or incomplete one."""
    config, count, seed, request = (
        requested.config,
        requested.count,
        requested.seed,
        requested.request,
    )
    population = [encounter for encounter, _ in pairs if isinstance(encounter.source, Recorded)]
    cases: list[GenerationResult] = []
    refusals: list[str] = []
    for encounter, road in pairs:
        name = f"{encounter.name} on {Path(road).stem}"
        advance(name, 0, count)

        def report(done: int, total: int, _candidates: int, name: str = name) -> None:
            advance(name, done, total)

        def testing(
            wanted: Request, encounter: Encounter = encounter, road: str = road
        ) -> "Testing":
            from scenario_gen.closed_loop.reacting import Testing

            return Testing(encounter, road, config, wanted, seed)

        own = request
        try:
            if request.ego == EGO_AUTO:
                own = replace(request, ego=testing(request).who_reacts_most())
            if requested.for_testing:
                case = testing(own).run(count, report)
            else:
                template = [encounter, *population]
                case = generate(
                    template, road, config, count=count, seed=seed, request=own, progress=report
                )
        except RefusedError as error:
            named = replace(own, ego="") if own.ego == EGO_AUTO else own
            answer = answer_refusal(error, encounter, road, config, named, count, seed)
            refusals.append(f"{encounter.name} on {road}: {as_options(str(answer))}")
            continue
        cases.append(case)
        n_scenarios, refused = len(case.generated.scenarios), case.generated.refused
        if n_scenarios < count:
            causes = (
                ", ".join(f"{number} × {cause}" for cause, number in refused.most_common())
                or "no candidate was drawn"
            )
            causes = str(case.generated.adaptations[-1]) if requested.for_testing else causes
            refusals.append(
                f"{encounter.name} on {road}: only {n_scenarios} of {count} scenarios: {causes}"
            )
    return cases, refusals


def chosen(encounters: Sequence[Encounter], names: Sequence[str]) -> list[Encounter]:
    """Return the encounters of those names, or all.

    Raises:
        InputError: a name is unknown; the message lists the known ones.
    """
    known = {encounter.name: encounter for encounter in encounters}
    for unknown in (name for name in names if name not in known):
        raise InputError(
            f"the log has no encounter {unknown!r}; it has {', '.join(known)}{did_you_mean(unknown, known)}"
        )
    return [known[name] for name in names] or list(encounters)


def as_options(message: str) -> str:
    """Write the nearest possible request, which the nodes take as parameters, as options of the command line."""
    for parameter, option in OPTIONS.items():
        message = message.replace(parameter, option)
    return message
