# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The commands that generate scenarios."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

import typer

from scenario_gen.base.errors import RefusedError
from scenario_gen.cli.options import (
    Commands,
    configured,
    OUT,
    ParametersOption,
    SetOption,
    takes,
)
from scenario_gen.cli.output import current, emit_json, print_, progress, status

if TYPE_CHECKING:
    from scenario_gen.pipeline import PipelineConfig
    from scenario_gen.types import GenerationResult, Request

commands = Commands("Generate scenarios")
MAX_COUNT = 100_000  # scenarios of one request


@dataclass(frozen=True)
class Generate:
    """The options of `generate`."""

    log: Annotated[
        list[Path],
        typer.Argument(
            help="The recording: CSV, Parquet or SPMD files, or a bag (MCAP, SQLite or ROS 1)."
        ),
    ]
    road: Annotated[
        list[str] | None,
        typer.Option(
            "--road",
            "--roads",
            help="straight, curve, t_intersection, four_way, merge, roundabout, corridor (drawn "
            "around the recording), auto (the first of these that suits; the default), a nav2 map "
            "(.yaml), or a vector map: Lanelet2 (.osm), OpenDRIVE (.xodr), CommonRoad (.xml). "
            "Append #box=x0,y0,x1,y1, #lanelet=ID or #junction=ID for a part of a vector map. "
            "`scenario-gen roads` draws a map with suitable places. Repeatable.",
        ),
    ] = None
    count: Annotated[
        int, typer.Option(min=1, max=MAX_COUNT, help="Scenarios per encounter and road.")
    ] = 50
    seed: Annotated[
        int, typer.Option(min=0, help="Random seed. The same seed gives the same scenarios.")
    ] = 0
    out: Annotated[Path, typer.Option(*OUT, help="Folder for the results.")] = Path(
        "out/generated"
    )
    encounter: Annotated[
        list[str] | None,
        typer.Option(help="Name of an encounter in the log. Repeatable; default: all."),
    ] = None
    recording: Annotated[
        list[Path] | None,
        typer.Option(
            help="Another recording for the same roads, with a separate clock. Repeatable."
        ),
    ] = None
    ego: Annotated[
        str,
        typer.Option(
            help="Id of the vehicle to leave out for a planner under test, or auto: the one that "
            "has to react. The bag contains its start, goal and track."
        ),
    ] = ""
    start: Annotated[
        list[str] | None,
        typer.Option(
            help=r"Start state of a vehicle on the road, 'id: x y yaw \[speed]'. Repeatable."
        ),
    ] = None
    goal: Annotated[
        list[str] | None,
        typer.Option(help="End state of a vehicle, in the same form. Repeatable."),
    ] = None
    target: Annotated[
        list[str] | None,
        typer.Option(
            help="Range of pet, ttc, gap, arrival_gap, closing_speed or blind_margin, "
            r"e.g. 'pet < 2', 'ttc\[1,2]=1..2'. Repeatable."
        ),
    ] = None
    for_testing: Annotated[
        bool,
        typer.Option(
            "--for-testing",
            help="Search for scenarios in which the --ego has to react: speed laws that ignore "
            "the others fail in 90 % of the set, and a simple reactive planner passes.",
        ),
    ] = False
    budget: Annotated[
        float,
        typer.Option(
            min=1.0,
            max=1e6,
            help="Computing time (s) of the search of --for-testing, per encounter and road; what "
            "was found until then is kept.",
        ),
    ] = 180.0
    order: Annotated[
        str,
        typer.Option(
            help="Who goes first. keep: as recorded. free: anyone. swap: the second vehicle at "
            "the closest crossing."
        ),
    ] = "keep"
    allow: Annotated[
        list[str] | None,
        typer.Option(
            help="What to accept, separated by commas. On the road: lost_conflict, lost_order, "
            "lost_following, lost_merge, lost_lane_change, lost_overtaking, lost_clearance, "
            "lost_stand, lost_turn, lost_light. In the log: doubt (read it although the result "
            "contradicts its data). Repeatable."
        ),
    ] = None
    obstacle: Annotated[
        list[str] | None,
        typer.Option(
            help="Obstacle on the road, such as a parked car: 'x y yaw length width'. Repeatable."
        ),
    ] = None
    assignments: SetOption = None
    parameter_file: ParametersOption = None


def _config(options: Generate) -> "PipelineConfig":
    from scenario_gen.base.parameters import updated
    from scenario_gen.logs.quality import ALLOWED
    from scenario_gen.roads import read_obstacles
    from scenario_gen.types import join_pieces

    config = configured(options.parameter_file, options.assignments)
    accepted = [name.strip() for name in ",".join(options.allow or []).split(",")]
    losses = [name for name in accepted if name and name != ALLOWED]
    for text in options.obstacle or []:
        read_obstacles(text, "--obstacle")
    obstacles = filter(None, [config.road.obstacles, *(options.obstacle or [])])
    return updated(
        config,
        {
            "fitting.allow": ",".join(losses) or config.fitting.allow,
            "log.allow": ALLOWED if ALLOWED in accepted else config.log.allow,
            "road.obstacles": join_pieces(obstacles),
        },
    )


def _request(options: Generate) -> "Request":
    from scenario_gen.types import join_pieces, Request

    return Request(
        options.ego,
        join_pieces(options.start or []),
        join_pieces(options.goal or []),
        join_pieces(options.target or []),
        options.order,
    )


