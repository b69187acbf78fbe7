# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The commands that work on bags of scenarios."""

from collections.abc import Sequence
from contextlib import nullcontext
from functools import partial
import json
from pathlib import Path
from typing import Annotated, Any, TYPE_CHECKING

import typer

from scenario_gen.base.errors import printable_lines
from scenario_gen.cli.options import (
    assigned_all,
    bag_at,
    Commands,
    configured,
    OUT,
    ParametersOption,
    SetOption,
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
    from scenario_gen.output.review.evaluation import BagEvaluation

commands = Commands("Look at a bag of scenarios")


@commands.command()
def evaluate(
    bag: Annotated[
        Path, typer.Argument(help="A bag with the topic `scenarios`, from this suite or another.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(*OUT, help="Folder for report.html, evaluation.json and evaluation.md."),
    ] = None,
    assignments: SetOption = None,
    parameter_file: ParametersOption = None,
) -> None:
    """Check the scenarios of a bag in continuous time, and measure them against its tracks.

    Exit code 1: a scenario is invalid.
    """
    from rich.markdown import Markdown

    from scenario_gen.base.folders import replaced_folder
    from scenario_gen.output.results import as_table, EVALUATED, write_evaluation
    from scenario_gen.output.review.evaluation import evaluate_bag, measured

    config = configured(parameter_file, assignments)
    bag = bag_at(bag)
    inputs = [bag, *([parameter_file] if parameter_file else ())]
    with nullcontext() if out is None else replaced_folder(out, EVALUATED, inputs) as folder:
        with progress() as advance:
            evaluations = evaluate_bag(bag, config, progress=partial(advance, "scenarios"))
        cases = [each.result for each in evaluations if each.result]
        if folder is not None:
            write_evaluation(folder, measured(evaluations, bag), bag)
    is_valid = all(each.valid == len(each.verdicts) for each in evaluations)
    emit_json(
        valid=is_valid,
        namespaces=[_checks(each) for each in evaluations],
        cases=[json.loads(case.evaluation.to_json()) for case in cases],
        folder=out,
    )
    for each in evaluations:
        _print_checks(each)
    print_(Markdown(printable_lines(as_table(cases))), wrap=True)
    if not is_valid:
        raise typer.Exit(1)


def _checks(evaluation: "BagEvaluation") -> dict[str, Any]:
    """Return the checks of a namespace as a document."""
    return {
        "namespace": evaluation.namespace,
        "scenarios": len(evaluation.verdicts),
        "valid": evaluation.valid,
        "causes": evaluation.causes,
        "notes": [str(note) for note in evaluation.notes],
    }


def _print_checks(evaluation: "BagEvaluation") -> None:
    """Print how many scenarios of a namespace are valid, and the violations by cause."""
    name = f"{evaluation.namespace}: " if evaluation.namespace else ""
    print_(f"{name}{evaluation.valid} of {len(evaluation.verdicts)} scenarios are valid")
    rows = [
        (cause, str(len(messages)), *map(str, next(iter(messages.items()))))
        for cause, messages in evaluation.causes.items()
    ]
    if rows:
        print_table(("cause", "scenarios", "first", "violation"), rows)
    if evaluation.result is None:
        print_(*evaluation.notes, sep="\n")


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
        folder = out or default_output(bag, f"{path.stem}_report")
        bag = bag_at(bag)
        with progress() as advance:
            write_page(bag, folder, progress=partial(advance, "scenarios"))
        page = folder / REPORT
    emit_json(report=page, opened=browse and open_page(page))
    print_(f"report: {page}")


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
            help="commonroad, openscenario (with OpenDRIVE), autoware, scenarionet (MetaDrive), "
            "csv or parquet.",
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
    bag = bag_at(bag)
    folder = out or default_output(bag, f"{bag.resolve().name}_{to}")
    with progress() as advance:
        counted = partial(advance, "scenarios")
        result = export_bag(
            bag, folder, to, *configs, namespace=namespace, indices=index or (), progress=counted
        )
    emit_json(scenarios=result.scenarios, folder=folder, notes=result.notes)
    print_(*result.notes, f"{result.scenarios} scenarios: {folder}", sep="\n")
