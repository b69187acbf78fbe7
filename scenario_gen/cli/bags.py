# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The commands about bags of scenarios: measure, check, drive, export, import, save, compare."""

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

import typer

from scenario_gen.base.errors import InputError, printable
from scenario_gen.cli.options import configured, ParametersOption, remind, say, SetOption

if TYPE_CHECKING:
    from scenario_gen.closed_loop.command import RunTrials

commands = typer.Typer()
NAMED = 12  # scenarios that the terminal names
NAMED = 12  # scenarios that the terminal names


@commands.command()
def evaluate(
    bag: Annotated[Path, typer.Argument(help="a bag with tracks and scenarios, ours or not")],
    out: Annotated[Path | None, typer.Option(help="folder for report.html, evaluation.json and evaluation.md")] = None,
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Measure the scenarios of a bag against the tracks in it, and check them anew."""
    from rich.markdown import Markdown

    from scenario_gen.base.folders import replaced_folder
    from scenario_gen.output.results import as_table, EVALUATED, write_evaluation
    from scenario_gen.output.review.evaluation import bag_results

    config = configured(parameter_file, assignments)
    remind(bag)
    inputs = [bag, *([parameter_file] if parameter_file else ())]
    with nullcontext() if out is None else replaced_folder(out, EVALUATED, inputs) as folder:
        cases = bag_results(bag, config.evaluation, config.limits, bag=config.bag)
        if folder is not None:
            write_evaluation(folder, cases, bag, config.bag)
    say(Markdown(printable(as_table(cases))), wrap=True)


@commands.command()
def validate(
    bag: Annotated[Path, typer.Argument(help="a bag with scenarios, ours or not")],
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Check every scenario of a bag at every instant; exit code 1 if one is invalid."""
    from rich.table import Table

    from scenario_gen.bags.recordings.read import NO_ENTRY
    from scenario_gen.output.review.validation import validate_bag

    config = configured(parameter_file, assignments)
    remind(bag)
    found = validate_bag(bag, config.limits, config.bag)
    for one in found:
        say(f"{one.namespace or '/'}: {one.scenarios - one.invalid} of {one.scenarios} scenarios are valid")
        table = Table("cause", "scenarios", "first", "what")
        for cause, entry in one.found.items():
            table.add_row(cause, str(entry.count), str(entry.scenario), entry.message)
        if one.found:
            say(table, wrap=True)
        if one.unaccounted:
            say(f"  {one.unaccounted} unaccounted: {NO_ENTRY}")
        for sentence in (*(f"{message}: kept by {count}" for message, count in one.proven.items()), *one.missing):
            say(f"  {sentence}")
        for sentence, count in one.left_out.items():
            say(f"  not applicable to {count}: {sentence}")
    if any(one.invalid for one in found):
        raise typer.Exit(1)


@commands.command()
def drive(
    bag: Annotated[Path, typer.Argument(help="a bag of this suite with scenarios")],
    planner: Annotated[
        str,
        typer.Option(
            help="MODULE:CLASS of the planner, e.g. scenario_gen.closed_loop.planners:IdmFollower; with --ros its command"
        ),
    ],
    ego: Annotated[
        str, typer.Option(help="id of the vehicle in whose place it drives; if not given, that of the ego slot, or the first")
    ] = "",
    ros: Annotated[
        bool, typer.Option("--ros", help="drive over DDS in lock-step: the planner is a node that answers each odometry")
    ] = False,
    count: Annotated[int, typer.Option(min=0, help="scenarios at most; 0: all")] = 0,
    workers: Annotated[int, typer.Option(min=0, help="processes; 0: one for each core")] = 0,
    against: Annotated[
        Path | None,
        typer.Option(help="drives.json of another planner or version on the same bag: compare; exit code 1 if this one is worse"),
    ] = None,
    unlooking: Annotated[
        bool, typer.Option(help="also drive a planner that looks at nobody: how many scenarios does it pass?")
    ] = True,
    out: Annotated[Path, typer.Option(help="folder of drives.json, junit.xml and drives.html")] = Path("out/drives"),
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", help="a parameter of the drive (step, policy, …) or a bar (bars.collisions, …), as name=value"),
    ] = None,
) -> None:
    """Test a planner in closed loop in every scenario of a bag; exit code 1 if a bar is not kept."""
    from rich.table import Table

    from scenario_gen.base.terminal import progress_bars
    from scenario_gen.closed_loop.command import drive_bag, in_processes

    remind(bag)
    with progress_bars() as advance:
        result = drive_bag(
            bag,
            planner,
            ego=ego,
            count=count,
            out=out,
            assignments=assignments or [],
            progress=lambda done, total: advance(planner, done, total),
            run=_over_dds() if ros else in_processes(workers),
            unlooking=in_processes(workers) if unlooking else None,
            against=against,
        )
    table = Table("drives", planner)
    for name, rate in result.found.items():
        table.add_row(name, str(rate))
    say(table, wrap=True)
    for note in result.notes:
        say(note)
    if comparison := result.beside.comparison:
        for title, names in (("now fail", comparison.now_fail), ("now pass", comparison.now_pass)):
            if names:
                more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
                say(f"{title}: {', '.join(names[:NAMED])}{more}")
    if result.decisions.count:
        took = result.decisions
        slow = f"{took.slow} of {took.count} slower than decision_time, the longest {took.longest:.3f} s"
        say(f"decisions: {slow} (of this machine, so in no file)")
    for outcome in result.worst:
        say(f"scenario {outcome.name}: {outcome.verdict.sentence()}")
    for path in result.written:
        say(str(path))
    if result.broken:
        say("bars not kept: " + "; ".join(result.broken))
        raise typer.Exit(1)