@commands.command()
@takes(Generate)
def generate(options: Generate) -> None:
    """Generate scenarios from a log; write a bag, a report and figures to one folder."""
    from scenario_gen.cli.folder import FolderRequest, generate_folder
    from scenario_gen.method.chain import AUTO

    logs = [options.log, *([path] for path in options.recording or [])]
    request = FolderRequest(
        jobs=[(files, options.road or [AUTO]) for files in logs],
        config=_config(options),
        count=options.count,
        seed=options.seed,
        encounters=options.encounter or [],
        request=_request(options),
        also_read=[options.parameter_file] if options.parameter_file else [],
        for_testing=options.for_testing,
        budget=options.budget,
    )
    conclude(*generate_folder(options.out, request, progress=progress, notify=print_), options.out)


@commands.command()
def roads(
    road: Annotated[
        str,
        typer.Argument(
            help="A map, or the name of a built-in road. Default: list the built-in roads."
        ),
    ] = "",
    log: Annotated[
        Path | None,
        typer.Option(help="A recording: show the roads or places that suit its encounter."),
    ] = None,
    encounter: Annotated[
        list[str] | None,
        typer.Option(help="Name of the encounter in the log; default: the first."),
    ] = None,
    out: Annotated[Path, typer.Option(*OUT, help="PNG file for the picture.")] = Path("roads.png"),
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Draw a map with lanes and the places that suit a recording, or list the built-in roads."""
    from scenario_gen.base.errors import InputError
    from scenario_gen.cli.folder import chosen
    from scenario_gen.logs import read_log
    from scenario_gen.method.chain import fits_road, suitable_roads
    from scenario_gen.method.segmentation import segment
    from scenario_gen.output.plot import draw_map
    from scenario_gen.roads import BUILT_IN, CORRIDOR
    from scenario_gen.situation import Situation

    config = configured(parameter_file, assignments)
    template = (
        None if log is None else chosen(read_log(log, config.log).encounters, encounter or [])[0]
    )
    if not road:
        names = [*BUILT_IN, CORRIDOR]
        if template is not None:
            segmentation = segment(template, config.segmentation, 0)
            names = list(suitable_roads(Situation.of(template), segmentation, config))
        emit_json(roads=names)
        title = "roads" if template is None else f"roads that suit {template.name}"
        print_(f"{title}: {', '.join(names)}")
        return
    if out.suffix.lower() != ".png":
        raise InputError(f"--out {out}: name a file that ends with .png")
    if out.exists() and not out.read_bytes()[:4] == b"\x89PNG":
        raise InputError(f"--out {out} exists and is not a picture of a map; name another file")
    out.parent.mkdir(parents=True, exist_ok=True)
    notes = draw_map(road, out, template)
    if template is not None and road in [*BUILT_IN, CORRIDOR]:
        segmentation = segment(template, config.segmentation, 0)
        fits = fits_road(road, Situation.of(template), segmentation, config)
        notes.append(f"{template.name} {'fits' if fits else 'does not fit'} {road} unchanged")
    emit_json(picture=out, notes=notes)
    print_(*notes, f"picture: {out}", sep="\n")


@commands.command()
def demo(
    count: Annotated[int, typer.Option(min=1, max=MAX_COUNT, help="Scenarios per case.")] = 50,
    seed: Annotated[
        int, typer.Option(min=0, help="Random seed. The same seed gives the same scenarios.")
    ] = 7,
    out: Annotated[Path, typer.Option(*OUT, help="Folder for the results.")] = Path("out/demo"),
    ros: Annotated[
        bool, typer.Option("--ros", help="Let the ROS nodes generate the scenarios, over DDS.")
    ] = False,
) -> None:
    """Generate scenarios from three bundled encounters: left turn, follower, all-way stop."""
    from scenario_gen.cli.demo import run_demo

    cases, refusals = run_demo(
        out, count=count, seed=seed, ros=ros, progress=progress, status=status
    )
    if ros:
        total = sum(len(case.generated.scenarios) for case in cases)
        print_(f"{total} scenarios from the ROS nodes are byte-identical to those of this process")
    conclude(cases, refusals, out)


def conclude(cases: "list[GenerationResult]", refusals: list[str], out: Path) -> None:
    """Print the summary of generated cases.

    Raises:
        RefusedError: a requested case is missing or incomplete.
    """
    from scenario_gen.output.report.summary import summary
    from scenario_gen.output.results import BAG, FIGURES, REPORT

    emit_json(
        report=out / REPORT,
        bag=out / BAG,
        figures=out / FIGURES,
        cases=[case_of(case) for case in cases],
        refusals=refusals,
    )
    print_(summary(cases, verbose=current.verbose), wrap=True)
    print_(f"report: {out / REPORT}", f"bag:    {out / BAG}", sep="\n")
    print_("next:   open the report, or test a planner on the bag (`scenario-gen drive --help`)")
    if refusals:
        raise RefusedError("part of the request could not be generated:", *refusals)


def case_of(case: "GenerationResult") -> dict[str, object]:
    """Return the figures of a case for JSON."""
    generated = case.generated
    return {
        "title": case.title,
        "vehicles": case.encounter.ids,
        "requested": generated.requested,
        "scenarios": len(generated.scenarios),
        "candidates": generated.candidates,
        "refused": generated.refused,
    }
