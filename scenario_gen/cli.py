# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The command line: `scenario-gen generate`, `scenario-gen demo`; a thin layer over the pipeline."""

from contextlib import nullcontext, suppress
from functools import partial
import os
from pathlib import Path
import sys
from typing import Annotated, NoReturn

from rich.markdown import Markdown
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text
import typer

from msg_conventions.scenarios import encode_scenario
from scenario_gen.bags import read_messages, reindex
from scenario_gen.bags.belonging import UNTOLD
from scenario_gen.bags.evaluation import bag_cases
from scenario_gen.bags.regenerate import regenerate_scenario, write_regenerated
from scenario_gen.bags.validation import validate_bag
from scenario_gen.encounter import Encounter
from scenario_gen.errors import InputError, of_system, presentable, printable, RefusedError, ScenarioGenError
from scenario_gen.evaluation import Case, comparison_table, read_evaluations
from scenario_gen.evaluation import compare as compare_sets
from scenario_gen.evaluation.summary import summary
from scenario_gen.folders import replaced_folder
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.parameters import assigned, flatten, loaded
from scenario_gen.pipeline import generate as run_pipeline
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.requests import Request
from scenario_gen.results import (
    as_table,
    BAG,
    EVALUATED,
    GENERATED,
    namespaces,
    provenance_of,
    REPORT,
    write_evaluation,
    write_results,
)
from scenario_gen.storage import remark
from scenario_gen.terminal import Terminal

app = typer.Typer(
    help="Turn recorded vehicle encounters into new, valid ones on other roads.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
console = Terminal()

DEMO = (("a", "t_intersection"), ("b", "t_intersection"), ("c", "straight"))

LogArgument = Annotated[list[Path], typer.Argument(help="CSV, Parquet, SPMD files, or a rosbag2 bag (MCAP or SQLite)")]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", help="one parameter, as name=value; `scenario-gen parameters` lists them")
]
ParametersOption = Annotated[Path | None, typer.Option("--params", help="a parameter file, e.g. config/default.yaml")]


def configured(parameters: Path | None, assignments: list[str]) -> PipelineConfig:
    """Return the pipeline's configuration: defaults, then the file, then each `name=value`.

    Raises:
        InputError: the file cannot be read, a name is unknown or a value does not suit; the message names it.
    """
    config = PipelineConfig()
    if parameters is not None:
        config = loaded(config, parameters)
    for assignment in assignments:
        config = assigned(config, assignment)
    return config


@app.command()
def parameters() -> None:
    """List every parameter with its default, unit, range and meaning."""
    for name, (entry, value) in flatten(PipelineConfig()).items():
        meta = entry.metadata
        bounds = [str(meta[end]) if meta[end] is not None else "" for end in ("low", "high")]
        allowed = " | ".join(meta["choices"]) or ("…".join(bounds) if any(bounds) else "")
        console.print(
            Text(name, style="bold"),
            f" = {value!r} {meta['unit']} {f'({allowed})' if allowed else ''}\n    {meta['meaning']}",
            sep="",
        )