def _over_dds() -> "RunTrials":
    """Return what drives over DDS.

    Raises:
        InputError: ROS 2 is not in this environment.
    """
    try:
        from scenario_gen.cli.drive import drive_over_dds
    except ImportError as error:
        raise InputError(f"ROS 2 is not in this environment ({error}); source it, or leave --ros out") from error
    return drive_over_dds


@commands.command("export")
def export_scenarios(
    bag: Annotated[Path, typer.Argument(help="a bag with scenarios, ours or not")],
    to: Annotated[str, typer.Option(help="commonroad, openscenario (with OpenDRIVE) or autoware")],
    out: Annotated[Path | None, typer.Option(help="folder of the files; BAG_commonroad, … beside the bag if not given")] = None,
    index: Annotated[
        list[int] | None, typer.Option(min=0, help="of a scenario, as in scenarios/info (default: all); repeatable")
    ] = None,
    namespace: Annotated[str | None, typer.Option(help="only the scenarios of this one")] = None,
    ego: Annotated[str, typer.Option(help="id of a vehicle that becomes the ego: CommonRoad's planning problem, …")] = "",
    options: Annotated[
        list[str] | None,
        typer.Option("--set", help="run_out, step, goal_length, goal_width, goal_late, late, following, bag.…, as name=value"),
    ] = None,
) -> None:
    """Write scenarios for other software: CommonRoad, OpenSCENARIO with OpenDRIVE, Autoware; same bag, same bytes."""
    from scenario_gen.bags.storage.config import BagConfig
    from scenario_gen.base.parameters import assigned
    from scenario_gen.output.exchange.config import ExportConfig
    from scenario_gen.output.exchange.export import export_bag, EXPORTS

    if to not in EXPORTS:
        raise InputError(f"--to {to!r} is none of {', '.join(EXPORTS.names())}")
    config, bag_config = ExportConfig(ego=ego), BagConfig()
    for option in options or []:
        if option.startswith("bag."):
            bag_config = assigned(bag_config, option.removeprefix("bag."))
        else:
            config = assigned(config, option)
    remind(bag)
    folder = out or bag.resolve().with_name(f"{bag.resolve().name}_{to}")
    result = export_bag(bag, folder, to, config, bag_config, namespace=namespace, indices=index or ())
    say("\n".join((*result.notes, f"{result.scenarios} scenarios: {folder}")))


@commands.command("import")
def import_scenario(
    file: Annotated[Path, typer.Argument(help="a CommonRoad XML file or an OpenSCENARIO XML file with timed polylines")],
    out: Annotated[Path | None, typer.Option(help="the new table; the file's name with .csv if not given")] = None,
) -> None:
    """Make a log of the trajectories in a CommonRoad or OpenSCENARIO file, for `generate` to read."""
    from scenario_gen.output.exchange.importing import import_file

    target = out or file.with_suffix(".csv")
    result = import_file(file, target)
    rows = sum(len(track.rows) for track in result.tracks)
    say("\n".join((*result.notes, f"{len(result.tracks)} vehicles, {rows} rows: {target}")))


@commands.command("reindex")
def save_bag(
    bag: Annotated[Path, typer.Argument(help="folder of a bag that was not closed or is damaged, or one of its MCAP files")],
    out: Annotated[Path | None, typer.Option(help="folder of the new bag; BAG_reindexed if not given")] = None,
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Save the messages that are whole in a bag that was not closed or is damaged; the old files stay as they are."""
    from scenario_gen.bags.storage.reindex import reindex

    target = out or bag.resolve().with_name(f"{bag.resolve().name}_reindexed")
    result = reindex(bag, target, configured(parameter_file, assignments).bag)
    for line in (f"{result.messages} messages: {target}", *result.lines()):
        say(line)


@commands.command("compare")
def compare_sets(
    first: Annotated[Path, typer.Argument(help="results folder, or its evaluation.json")],
    second: Annotated[Path, typer.Argument(help="another one")],
) -> None:
    """Put two sets of scenarios side by side: two seeds, two parameters, two versions."""
    from rich.markdown import Markdown

    from scenario_gen.method.evaluation import compare, comparison_table, read_evaluations

    differences = compare(read_evaluations(first), read_evaluations(second))
    say(Markdown(printable(comparison_table(differences, (first.name, second.name)))), wrap=True)
