# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The commands about many encounters, which `cli` takes in; libraries are loaded by the command that needs them."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

import typer

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.cli.options import assigned_all, say, takes

if TYPE_CHECKING:
    from scenario_gen.corpus.tasks import Workers

commands = typer.Typer()

WorkersOption = Annotated[int, typer.Option(min=0, help="processes; 0: one for each core")]
SchedulerOption = Annotated[str, typer.Option(help="address of a Dask scheduler, e.g. tcp://host:8786, instead of own processes")]


@contextmanager
def workers_of(count: int, scheduler: str) -> Iterator["Workers"]:
    """Give who does the tasks; show how far it is, and how much time is left."""
    from scenario_gen.base.terminal import status_line
    from scenario_gen.corpus.tasks import Workers

    with status_line() as status:
        yield Workers(count, scheduler, lambda done, total, left: status(f"{done} of {total} tasks, {left}"))


def lines(texts: Sequence[str]) -> None:
    """Print lines, letter by letter."""
    for line in texts:
        say(line)


def conclude(failed: Sequence[str], out: Path) -> None:
    """Say that not everything could be done.

    Raises:
        RefusedError: a task failed.
    """
    if failed:
        raise RefusedError(f"{len(failed)} tasks failed, as said above; the rest is in {out}")


@commands.command()
def mine(
    archive: Annotated[list[Path], typer.Argument(help="folders of SPMD files, tables and bags, or single ones; repeatable")],
    out: Annotated[Path, typer.Option(help="folder of the corpus; an unfinished one is gone on with")],
    workers: WorkersOption = 0,
    scheduler: SchedulerOption = "",
    assignments: Annotated[
        list[str] | None, typer.Option("--set", help="memory, range_size, interaction, log.proximity, …, as name=value")
    ] = None,
) -> None:
    """Find the encounters in an archive of any size."""
    from scenario_gen.corpus.config import CorpusConfig
    from scenario_gen.corpus.mine import mine as mined

    config = assigned_all(CorpusConfig(), assignments)
    with workers_of(workers, scheduler) as who:
        result = mined(archive, out, config, workers=who)
    lines([*result.lines(), f"page: {out / 'encounters.html'}"])
    conclude(result.failed, out)


@commands.command("synthetic-archive")
def synthetic_archive(
    out: Annotated[Path, typer.Argument(help="folder of the files; an earlier synthetic archive there is replaced")],
    seed: Annotated[int, typer.Option(min=0, help="same seed, same bytes")] = 0,
    assignments: Annotated[
        list[str] | None, typer.Option("--set", help="rows, hours, encounters, outside, loss, duplicates, …, as name=value")
    ] = None,
) -> None:
    """Write a synthetic archive in the Safety Pilot's format, whose encounters are known."""
    from scenario_gen.corpus.synthetic import ArchiveConfig, read_planted, write_archive

    config = assigned_all(ArchiveConfig(), assignments)
    planted = read_planted(write_archive(out, config, seed))
    inside = sum(int(one.inside) for one in planted)
    lines([f"{out}: synthetic, {inside} encounters to be found, {len(planted) - inside} just outside of a threshold"])


@dataclass(frozen=True)
class Batch:
    """The options of `batch`."""

    corpus: Annotated[Path, typer.Argument(help="a corpus that `mine` wrote")]
    roads: Annotated[list[str], typer.Option(help="as for `generate`; several separated by commas, or repeated")]
    out: Annotated[Path, typer.Option(help="folder of tables and bags; an unfinished batch is gone on with")]
    count: Annotated[int, typer.Option(min=1, help="scenarios per template and road")] = 50
    seed: Annotated[int, typer.Option(min=0, help="same seed, same scenarios")] = 0
    templates: Annotated[int, typer.Option(min=0, help="the first so many of the corpus; 0: all")] = 0
    workers: WorkersOption = 0
    scheduler: SchedulerOption = ""
    assignments: Annotated[
        list[str] | None, typer.Option("--set", help="a parameter of the pipeline, as name=value; repeatable")
    ] = None


@commands.command()
@takes(Batch)
def batch(options: Batch) -> None:
    """Generate scenarios of all templates of a corpus on all roads."""
    from scenario_gen.corpus.batch import BatchRequest, run_batch
    from scenario_gen.method.config import PipelineConfig

    config = assigned_all(PipelineConfig(), options.assignments)
    names = [name for text in options.roads for name in text.split(",") if name]
    with workers_of(options.workers, options.scheduler) as who:
        result = run_batch(
            options.corpus, names, options.out, BatchRequest(config, options.count, options.seed),
            templates=options.templates, workers=who,
        )  # fmt: skip
    lines(result.lines())
    conclude(result.failed, options.out)


def needs_bag(bag: Path | None) -> None:
    """Refuse a report without a bag.

    Raises:
        InputError: there is none.
    """
    if bag is None:
        raise InputError("--report is on the bag of the hits: give --bag, too")


@commands.command()
def find(
    batch: Annotated[Path, typer.Argument(help="a batch, finished or not")],
    condition: Annotated[str, typer.Argument(help="SQL, e.g. \"kind = 'crossing' and pet < 1\"")] = "true",
    limit: Annotated[int, typer.Option(min=0, help="at most so many; 0: all")] = 20,
    bag: Annotated[Path | None, typer.Option(help="write the hits to this bag, with their templates and roads")] = None,
    report: Annotated[Path | None, typer.Option(help="folder of the report on the bag of the hits")] = None,
    again: Annotated[bool, typer.Option("--again", help="make each hit again, alone, and compare it bit for bit")] = False,
) -> None:
    """Find scenarios of a batch by what they are: kind, road, PET, time to collision, …."""
    from rich.table import Table

    from scenario_gen.corpus import find as finding

    if report is not None:
        needs_bag(bag)
    found = finding.find(batch, condition, limit)
    table = Table(*finding.COLUMNS)
    for row in found.rows:
        table.add_row(
            *(
                "" if row[name] is None else f"{row[name]:.2f}" if isinstance(row[name], float) else str(row[name])
                for name in finding.COLUMNS
            )
        )
    say(table, wrap=True)
    lines(finding.coverage_lines(found, batch))
    if again:
        for row in found.rows:
            finding.make_again(batch, row)
        lines([f"{len(found.rows)} scenarios made again: the same bytes"])
    if bag is not None:
        lines([f"bag: {finding.export_hits(batch, found.rows, bag)}"])
        if report is not None:
            finding.write_page(bag, report)
            lines([f"report: {report}"])


@commands.command()
def library(
    corpus: Annotated[Path, typer.Argument(help="a corpus that `mine` wrote; the library goes to CORPUS/library")],
    most: Annotated[int, typer.Option(min=4, help="pairs of vehicles that are fitted at most; the others are assigned")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="same seed, same library")] = 0,
    workers: WorkersOption = 0,
    scheduler: SchedulerOption = "",
    assignments: Annotated[list[str] | None, typer.Option("--set", help="a parameter of the segmentation, as name=value")] = None,
) -> None:
    """Segment the encounters of a corpus together: primitives that they share, with frequencies, transitions and examples."""
    from scenario_gen.corpus.library import build, SHARED

    config = assigned_all(SHARED, assignments)
    with workers_of(workers, scheduler) as who:
        built = build(corpus, config, most=most, seed=seed, workers=who)
    lines(built.lines())
    conclude(built.failed, corpus / "library")
