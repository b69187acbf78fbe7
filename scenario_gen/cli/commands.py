# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The command line: options, calls into the library, and what is printed; libraries are loaded by the command that needs them."""

from contextlib import nullcontext, suppress
import os
from pathlib import Path
import sys
from typing import Annotated, Any, NoReturn, TYPE_CHECKING

import typer

from scenario_gen.base.errors import InputError, of_system, presentable, printable, RefusedError, ScenarioGenError
from scenario_gen.cli.corpus import commands as corpus_commands

if TYPE_CHECKING:
    from scenario_gen.closed_loop.command import OverDds
    from scenario_gen.pipeline import PipelineConfig
    from scenario_gen.types import GenerationResult

app = typer.Typer(
    help="Turn recorded vehicle encounters into new, valid ones on other roads.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

app.add_typer(corpus_commands)

LogArgument = Annotated[list[Path], typer.Argument(help="CSV, Parquet, SPMD files, or a rosbag2 bag (MCAP or SQLite)")]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", help="one parameter, as name=value; `scenario-gen parameters` lists them")
]
ParametersOption = Annotated[Path | None, typer.Option("--params", help="a parameter file, e.g. config/default.yaml")]


def say(*what: Any, sep: str = " ", wrap: bool = False) -> None:
    """Print to standard output: texts letter by letter, and what rich can draw; `wrap` breaks lines at the terminal's width."""
    from scenario_gen.base.terminal import Terminal

    Terminal().print(*what, sep=sep, soft_wrap=not wrap)


def configured(file: Path | None, assignments: list[str] | None) -> "PipelineConfig":
    """Return the pipeline's configuration: defaults, then the file, then each `name=value`.

    Raises:
        InputError: the file cannot be read, a name is unknown or a value does not suit; the message names it.
    """
    from scenario_gen.base.parameters import assigned, loaded
    from scenario_gen.pipeline import PipelineConfig

    config = PipelineConfig() if file is None else loaded(PipelineConfig(), file)
    for assignment in assignments or []:
        config = assigned(config, assignment)
    return config


def obstructed(config: "PipelineConfig", obstacles: list[str] | None) -> "PipelineConfig":
    """Return the configuration with more obstacles on its roads.

    Raises:
        InputError: one is not of the form; the message names it.
    """
    from scenario_gen.base.parameters import updated
    from scenario_gen.roads import read_obstacles

    for text in obstacles or []:
        read_obstacles(text, "--obstacle")
    return updated(config, {"road.obstacles": "; ".join(filter(None, [config.road.obstacles, *(obstacles or [])]))})


@app.command()
def parameters() -> None:
    """List every parameter with its default, unit, range and meaning."""
    from rich.text import Text

    from scenario_gen.base.parameters import flatten
    from scenario_gen.pipeline import PipelineConfig

    for name, (entry, value) in flatten(PipelineConfig()).items():
        meta = entry.metadata
        bounds = [str(meta[end]) if meta[end] is not None else "" for end in ("low", "high")]
        allowed = " | ".join(meta["choices"]) or ("…".join(bounds) if any(bounds) else "")
        text = f" = {value!r} {meta['unit']} {f'({allowed})' if allowed else ''}\n    {meta['meaning']}"
        say(Text(name, style="bold"), text, sep="", wrap=True)


