# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The commands that work on bags of scenarios."""

from collections.abc import Sequence
from contextlib import nullcontext
from functools import partial
import json
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

import typer

from scenario_gen.base.errors import printable_lines
from scenario_gen.cli.options import (
    assigned_all,
    Commands,
    configured,
    OUT,
    ParametersOption,
    SetOption,
    warn_of_metadata,
)
from scenario_gen.cli.output import (
    default_output,
    emit_json,
    open_page,
    print_,
    print_table,
    progress,
)

if TYPE_CHECKING:
    from scenario_gen.bags.storage.config import BagConfig
    from scenario_gen.output.exchange.config import ExportConfig
    from scenario_gen.output.review.validation import Validation

commands = Commands("Look at a bag of scenarios")


@commands.command()
def evaluate(
    bag: Annotated[
        Path,
        typer.Argument(
            help="A bag with the topics `tracks` and `scenarios`, from this suite or another."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(*OUT, help="Folder for report.html, evaluation.json and evaluation.md."),
    ] = None,
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Measure the scenarios of a bag against its recorded tracks, and check them again."""
    from rich.markdown import Markdown

    from scenario_gen.base.folders import replaced_folder
    from scenario_gen.output.results import as_table, EVALUATED, write_evaluation
    from scenario_gen.output.review.evaluation import bag_results

    config = configured(parameter_file, assignments)
    warn_of_metadata(bag)
    inputs = [bag, *([parameter_file] if parameter_file else ())]
    with nullcontext() if out is None else replaced_folder(out, EVALUATED, inputs) as folder:
        with progress() as advance:
            cases = bag_results(
                bag,
                config.evaluation,
                config.limits,
                bag=config.bag,
                progress=partial(advance, "scenarios"),
            )
        if folder is not None:
            write_evaluation(folder, cases, bag, config.bag)
    emit_json(cases=[json.loads(case.evaluation.to_json()) for case in cases], folder=out)
    print_(Markdown(printable_lines(as_table(cases))), wrap=True)


@commands.command()
def report(
    bag: Annotated[
        Path,
        typer.Argument(
            help="A bag with the topics `tracks` and `scenarios`, or a folder from `generate`."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(*OUT, help="Folder for the page. Default: BAG_report next to the bag."),
    ] = None,
    browse: Annotated[
        bool, typer.Option("--open/--no-open", help="Open the page in a browser.")
    ] = True,
) -> None:
    """Write an HTML page about a bag and open it."""
    from scenario_gen.output.results import BAG, REPORT
    from scenario_gen.output.review.evaluation import write_page

    path = bag.resolve()
    results = path.parent if path.name == BAG else path  # a folder from `generate`
    page = results / REPORT
    if out is not None or not page.is_file():
        warn_of_metadata(bag)
        folder = out or default_output(bag, f"{path.stem}_report")
        with progress() as advance:
            write_page(bag, folder, progress=partial(advance, "scenarios"))
        page = folder / REPORT
    emit_json(report=page, opened=browse and open_page(page))
    print_(f"report: {page}")


@commands.command()
def validate(
    bag: Annotated[
        Path, typer.Argument(help="A bag with the topic `scenarios`, from this suite or another.")
    ],
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Check every scenario of a bag in continuous time. Exit code 1: a scenario is invalid."""
    from scenario_gen.output.review.validation import validate_bag

    config = configured(parameter_file, assignments)
    warn_of_metadata(bag)
    with progress() as advance:
        validations = validate_bag(
            bag, config.limits, config.bag, progress=partial(advance, "scenarios")
        )
    is_valid = not any(validation.invalid for validation in validations)
    emit_json(valid=is_valid, namespaces=validations)
    for validation in validations:
        _print_validation(validation)
    if not is_valid:
        raise typer.Exit(1)


def _print_validation(validation: "Validation") -> None:
    """Print the violations, the kept reactions and the skipped checks of a namespace."""
    from scenario_gen.bags.recordings.read import NO_ENTRY

    valid = validation.scenarios - validation.invalid
    name = f"{validation.namespace}: " if validation.namespace else ""
    print_(f"{name}{valid} of {validation.scenarios} scenarios are valid")
    if validation.causes:
        rows = [
            (cause, str(entry.count), str(entry.scenario), entry.message)
            for cause, entry in validation.causes.items()
        ]
        print_table(("cause", "scenarios", "first", "violation"), rows)
    if validation.unaccounted:
        print_(f"  {validation.unaccounted} without an entry: {NO_ENTRY}")
    for message, count in validation.proven.items():
        print_(f"  {message}: {count} scenarios")
    for message in validation.missing:
        print_(f"  {message}")
    for message, count in validation.left_out.items():
        print_(f"  not checked in {count}: {message}")


def _export_configs(
    ego: str, road_map: str, options: Sequence[str]
) -> tuple["ExportConfig", "BagConfig"]:
    """Return the parameters of an export and of reading its bag."""
    from scenario_gen.bags.storage.config import BagConfig
    from scenario_gen.output.exchange.config import ExportConfig

    of_bag = [option for option in options if option.startswith("bag.")]
    of_export = [option for option in options if option not in of_bag]
    bag_config = assigned_all(BagConfig(), [option.removeprefix("bag.") for option in of_bag])
    return assigned_all(ExportConfig(ego=ego, map=road_map), of_export), bag_config


@commands.command("export", panel="Other formats")
def export_scenarios(
    bag: Annotated[
        Path, typer.Argument(help="A bag with the topic `scenarios`, from this suite or another.")
    ],
    to: Annotated[
        str,
        typer.Option(
            help="commonroad, openscenario (with OpenDRIVE), autoware or scenarionet (MetaDrive)."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            *OUT, help="Folder for the files. Default: BAG_commonroad etc. next to the bag."
        ),
    ] = None,
    index: Annotated[
        list[int] | None,
        typer.Option(
            min=0, help="Number of a scenario, as on its page. Repeatable; default: all."
        ),
    ] = None,
    namespace: Annotated[
        str | None, typer.Option(help="Only the scenarios in this namespace.")
    ] = None,
    ego: Annotated[
        str,
        typer.Option(
            help="Id of the vehicle that becomes the ego, e.g. CommonRoad's planning problem."
        ),
    ] = "",
    road_map: Annotated[
        str,
        typer.Option(
            "--map",
            help="openscenario: the map of the scenarios (.xodr, .osm). It is copied and "
            "referenced as their road.",
        ),
    ] = "",
    options: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="Set run_out, step, goal_length, goal_width, goal_late, late, following or "
            "bag.…, as name=value.",
        ),
    ] = None,
) -> None:
    """Export scenarios: CommonRoad, OpenSCENARIO with OpenDRIVE, Autoware, ScenarioNet."""
    from scenario_gen.output.exchange.export import export_bag

    configs = _export_configs(ego, road_map, options or [])
    warn_of_metadata(bag)
    folder = out or default_output(bag, f"{bag.resolve().name}_{to}")
    with progress() as advance:
        counted = partial(advance, "scenarios")
        result = export_bag(
            bag, folder, to, *configs, namespace=namespace, indices=index or (), progress=counted
        )
    emit_json(scenarios=result.scenarios, folder=folder, notes=result.notes)
    print_(*result.notes, f"{result.scenarios} scenarios: {folder}", sep="\n")


@commands.command("reindex")
def save_bag(
    bag: Annotated[
        Path,
        typer.Argument(help="Folder of an unclosed or damaged bag, or one of its MCAP files."),
    ],
    out: Annotated[
        Path | None, typer.Option(*OUT, help="Folder for the new bag. Default: BAG_reindexed.")
    ] = None,
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Recover the intact messages of an unclosed or damaged bag. The old files are not changed."""
    from scenario_gen.bags.storage.reindex import reindex

    target = out or default_output(bag, f"{bag.resolve().name}_reindexed")
    result = reindex(bag, target, configured(parameter_file, assignments).bag)
    emit_json(messages=result.messages, bag=target, notes=result.lines())
    print_(f"{result.messages} messages: {target}", *result.lines(), sep="\n")
