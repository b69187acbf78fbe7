# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The commands for archives as functions that return tables."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TYPE_CHECKING

from scenario_gen.base.errors import RefusedError
from scenario_gen.base.parameters import dotted, updated
from scenario_gen.corpus.batch import run_batch
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.find import search
from scenario_gen.corpus.mine import mine as run_mine
from scenario_gen.corpus.parts import BatchRequest
from scenario_gen.corpus.tasks import Workers
from scenario_gen.method.arguments import config_of
from scenario_gen.method.config import PipelineConfig

if TYPE_CHECKING:
    from pandas import DataFrame


def mine(
    archive: str | Path | Sequence[str | Path],
    out: str | Path,
    config: CorpusConfig | Mapping[str, Any] = CorpusConfig(),
    *,
    workers: int = 1,
) -> "DataFrame":
    """Find the encounters in an archive, as `scenario-gen mine` does; return a row for each.

    Args:
        archive: files, bags or folders.
        out: folder of the corpus; an unfinished one is continued.
        config: the parameters, or a mapping with their names.
        workers: number of processes; 0 starts one per core. In a script, call this function below
            `if __name__ == "__main__":`.

    Returns:
        The columns of `find` for a corpus, the encounters with the smallest PET first.

    Raises:
        InputError: there is no log, or `out` has another archive or other parameters.
        RefusedError: tasks failed; the same call tries them again.

    Example:
        >>> encounters = sg.mine("examples/my_log.csv", "out/corpus")
        >>> encounters[["template", "kind", "vehicles"]].values.tolist()
        [['my_log', 'crossing', 2]]
    """
    archives = [archive] if isinstance(archive, str | Path) else archive
    if isinstance(config, Mapping):
        config = updated(CorpusConfig(), dict(dotted(config)))
    corpus = Path(out)
    result = run_mine(list(map(Path, archives)), corpus, config, workers=Workers(workers))
    return _table(corpus, result.failed)


def batch(
    corpus: str | Path,
    roads: str | Sequence[str],
    out: str | Path,
    config: PipelineConfig | Mapping[str, Any] = PipelineConfig(),
    *,
    count: int = 50,
    seed: int = 0,
    templates: int = 0,
    workers: int = 1,
) -> "DataFrame":
    """Generate scenarios from all encounters of a corpus on roads, as `scenario-gen batch` does.

    Args:
        corpus: written by `mine`.
        roads: one or several, as for `generate`.
        out: folder of the batch; an existing one continues and grows.
        config: the parameters of every stage, or a mapping with their names.
        count: number of scenarios per encounter and road.
        seed: of the batch.
        templates: use only the first encounters; 0: all.
        workers: as for `mine`.

    Returns:
        The columns of `find`, the scenarios with the smallest PET first.

    Raises:
        InputError: the corpus has no encounters, a road is unknown, or `out` has other content.
        RefusedError: tasks failed; the same call tries them again.

    Example:
        >>> scenarios = sg.batch("out/corpus", "four_way", "out/batch", count=5)
        >>> scenarios[["template", "road"]].head(1).values.tolist()
        [['my_log', 'four_way']]
    """
    target, names = Path(out), [roads] if isinstance(roads, str) else roads
    request = BatchRequest(config_of(config), count, seed)
    result = run_batch(
        Path(corpus), names, target, request, templates=templates, workers=Workers(workers)
    )
    return _table(target, result.failed)


def find(batch: str | Path, condition: str = "true", limit: int = 0) -> "DataFrame":
    """Return the scenarios of a batch, or the encounters of a corpus, that meet a condition.

    Args:
        batch: a batch or a corpus.
        condition: SQL over the columns; the documentation of `scenario-gen find` lists them.
        limit: number of rows, those with the smallest PET; 0: all.

    Raises:
        InputError: there is no batch, or the condition is invalid or takes too long.

    Example:
        >>> sg.find("out/batch", "pet < 2 and speed < 10").columns[:4].tolist()
        ['template', 'recording', 'kind', 'namespace']
    """
    with search(Path(batch), condition) as (_, matches):
        table: DataFrame = (matches.limit(limit) if limit else matches).df()
    return table


def _table(folder: Path, failed: Sequence[str]) -> "DataFrame":
    """Return all rows of a corpus or batch.

    Raises:
        RefusedError: a task failed.
    """
    if failed:
        raise RefusedError(
            f"{len(failed)} tasks failed; the first: {failed[0]}; call it again to try them again"
        )
    return find(folder)