@app.command()
def generate(
    log: LogArgument,
    road: Annotated[
        list[str],
        typer.Option(
            help="straight, curve, t_intersection, four_way, merge, roundabout, corridor, or a nav2 map's YAML; repeatable"
        ),
    ],
    count: Annotated[int, typer.Option(min=1, help="scenarios per encounter and road")] = 50,
    seed: Annotated[int, typer.Option(min=0, help="same seed, same scenarios")] = 0,
    out: Annotated[Path, typer.Option(help="folder of the results")] = Path("out/generated"),
    encounter: Annotated[
        list[str] | None, typer.Option(help="name of an encounter of the log (default: all); repeatable")
    ] = None,
    ego: Annotated[
        str,
        typer.Option(help="id of a vehicle to leave out for a planner under test; its start, goal and track are given instead"),
    ] = "",
    start: Annotated[
        list[str] | None, typer.Option(help=r"a vehicle's start state, 'id: x y yaw \[speed]', on the road; repeatable")
    ] = None,
    goal: Annotated[list[str] | None, typer.Option(help="a vehicle's end state, likewise; repeatable")] = None,
    target: Annotated[
        list[str] | None,
        typer.Option(
            help=r"a range, e.g. 'pet=0.5..1.5' or 'ttc\[1,2]=1..2', of pet, ttc, gap, arrival_gap, closing_speed; repeatable"
        ),
    ] = None,
    choose: Annotated[
        str, typer.Option(help="natural: as sampled; diverse: of many valid candidates those that cover best")
    ] = "natural",
    order: Annotated[
        str, typer.Option(help="who goes first: keep (as in the template), free, swap (the other one at the closest crossing)")
    ] = "keep",
    allow: Annotated[str, typer.Option(help="lost_conflict: a place where vehicles that meet in the template do not")] = "",
    obstacle: Annotated[
        list[str] | None,
        typer.Option(help="something in the way, 'x y yaw length width' on the road, e.g. a parked car; repeatable"),
    ] = None,
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Generate new encounters from a log: bag, report and figures in one folder."""
    from scenario_gen.base.terminal import progress_bars
    from scenario_gen.cli.batch import generate_folder
    from scenario_gen.types import Request

    cases, refusals = generate_folder(
        out,
        [(log, road)],
        obstructed(configured(parameter_file, [*(assignments or []), *([f"fitting.allow={allow}"] if allow else [])]), obstacle),
        count=count,
        seed=seed,
        encounters=encounter or [],
        request=Request(ego, "; ".join(start or []), "; ".join(goal or []), "; ".join(target or []), choose, order),
        also_read=[parameter_file] if parameter_file else [],
        progress=progress_bars,
    )
    conclude(cases, refusals, out)


@app.command()
def regenerate(
    bag: Annotated[Path, typer.Argument(help="a bag of this suite, written by generate or recorded from the nodes")],
    index: Annotated[int, typer.Argument(help="the scenario's index, as in scenarios/info", min=0)],
    out: Annotated[Path | None, typer.Option(help="folder of a bag for this one scenario, with its template and road")] = None,
    namespace: Annotated[str | None, typer.Option(help="where several hold that index")] = None,
    request: Annotated[str | None, typer.Option(help="id of the request, where several hold that index")] = None,
    log: Annotated[
        Path | None, typer.Option(help="make it from this raw log, not from the bag's tracks and changepoints")
    ] = None,
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Make one published scenario again, bit for bit, and compare it with its recorded SHA-256."""
    from scenario_gen.output.review.regenerate import regenerate_scenario, write_regenerated

    remind(bag)
    config = configured(parameter_file, assignments).bag
    made = regenerate_scenario(bag, index, namespace=namespace, request=request, log=log, config=config)
    say(f"scenario {index}: the same {len(made.data)} bytes, sha256 {made.sha256}")
    if out is not None:
        say(f"bag: {write_regenerated(made, out, [bag, *([log] if log else ())])}")


@app.command()
def demo(
    count: Annotated[int, typer.Option(min=1, help="scenarios per case and road")] = 50,
    seed: Annotated[int, typer.Option(min=0, help="same seed, same scenarios")] = 7,
    out: Annotated[Path, typer.Option(help="folder of the results")] = Path("out/demo"),
    ros: Annotated[bool, typer.Option("--ros", help="generate with the ROS nodes, over DDS, into the bag")] = False,
) -> None:
    """Run the main job on the bundled synthetic log: the paper's three cases, on a T-intersection and a straight road."""
    from scenario_gen.base.terminal import progress_bars, status_line
    from scenario_gen.cli.demo import run_demo

    cases, refusals = run_demo(out, count=count, seed=seed, ros=ros, progress=progress_bars, status=status_line)
    if ros:
        total = sum(len(case.generated.scenarios) for case in cases)
        say(f"{total} scenarios from the nodes, recorded over DDS: the same bytes as in this process")
    conclude(cases, refusals, out)


@app.command()
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


@app.command()
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
        for sentence in (*(f"{said}: kept by {count}" for said, count in one.proven.items()), *one.missing):
            say(f"  {sentence}")
        for sentence, count in one.left_out.items():
            say(f"  not applicable to {count}: {sentence}")
    if any(one.invalid for one in found):
        raise typer.Exit(1)


@app.command()
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
    out: Annotated[Path, typer.Option(help="folder of drives.json, junit.xml and drives.html")] = Path("out/drives"),
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", help="a parameter of the drive (step, policy, …) or a bar (bars.collisions, …), as name=value"),
    ] = None,
) -> None:
    """Test a planner in closed loop in every scenario of a bag; exit code 1 if a bar is not kept."""
    from rich.table import Table

    from scenario_gen.base.terminal import progress_bars
    from scenario_gen.closed_loop.command import drive_bag

    remind(bag)
    with progress_bars() as advance:
        result = drive_bag(
            bag,
            planner,
            ego=ego,
            count=count,
            workers=workers,
            out=out,
            assignments=assignments or [],
            progress=lambda done, total: advance(planner, done, total),
            over_dds=_over_dds() if ros else None,
        )
    table = Table("drives", planner)
    for name, rate in result.found.items():
        table.add_row(name, str(rate))
    say(table, wrap=True)
    for outcome in result.worst:
        say(f"scenario {outcome.name}: {outcome.verdict.sentence()}")
    for path in result.written:
        say(str(path))
    if result.broken:
        say("bars not kept: " + "; ".join(result.broken))
        raise typer.Exit(1)


def _over_dds() -> "OverDds":
    """Return what drives over DDS.

    Raises:
        InputError: ROS 2 is not in this environment.
    """
    try:
        from scenario_gen.ros.plumbing.drive_over_dds import drive_over_dds
    except ImportError as error:
        raise InputError(f"ROS 2 is not in this environment ({error}); source it, or leave --ros out") from error
    return drive_over_dds


