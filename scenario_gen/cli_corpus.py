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

"""The commands about many encounters, which `cli` takes in; libraries are loaded by the command that needs them."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, TYPE_CHECKING

import typer

from scenario_gen.errors import RefusedError

if TYPE_CHECKING:
    from scenario_gen.corpus.tasks import Told

commands = typer.Typer()

WorkersOption = Annotated[int, typer.Option(min=0, help="processes; 0: one for each core")]
SchedulerOption = Annotated[str, typer.Option(help="address of a Dask scheduler, e.g. tcp://host:8786, instead of own processes")]


@contextmanager
def telling() -> Iterator["Told"]:
    """Show how far it is, and how much time is left."""
    from scenario_gen.terminal import status_line

    with status_line() as status:
        yield lambda done, total, left: status(f"{done} of {total} tasks, {left}")


def lines(said: Sequence[str]) -> None:
    """Print lines, letter by letter."""
    from scenario_gen.terminal import Terminal

    for line in said:
        Terminal().print(line, soft_wrap=True)


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
    from scenario_gen.parameters import assigned

    config = CorpusConfig()
    for assignment in assignments or []:
        config = assigned(config, assignment)
    with telling() as told:
        result = mined(archive, out, config, workers=workers, scheduler=scheduler, told=told)
    lines(result.lines())
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
    from scenario_gen.parameters import assigned

    config = ArchiveConfig()
    for assignment in assignments or []:
        config = assigned(config, assignment)
    planted = read_planted(write_archive(out, config, seed))
    inside = sum(int(one.inside) for one in planted)
    lines([f"{out}: synthetic, {inside} encounters to be found, {len(planted) - inside} just outside of a threshold"])
