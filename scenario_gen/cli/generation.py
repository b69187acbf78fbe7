# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The commands that generate: from logs, one scenario again, and the demo."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

import typer

from scenario_gen.base.errors import RefusedError
from scenario_gen.cli.options import configured, ParametersOption, remind, say, SetOption, takes

if TYPE_CHECKING:
    from scenario_gen.types import GenerationResult

commands = typer.Typer()


@commands.command()
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


@dataclass(frozen=True)
class Generate:
    """The options of `generate`."""

    log: Annotated[list[Path], typer.Argument(help="CSV, Parquet, SPMD files, or a rosbag2 bag (MCAP or SQLite)")]
    road: Annotated[
        list[str],
        typer.Option(
            help="straight, curve, t_intersection, four_way, merge, roundabout, corridor, or a nav2 map's YAML; repeatable"
        ),
    ]
    count: Annotated[int, typer.Option(min=1, help="scenarios per encounter and road")] = 50
    seed: Annotated[int, typer.Option(min=0, help="same seed, same scenarios")] = 0
    out: Annotated[Path, typer.Option(help="folder of the results")] = Path("out/generated")
    encounter: Annotated[list[str] | None, typer.Option(help="name of an encounter of the log (default: all); repeatable")] = None
    ego: Annotated[
        str,
        typer.Option(help="id of a vehicle to leave out for a planner under test; its start, goal and track are given instead"),
    ] = ""
    start: Annotated[
        list[str] | None, typer.Option(help=r"a vehicle's start state, 'id: x y yaw \[speed]', on the road; repeatable")
    ] = None
    goal: Annotated[list[str] | None, typer.Option(help="a vehicle's end state, likewise; repeatable")] = None
    target: Annotated[
        list[str] | None,
        typer.Option(
            help=r"a range, e.g. 'pet=0.5..1.5' or 'ttc\[1,2]=1..2', of pet, ttc, gap, arrival_gap, closing_speed; repeatable"
        ),
    ] = None
    choose: Annotated[str, typer.Option(help="natural: as sampled; diverse: of many valid candidates those that cover best")] = (
        "natural"
    )
    for_testing: Annotated[
        bool,
        typer.Option(
            "--for-testing",
            help="keep only scenarios in which the --ego has to react: in closed loop, planners that look at nobody collide",
        ),
    ] = False
    order: Annotated[
        str, typer.Option(help="who goes first: keep (as in the template), free, swap (the other one at the closest crossing)")
    ] = "keep"
    allow: Annotated[str, typer.Option(help="lost_conflict: a place where vehicles that meet in the template do not")] = ""
    obstacle: Annotated[
        list[str] | None,
        typer.Option(help="something in the way, 'x y yaw length width' on the road, e.g. a parked car; repeatable"),
    ] = None
    assignments: SetOption = None
    parameter_file: ParametersOption = None


@commands.command()
@takes(Generate)
def generate(options: Generate) -> None:
    """Generate new encounters from a log: bag, report and figures in one folder."""
    from scenario_gen.base.parameters import updated
    from scenario_gen.base.terminal import progress_bars
    from scenario_gen.cli.folder import FolderRequest, generate_folder
    from scenario_gen.roads import read_obstacles
    from scenario_gen.types import join_pieces, Request

    allowed = [f"fitting.allow={options.allow}"] if options.allow else []
    config = configured(options.parameter_file, [*(options.assignments or []), *allowed])
    for text in options.obstacle or []:
        read_obstacles(text, "--obstacle")
    config = updated(config, {"road.obstacles": join_pieces(filter(None, [config.road.obstacles, *(options.obstacle or [])]))})
    starts, goals, targets = (join_pieces(texts or []) for texts in (options.start, options.goal, options.target))
    request = FolderRequest(
        jobs=[(options.log, options.road)],
        config=config,
        count=options.count,
        seed=options.seed,
        encounters=options.encounter or [],
        request=Request(options.ego, starts, goals, targets, options.choose, options.order),
        also_read=[options.parameter_file] if options.parameter_file else [],
        for_testing=options.for_testing,
    )
    conclude(*generate_folder(options.out, request, progress=progress_bars, tell=say), options.out)


@commands.command()
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
    result = regenerate_scenario(bag, index, namespace=namespace, request=request, log=log, config=config)
    say(f"scenario {index}: the same {len(result.data)} bytes, sha256 {result.sha256}")
    if out is not None:
        say(f"bag: {write_regenerated(result, out, [bag, *([log] if log else ())])}")


@commands.command()
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