@app.command("export")
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
    from scenario_gen.output.exchange.export import export_bag, TARGETS

    if to not in TARGETS:
        raise InputError(f"--to {to!r} is none of {', '.join(TARGETS)}")
    config, bag_config = ExportConfig(ego=ego), BagConfig()
    for option in options or []:
        if option.startswith("bag."):
            bag_config = assigned(bag_config, option.removeprefix("bag."))
        else:
            config = assigned(config, option)
    remind(bag)
    folder = out or bag.resolve().with_name(f"{bag.resolve().name}_{to}")
    made = export_bag(bag, folder, to, config, bag_config, namespace=namespace, indices=index or ())
    say("\n".join((*made.notes, f"{made.scenarios} scenarios: {folder}")))


@app.command("import")
def import_scenario(
    file: Annotated[Path, typer.Argument(help="a CommonRoad XML file or an OpenSCENARIO XML file with timed polylines")],
    out: Annotated[Path | None, typer.Option(help="the new table; the file's name with .csv if not given")] = None,
) -> None:
    """Make a log of the trajectories in a CommonRoad or OpenSCENARIO file, for `generate` to read."""
    from scenario_gen.output.exchange.importing import import_file

    target = out or file.with_suffix(".csv")
    made = import_file(file, target)
    rows = sum(len(track.rows) for track in made.tracks)
    say("\n".join((*made.notes, f"{len(made.tracks)} vehicles, {rows} rows: {target}")))


@app.command("reindex")
def save_bag(
    bag: Annotated[Path, typer.Argument(help="folder of a bag that was not closed or is damaged, or one of its MCAP files")],
    out: Annotated[Path | None, typer.Option(help="folder of the new bag; BAG_reindexed if not given")] = None,
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Save the messages that are whole in a bag that was not closed or is damaged; the old files stay as they are."""
    from scenario_gen.bags.storage.reindex import reindex

    target = out or bag.resolve().with_name(f"{bag.resolve().name}_reindexed")
    made = reindex(bag, target, configured(parameter_file, assignments).bag)
    for line in (f"{made.messages} messages: {target}", *made.lines()):
        say(line)


@app.command()
def doctor() -> None:
    """Say what is wrong with this environment: Python, packages, ROS, DDS, QoS of visible topics, kernels."""
    from scenario_gen.ros.plumbing.doctor import main as examined

    raise typer.Exit(examined())


@app.command("compare")
def compare_sets(
    first: Annotated[Path, typer.Argument(help="results folder, or its evaluation.json")],
    second: Annotated[Path, typer.Argument(help="another one")],
) -> None:
    """Put two sets of scenarios side by side: two seeds, two parameters, two versions."""
    from rich.markdown import Markdown

    from scenario_gen.method.evaluation import compare, comparison_table, read_evaluations

    differences = compare(read_evaluations(first), read_evaluations(second))
    say(Markdown(printable(comparison_table(differences, (first.name, second.name)))), wrap=True)


def remind(bag: Path) -> None:
    """Say what is missing of a bag that is read all the same."""
    from scenario_gen.bags.storage.files import remarks

    for remark in remarks(bag):
        say(remark)


def conclude(cases: "list[GenerationResult]", refusals: list[str], out: Path) -> None:
    """Print the summary.

    Raises:
        RefusedError: anything asked for is missing.
    """
    from scenario_gen.output.report.summary import summary
    from scenario_gen.output.results import BAG, REPORT

    say(summary(cases), wrap=True)
    say(f"report: {out / REPORT}\nbag:    {out / BAG}")
    if refusals:
        raise RefusedError("not everything that was asked for could be had:\n" + "\n".join(refusals))


def refuse_undecodable(words: list[str]) -> None:
    """Refuse names that could not be written to a result.

    Raises:
        InputError: one is no UTF-8 text.
    """
    for word in words:
        if any("\ud800" <= letter <= "\udfff" for letter in word):
            raise InputError(f"{word}: a name that is no UTF-8 text cannot go into a bag or a page; rename the file")


def main() -> None:
    """Run the command line; an error of ours, or of the system, is one message and an exit code, never a traceback."""
    try:
        try:
            refuse_undecodable(sys.argv[1:])
            app()
        finally:
            sys.stdout.flush()
    except ScenarioGenError as error:
        fail(error)
    except MemoryError:
        fail(InputError("there is not enough memory; take less at once: a shorter log, fewer scenarios, a smaller map"))
    except BrokenPipeError:
        sys.stdout = open(os.devnull, "w")  # noqa: PTH123, SIM115 - nobody listens any more
        sys.exit(1)
    except OSError as error:
        fail(of_system(error, error.filename or "standard output, or a file that the system does not name"))


def fail(error: ScenarioGenError) -> NoReturn:
    """Say what is wrong and end."""
    from rich.text import Text

    from scenario_gen.base.terminal import Terminal

    with suppress(OSError):
        Terminal(stderr=True).print(Text("error:", style="bold red"), presentable(str(error)), soft_wrap=True)
    try:
        sys.stdout.flush()
    except OSError:  # a full disk, or nobody listens: what is left goes nowhere, so that the interpreter ends in peace
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
