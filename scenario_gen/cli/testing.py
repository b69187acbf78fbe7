# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The commands that test a planner: drive it in scenarios, and search for its failures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

import typer

from scenario_gen.base.errors import InputError
from scenario_gen.cli.options import (
    bag_at,
    Commands,
    OUT,
    SeedOption,
    takes,
    WorkersOption,
)
from scenario_gen.cli.output import emit_json, print_, print_table, progress

if TYPE_CHECKING:
    from scenario_gen.closed_loop.command import RunTrials
    from scenario_gen.closed_loop.comparison import Comparison
    from scenario_gen.closed_loop.results import Drives
    from scenario_gen.closed_loop.search.command import SearchResult
    from scenario_gen.closed_loop.suite import Suite
    from scenario_gen.output.review.replan import Replanned

commands = Commands("Test a planner")
MAX_NAMES_COUNT = 12  # of changed scenarios, on the terminal


@dataclass(frozen=True)
class Drive:
    """The options of `drive`."""

    bags: Annotated[
        list[Path],
        typer.Argument(
            help="Bags with scenarios from this suite, folders with such bags (as from `batch`), "
            "or text files with a path per line. Repeatable."
        ),
    ]
    planner: Annotated[
        list[str],
        typer.Option(
            help="MODULE:CLASS of the planner, e.g. mine:MyPlanner, or IdmFollower. With --ros: "
            "the command that starts its node. Repeatable: planners side by side.",
        ),
    ]
    ego: Annotated[
        str,
        typer.Option(
            help="Id of the vehicle that the planner drives. Default: the one left out with "
            "--ego, or the first."
        ),
    ] = ""
    ros: Annotated[
        bool,
        typer.Option(
            "--ros",
            help="The planner is a ROS 2 node that answers each odometry message with a command, "
            "over DDS in lock-step.",
        ),
    ] = False
    count: Annotated[int, typer.Option(min=0, help="Number of scenarios of each bag. 0: all.")] = 0
    workers: WorkersOption = 0
    mutants: Annotated[
        bool,
        typer.Option(
            "--mutants",
            help="Also drive the planner with single faults, and report which of them are caught.",
        ),
    ] = False
    repeat: Annotated[
        int,
        typer.Option(
            min=1,
            max=10,
            help="Drive each scenario so many times. Exit code 1 if the drives differ.",
        ),
    ] = 1
    against: Annotated[
        Path | None,
        typer.Option(
            help="drives.json of another planner on the same bag. Exit code 1 if this planner is "
            "worse."
        ),
    ] = None
    baseline: Annotated[
        bool,
        typer.Option(
            help="Also drive the non-reactive baseline, to count scenarios that need no reaction."
        ),
    ] = True
    out: Annotated[
        Path, typer.Option(*OUT, help="Folder for verdicts (drives.json, junit.xml) and pages.")
    ] = Path("out/drives")
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="Set a parameter of the drive (step, policy, …) or a threshold "
            "(bars.collisions, …), as name=value.",
        ),
    ] = None


@commands.command()
@takes(Drive)
def drive(options: Drive) -> None:
    """Test planners in closed loop in the scenarios of bags. Exit code 1: below a threshold."""
    from scenario_gen.closed_loop.command import drive_bags, DriveRequest

    if options.mutants and options.ros:
        raise InputError("--mutants: faults are put around a Python planner; leave out --ros")
    request = DriveRequest(
        [bag_at(bag) for bag in options.bags],
        options.planner,
        options.ego,
        options.count,
        [f"repeat={options.repeat}", *(options.assignments or [])],
        options.against,
        options.baseline,
        options.mutants,
        options.workers,
    )
    name = options.planner[0] if len(options.planner) == 1 else "drives"
    with progress() as advance:
        result = drive_bags(
            request,
            options.out,
            progress=lambda done, total: advance(name, done, total),
            run=_over_dds() if options.ros else None,
        )
    _report(result, options.out)
    if result.broken:
        print_("thresholds not met: " + "; ".join(result.broken))
        raise typer.Exit(1)