@app.command()
def generate(
    log: LogArgument,
    road: Annotated[
        list[str], typer.Option(help="straight, t_intersection, four_way, corridor, or a nav2 map's YAML; repeatable")
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
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Generate new encounters from a log: bag, report and figures in one folder."""
    config = configured(parameter_file, assignments or [])
    request = Request(ego, "; ".join(start or []), "; ".join(goal or []))
    inputs = [*log, *map(Path, road), *([parameter_file] if parameter_file else ())]
    with replaced_folder(out, GENERATED, inputs) as partial_out:
        found = read_log(log, config.log)
        templates = chosen(found.encounters, encounter or [])
        cases, refusals = run_all(templates, road, config, count=count, seed=seed, request=request)
        if not cases:
            raise RefusedError("nothing could be generated:\n" + "\n".join(refusals))
        write_results(
            partial_out,
            cases,
            seed=seed,
            title=", ".join(path.stem for path in log),
            quality=(*found.quality.lines(), *refusals),
            provenance=provenance_of(log, seed, count, road, config, request),
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
    remind(bag)
    config = configured(parameter_file, assignments or []).bag
    made = regenerate_scenario(bag, index, namespace=namespace, request=request, log=log, config=config)
    console.print(f"scenario {index}: the same {len(made.data)} bytes, sha256 {made.sha256}", soft_wrap=True)
    if out is not None:
        console.print(f"bag: {write_regenerated(made, out, [bag, *([log] if log else ())])}", soft_wrap=True)


@app.command()
def demo(
    count: Annotated[int, typer.Option(min=1, help="scenarios per case and road")] = 50,
    seed: Annotated[int, typer.Option(min=0, help="same seed, same scenarios")] = 7,
    out: Annotated[Path, typer.Option(help="folder of the results")] = Path("out/demo"),
    ros: Annotated[bool, typer.Option("--ros", help="generate with the ROS nodes, over DDS, into the bag")] = False,
) -> None:
    """Run the main job on the bundled synthetic log: the paper's three cases, on a T-intersection and a straight road."""
    config = PipelineConfig()
    logs = [bundled(case) for case, _ in DEMO]
    roads = [road for _, road in DEMO]
    with replaced_folder(out, GENERATED, logs) as partial_out:
        found = [read_log(log, config.log) for log in logs]
        if ros:
            run_nodes(list(zip(logs, roads, strict=True)), config, count, seed, partial_out / BAG)
        cases: list[Case] = []
        refusals: list[str] = []
        for result, road in zip(found, roads, strict=True):
            more, refused = run_all(list(result.encounters), [road], config, count=count, seed=seed)
            cases, refusals = cases + more, refusals + refused
        if ros:
            compare_with_nodes(cases, partial_out / BAG)
        write_results(
            partial_out,
            cases,
            seed=seed,
            title="Demo: new encounters from the bundled synthetic log",
            quality=[line for result in found for line in result.quality.lines()],
            provenance=provenance_of(logs, seed, count, roads, config),
        )
    conclude(cases, refusals, out)


def run_nodes(jobs: list[tuple[Path, str]], config: PipelineConfig, count: int, seed: int, bag: Path) -> None:
    """Run the ROS suite, one namespace per job, and record it to `bag`."""
    try:
        from scenario_gen.nodes.run_suite import Job, run_suite
    except ImportError as error:
        raise InputError(f"ROS 2 is not in this environment ({error}); run `make install`, or leave --ros out") from error

    asked = [Job(namespace, log, road) for namespace, (log, road) in zip(namespaces(len(jobs)), jobs, strict=True)]
    with console.status("starting the nodes") as status:
        run_suite(asked, config, count=count, seed=seed, bag=bag, progress=lambda text: status.update(Text(printable(text))))


def compare_with_nodes(cases: list[Case], bag: Path) -> None:
    """Say whether the nodes' scenarios, over DDS, are those made in this process, byte for byte.

    Raises:
        ScenarioGenError: they differ, which is a fault of ours.
    """
    recorded: dict[str, list[bytes]] = {}
    for message in read_messages(bag, lambda topic: topic.endswith("/scenarios")):
        recorded.setdefault(message.topic, []).append(message.data)
    total = 0
    for case, namespace in zip(cases, namespaces(len(cases)), strict=True):
        own = [encode_scenario(scenario, case.encounter.start_ns) for scenario in case.with_changepoints.scenarios]
        if own != recorded.get(f"{namespace}/scenarios", []):
            raise ScenarioGenError(f"the nodes' scenarios of {case.encounter.name} differ from those made in this process")
        total += len(own)
    console.print(f"{total} scenarios from the nodes, recorded over DDS: the same bytes as in this process")


@app.command()
def reproduce(
    log: Annotated[list[Path] | None, typer.Argument(help="as for generate; without one, the three bundled cases")] = None,
    count: Annotated[int, typer.Option(min=2, help="scenarios per encounter, with and without changepoints")] = 50,
    seed: Annotated[int, typer.Option(min=0, help="same seed, same page")] = 7,
    out: Annotated[Path, typer.Option(help="folder of reproduce.html and reproduce.json")] = Path("out/reproduced"),
) -> None:
    """Draw figures 2 to 5 of the paper with its own settings, each beside its claim and what is measured for it."""
    logs = [log] if log else [[bundled(case)] for case, _ in DEMO]
    from scenario_gen.reproduce import reproduce as reproduce_figures  # its charting library takes a second to import

    reproduce_figures(logs, out, count=count, seed=seed, say=partial(console.print, soft_wrap=True))


@app.command()
def evaluate(
    bag: Annotated[Path, typer.Argument(help="a bag with tracks and scenarios, ours or not")],
    out: Annotated[Path | None, typer.Option(help="folder for report.html, evaluation.json and evaluation.md")] = None,
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Measure the scenarios of a bag against the tracks in it, and check them anew."""
    config = configured(parameter_file, assignments or [])
    remind(bag)
    inputs = [bag, *([parameter_file] if parameter_file else ())]
    with nullcontext() if out is None else replaced_folder(out, EVALUATED, inputs) as partial_out:
        cases = bag_cases(bag, config.evaluation, config.limits, bag=config.bag)
        if partial_out is not None:
            write_evaluation(partial_out, cases, bag, config.bag)
    console.print(Markdown(printable(as_table(cases))))


@app.command()
def validate(
    bag: Annotated[Path, typer.Argument(help="a bag with scenarios, ours or not")],
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Check every scenario of a bag at every instant; exit code 1 if one is invalid."""
    config = configured(parameter_file, assignments or [])
    remind(bag)
    found = validate_bag(bag, config.limits, config.bag)
    for one in found:
        console.print(f"{one.namespace or '/'}: {one.scenarios - one.invalid} of {one.scenarios} scenarios are valid")
        table = Table("cause", "scenarios", "first", "what")
        for cause, entry in one.found.items():
            table.add_row(cause, str(entry.count), str(entry.scenario), entry.message)
        if one.found:
            console.print(table)
        if one.unaccounted:
            console.print(f"  {one.unaccounted} unaccounted: {UNTOLD}")
        for sentence in one.missing:
            console.print(f"  {sentence}", soft_wrap=True)
        for sentence, count in one.left_out.items():
            console.print(f"  not applicable to {count}: {sentence}")
    if any(one.invalid for one in found):
        raise typer.Exit(1)


@app.command("reindex")
def save_bag(
    bag: Annotated[Path, typer.Argument(help="folder of a bag that was not closed or is damaged, or one of its MCAP files")],
    out: Annotated[Path | None, typer.Option(help="folder of the new bag; BAG_reindexed if not given")] = None,
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Save the messages that are whole in a bag that was not closed or is damaged; the old files stay as they are."""
    target = out or bag.resolve().with_name(f"{bag.resolve().name}_reindexed")
    made = reindex(bag, target, configured(parameter_file, assignments or []).bag)
    console.print(f"{made.messages} messages: {target}", soft_wrap=True)
    for line in made.lines():
        console.print(line, soft_wrap=True)


@app.command()
def doctor() -> None:
    """Say what is wrong with this environment: Python, packages, ROS, DDS, QoS of visible topics, kernels."""
    from scenario_gen.nodes.doctor import main as examined

    raise typer.Exit(examined())


@app.command()
def compare(
    first: Annotated[Path, typer.Argument(help="results folder, or its evaluation.json")],
    second: Annotated[Path, typer.Argument(help="another one")],
) -> None:
    """Put two sets of scenarios side by side: two seeds, two parameters, two versions."""
    differences = compare_sets(read_evaluations(first), read_evaluations(second))
    console.print(Markdown(printable(comparison_table(differences, (first.name, second.name)))))


def remind(bag: Path) -> None:
    """Say what is missing of a bag that is read all the same."""
    if said := remark(bag):
        console.print(said, soft_wrap=True)


def chosen(encounters: tuple[Encounter, ...], names: list[str]) -> list[Encounter]:
    """Return the encounters of those names, or all.

    Raises:
        InputError: a name is unknown; the message lists the known ones.
    """
    known = {encounter.name: encounter for encounter in encounters}
    unknown = [name for name in names if name not in known]
    if unknown:
        raise InputError(f"no encounter named {unknown[0]!r} in the log; there are: {', '.join(known)}")
    return [known[name] for name in names] or list(encounters)


def run_all(
    templates: list[Encounter],
    roads: list[str],
    config: PipelineConfig,
    *,
    count: int,
    seed: int,
    request: Request = Request(),  # noqa: B008 - frozen
) -> tuple[list[Case], list[str]]:
    """Run every encounter on every road; return the cases, and a sentence for each that was refused."""
    cases: list[Case] = []
    refusals: list[str] = []
    with progress_bar() as bar:
        for template in templates:
            for road in roads:
                task = bar.add_task(printable(f"{template.name} on {Path(road).stem}"), total=count)

                def advance(done: int, total: int, _candidates: int, task: TaskID = task) -> None:
                    bar.update(task, completed=done, total=total)

                try:
                    case = run_pipeline(template, road, config, count=count, seed=seed, request=request, progress=advance)
                except RefusedError as error:
                    refusals.append(f"{template.name} on {road}: {as_options(str(error))}")
                    continue
                cases.append(case)
                got = len(case.with_changepoints.scenarios)
                if got < count:
                    refusals.append(f"{template.name} on {road}: only {got} of {count} scenarios: {causes(case)}")
    return cases, refusals


def as_options(message: str) -> str:
    """Write the nearest possible request, which the nodes take as parameters, as options of the command line."""
    for parameter, option in (
        ("starts:='", "--start '"),
        ("goals:='", "--goal '"),
        ("sampling.max_stretch:=", "--set sampling.max_stretch="),
    ):
        message = message.replace(parameter, option)
    return message


def causes(case: Case) -> str:
    """Say why candidates were refused."""
    refused = case.with_changepoints.refused
    return ", ".join(f"{number} × {cause}" for cause, number in refused.most_common()) or "no candidate was drawn"


def conclude(cases: list[Case], refusals: list[str], out: Path) -> None:
    """Print the summary; raise RefusedError if anything asked for is missing."""
    console.print(summary(cases))
    console.print(f"report: {out / REPORT}\nbag:    {out / BAG}", soft_wrap=True)
    if refusals:
        raise RefusedError("not everything that was asked for could be had:\n" + "\n".join(refusals))


def progress_bar() -> Progress:
    """Return the progress bar of long work (silent where nobody watches)."""
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Terminal(stderr=True),
        transient=True,
    )


def main() -> None:
    """Run the command line; an error of ours, or of the system, is one message and an exit code, never a traceback."""
    try:
        try:
            for word in sys.argv[1:]:
                if any("\ud800" <= letter <= "\udfff" for letter in word):
                    raise InputError(f"{word}: a name that is no UTF-8 text cannot go into a bag or a page; rename the file")
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
    with suppress(OSError):
        Terminal(stderr=True).print(Text("error:", style="bold red"), presentable(str(error)), soft_wrap=True)
    try:
        sys.stdout.flush()
    except OSError:  # a full disk, or nobody listens: what is left goes nowhere, so that the interpreter ends in peace
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
