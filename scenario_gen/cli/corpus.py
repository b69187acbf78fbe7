# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The commands for archives with many encounters."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Literal, TYPE_CHECKING

import typer

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.cli.options import (
    assigned_all,
    Commands,
    OUT,
    SeedOption,
    SetOption,
    takes,
    WorkersOption,
)
from scenario_gen.cli.output import current, emit_json, print_, print_table, progress

if TYPE_CHECKING:
    from scenario_gen.corpus.tasks import Workers

commands = Commands("Archives of recordings")
Bags = Literal["none", "hits", "all"]

SchedulerOption = Annotated[
    str,
    typer.Option(
        help="Address of a Dask scheduler instead of local processes, e.g. tcp://host:8786."
    ),
]


@contextmanager
def workers_of(count: int, scheduler: str) -> Iterator["Workers"]:
    """Yield the workers; show the completed tasks and the remaining time."""
    from scenario_gen.corpus.tasks import Workers

    with progress() as advance:
        yield Workers(count, scheduler, partial(advance, "tasks"))


def conclude(summary: list[str], failed: Sequence[str], out: Path, **files: Path) -> None:
    """Print the summary of tasks, and the files.

    Raises:
        RefusedError: a task failed.
    """
    emit_json(summary=summary, **files, out=out, failed=failed)
    print_(*summary, *(f"{name}: {path}" for name, path in files.items()), sep="\n")
    if failed:
        raise RefusedError(
            f"{len(failed)} tasks failed, see above; the other results are in {out}; "
            "run the same command to try them again"
        )


@commands.command()
def mine(
    archive: Annotated[
        list[Path],
        typer.Argument(help="Folders or files with recordings in any log format. Repeatable."),
    ],
    out: Annotated[
        Path,
        typer.Option(*OUT, help="Folder for the corpus; only what has changed is done again."),
    ] = Path("out/mine"),
    workers: WorkersOption = 0,
    scheduler: SchedulerOption = "",
    allow: Annotated[
        str, typer.Option(help="doubt: read logs although the result contradicts their data.")
    ] = "",
    strict: Annotated[
        bool,
        typer.Option("--strict", help="Stop at a file that cannot be read, or a failed task."),
    ] = False,
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="Set memory, range_size, interaction, log.proximity, …, as name=value."
        ),
    ] = None,
) -> None:
    """Find the encounters in an archive of any size."""
    from scenario_gen.corpus.config import CorpusConfig
    from scenario_gen.corpus.mine import DETAILS, PAGE
    from scenario_gen.corpus.mine import mine as mined

    allowed = [f"log.allow={allow}"] if allow else []
    config = assigned_all(CorpusConfig(), [*allowed, *(assignments or [])])
    with workers_of(workers, scheduler) as who:
        result = mined(archive, out, config, workers=who, strict=strict)
    files = {"page": out / PAGE, "details": out / DETAILS}
    conclude(result.lines(), result.failed, out, **files)


@dataclass(frozen=True)
class Batch:
    """The options of `batch`."""

    corpus: Annotated[Path, typer.Argument(help="A corpus that `mine` wrote.")]
    roads: Annotated[
        list[str],
        typer.Option(
            "--road", "--roads", help="Roads, as for `generate`, separated by commas. Repeatable."
        ),
    ]
    out: Annotated[
        Path,
        typer.Option(
            *OUT, help="Folder for tables and bags. An existing batch continues and grows."
        ),
    ] = Path("out/batch")
    count: Annotated[
        int, typer.Option(min=1, max=100_000, help="Scenarios per encounter and road.")
    ] = 50
    seed: SeedOption = 0
    templates: Annotated[
        int, typer.Option(min=0, help="Use only the first N encounters of the corpus. 0: all.")
    ] = 0
    bags: Annotated[
        Bags,
        typer.Option(help="Scenarios to write to bags, too; `find --bag` copies from these."),
    ] = "none"
    hits: Annotated[
        str, typer.Option(help="Condition as for `find`: the scenarios that go to bags.")
    ] = ""
    workers: WorkersOption = 0
    scheduler: SchedulerOption = ""
    assignments: SetOption = None


@commands.command()
@takes(Batch)
def batch(options: Batch) -> None:
    """Generate scenarios from all encounters of a corpus on several roads."""
    from scenario_gen.corpus.batch import run_batch
    from scenario_gen.corpus.parts import BatchRequest
    from scenario_gen.method.config import PipelineConfig

    config = assigned_all(PipelineConfig(), options.assignments)
    names = [name for text in options.roads for name in text.split(",") if name]
    bags = "hits" if options.hits else options.bags
    request = BatchRequest(config, options.count, options.seed, bags, options.hits)
    with workers_of(options.workers, options.scheduler) as who:
        result = run_batch(
            options.corpus, names, options.out, request, templates=options.templates, workers=who
        )
    conclude(result.lines(), result.failed, options.out)


def shown(value: object) -> str:
    """Return a value as text; a number has three digits, at most two of which are decimals."""
    if not isinstance(value, float):
        return "" if value is None else str(value)
    decimals = 2 - sum(abs(value) >= bound for bound in (9.995, 99.95))
    return f"{value:.{decimals}f}"


@commands.command()
def find(
    batch: Annotated[
        Path,
        typer.Argument(help="A batch (also unfinished), or a corpus that `mine` wrote."),
    ],
    condition: Annotated[
        str, typer.Argument(help="Condition in SQL, e.g. \"kind = 'crossing' and pet < 1\".")
    ] = "true",
    limit: Annotated[int, typer.Option(min=0, help="Number of scenarios to list. 0: all.")] = 20,
    bag: Annotated[
        Path | None,
        typer.Option(
            help="Copy the matching scenarios from the bags of the batch to this bag, with their "
            "recordings and roads."
        ),
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Folder for a page about --bag.")] = None,
) -> None:
    """Find scenarios in a batch, or recorded encounters in a corpus, by kind, road, PET or TTC."""
    from scenario_gen.corpus import find as finding
    from scenario_gen.output.review.evaluation import write_page

    if report is not None and bag is None:
        raise InputError("--report needs --bag, the bag that the page describes; give both")
    shows_some = not (current.as_json or bag)
    matches = finding.find(batch, condition, limit if shows_some else 0)
    lines = finding.coverage_lines(matches, batch)
    emit_json(scenarios=matches.rows, coverage=lines)
    _print_matches(matches.rows[: limit or None], matches.count)
    print_(*lines, sep="\n")
    if bag is not None:
        finding.export_hits(batch, matches.rows, bag)
        emit_json(bag=bag)
        print_(f"bag: {bag}")
        if report is not None:
            write_page(bag, report)
            emit_json(report=report)
            print_(f"report: {report}")


def _print_matches(listed: Sequence[Mapping[str, object]], count: int) -> None:
    """Print a table of the first of `count` matching scenarios, and a summary."""
    from scenario_gen.corpus.find import COLUMNS
    from scenario_gen.corpus.tables import UNITS

    titles = [f"{name} [{UNITS[name]}]" if name in UNITS else name for name in COLUMNS]
    print_table(titles, [[shown(row[name]) for name in COLUMNS] for row in listed], names=3)
    summary = f"{count} scenarios" if count else "no scenario matches"
    if len(listed) < count:
        summary += f"; the first {len(listed)} are listed, --limit 0 lists all"
    if count:
        summary += "; ttc is capped at evaluation.ttc_horizon (10 s)"
    print_(summary)