def _report(suite: "Suite", out: Path) -> None:
    """Print the tables, notes and files."""
    files = sorted(path for path in out.iterdir() if not path.name.startswith("."))
    _print_tables(suite, files)
    print_(*suite.notes(), sep="\n")
    for drives in suite.drives:
        _print_comparison(drives.comparison)
    _print_durations(suite)
    for drives in suite.drives:
        if drives.mutants is not None:
            rows = [(each.fault, str(each)) for each in drives.mutants.results]
            print_table(("fault", drives.planner), rows)
    if len(suite.drives) == 1:
        _print_failures(suite.drives[0])
    print_(*map(str, files), sep="\n")


def _print_tables(suite: "Suite", files: Sequence[Path]) -> None:
    from scenario_gen.closed_loop.trials import rates

    tables = [rates(drives.outcomes) for drives in suite.drives]
    names = suite.planners
    shown: object = dict(zip(names, tables, strict=True))
    if len(tables) == 1:
        shown, names = tables[0], [suite.drives[0].planner]
    emit_json(rates=shown, notes=suite.notes(), bars_not_met=suite.broken, files=files)
    rows = [(name, *(str(table[name]) for table in tables)) for name in tables[0]]
    print_table(("drives", *names), rows)
    if not suite.is_single:
        print_table(
            ("encounter", "road user", *(f"{name} passes" for name in suite.planners)),
            [(*row.category, *map(str, row.passed)) for row in suite.table()],
            names=2,
        )


def _print_durations(suite: "Suite") -> None:
    from scenario_gen.closed_loop.timeouts import Decisions

    outcomes = [outcome for drives in suite.drives for outcome in drives.outcomes]
    decisions = Decisions.all_of([outcome.decisions for outcome in outcomes])
    if decisions.count:
        print_(
            f"planner step: {1e3 * decisions.longest:.0f} ms at most; {decisions.slow} of "
            f"{decisions.count} exceed the step (not written to files)"
        )


def _print_failures(drives: "Drives") -> None:
    outcomes = [drives.outcomes[k] for k in drives.by_severity()]
    failures = [outcome for outcome in outcomes if not outcome.verdict.passed]
    for outcome in failures[:5]:
        print_(f"scenario {outcome.name}: {outcome.verdict.sentence()}")


def _print_comparison(comparison: "Comparison | None") -> None:
    if comparison is not None:
        emit_json(now_fail=comparison.now_fail, now_pass=comparison.now_pass)
        _print_names("now fail", comparison.now_fail)
        _print_names("now pass", comparison.now_pass)


def _print_names(title: str, names: Sequence[str]) -> None:
    if names:
        rest = len(names) - MAX_NAMES_COUNT
        more = f" and {rest} more" if rest > 0 else ""
        print_(f"{title}: {', '.join(names[:MAX_NAMES_COUNT])}{more}")


def _over_dds() -> "RunTrials":
    """Return the function that drives over DDS.

    Raises:
        InputError: ROS 2 is not installed.
    """
    try:
        from scenario_gen.cli.drive import drive_over_dds
    except ImportError as error:
        raise InputError(
            f"ROS 2 is not available ({error}); source its setup file, or leave out --ros"
        ) from error
    return drive_over_dds


@dataclass(frozen=True)
class Search:
    """The options of `search`."""

    source: Annotated[
        Path,
        typer.Argument(
            help="A bag from `generate` with recording, road and parameters, or a log with --road."
        ),
    ]
    planner: Annotated[
        str,
        typer.Option(
            help="MODULE:CLASS of the planner, e.g. mine:MyPlanner, or IdmFollower.",
        ),
    ]
    budget: Annotated[
        int,
        typer.Option(
            min=1,
            max=10_000_000,
            help="Number of drives. A larger budget continues an earlier search.",
        ),
    ] = 1000
    road: Annotated[str, typer.Option(help="Road, if the source is a log.")] = ""
    encounter: Annotated[
        str, typer.Option(help="Name of the encounter, if the source is a log with several.")
    ] = ""
    objective: Annotated[
        str,
        typer.Option(
            help="Definition of a failure: at_fault, collision, off_road, goal, or e.g. "
            "'ttc<1.5', 'pet<1' (s), 'imposed_braking>3' (m/s²), or a criterion: its name or "
            "MODULE:CLASS."
        ),
    ] = "at_fault"
    ego: Annotated[
        str,
        typer.Option(
            help="Id of the vehicle that the planner drives. Default: the one left out with "
            "--ego, or the first."
        ),
    ] = ""
    worst: Annotated[
        bool,
        typer.Option("--worst", help="Search for the worst failure instead of the failure rate."),
    ] = False
    max_rate: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=1.0,
            help="Exit code 1 if the upper bound of the failure rate (95 %) exceeds this.",
        ),
    ] = None
    namespace: Annotated[
        str | None, typer.Option(help="Namespace of the scenarios, if the bag has several.")
    ] = None
    seed: SeedOption = 0
    workers: WorkersOption = 0
    out: Annotated[
        Path,
        typer.Option(
            *OUT, help="Folder for search.json, search.html, junit.xml and the bag of failures."
        ),
    ] = Path("out/search")
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="Set a parameter of the drive (step, policy, …), as name=value."
        ),
    ] = None


def drawn_from(options: Search) -> "Replanned":
    """Return the source of scenarios: a bag's template and road, or an encounter from a log.

    Raises:
        InputError: source, road or encounter cannot be read, or the log has several encounters
            and none was chosen.
        RefusedError: the encounter does not fit the road.
    """
    from scenario_gen.base.folders import scratch
    from scenario_gen.cli.folder import FolderRequest, generate_folder
    from scenario_gen.output.results import BAG
    from scenario_gen.output.review.replan import replanned
    from scenario_gen.pipeline import PipelineConfig

    if not options.road:
        return replanned(options.source, options.namespace)
    names = [options.encounter] if options.encounter else []
    request = FolderRequest(
        [([options.source], [options.road])],
        PipelineConfig(),
        count=1,
        seed=options.seed,
        encounters=names,
    )
    with scratch() as place:
        cases, _ = generate_folder(place / "one", request)
        if len(cases) > 1:
            known = " or ".join(case.encounter.name for case in cases)
            raise InputError(
                f"{options.source}: {len(cases)} encounters; choose one: --encounter {known}"
            )
        return replanned(place / "one" / BAG, options.namespace)


@commands.command()
@takes(Search)
def search(options: Search) -> None:
    """Search for scenarios in which a planner fails, and estimate its failure rate."""
    from scenario_gen.closed_loop.search.command import JOURNAL, search_failures, SearchRequest
    from scenario_gen.closed_loop.search.objective import Objective

    if options.worst and options.max_rate is not None:
        raise InputError(
            "--max-rate: a search for the worst failure estimates no rate; omit one of both"
        )
    source = drawn_from(replace(options, source=bag_at(options.source)))
    request = SearchRequest(
        source.planned,
        source.request,
        source.sampling,
        source.limits,
        options.planner,
        options.ego,
        Objective.parsed(options.objective),
        options.budget,
        options.seed,
        options.worst,
        options.assignments or [],
    )
    print_(
        f"drives are stored in {options.out}{JOURNAL}; the same command continues a stopped search"
    )
    with progress() as advance:
        result = search_failures(
            request,
            options.out,
            workers=options.workers,
            progress=lambda done, total: advance("drives", done, total),
        )
    emit_json(
        rate=result.estimate.rate,
        failures=len(result.findings),
        sentences=result.sentences(),
        files=result.written,
    )
    _print_findings(result)
    if result.findings:
        print_(
            f"as a regression test: scenario-gen drive {options.out / 'bag'} "
            f"--planner {options.planner} --ego {request.ego_id()}"
        )
    if options.max_rate is not None and not result.estimate.bound <= options.max_rate:
        print_(
            f"the failure rate may exceed {options.max_rate:g}: its upper bound is "
            f"{result.estimate.bound:.3g} (95 %)"
        )
        raise typer.Exit(1)


def _print_findings(result: "SearchResult") -> None:
    """Print the estimate, the kinds of failures and the written files."""
    print_(*result.sentences(), sep="\n")
    if result.findings:
        rows = [
            (
                kind,
                str(len(findings)),
                f"drive {findings[0].trial.name}: {findings[0].outcome.verdict.sentence()}",
            )
            for kind, findings in result.kinds.items()
        ]
        print_table(("kind of failure", "shown", "most likely"), rows)
    print_(*map(str, result.written), sep="\n")
