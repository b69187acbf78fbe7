# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One stage of the corpus in a process of its own, so that CPU and memory are its own: `python -m benchmarks._corpus_stage`."""

from collections.abc import Callable, Iterator
from functools import partial
import json
from pathlib import Path
import resource
import sys
import tempfile
import time

from benchmarks._archive import write_archive
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import clean_found
from scenario_gen.corpus.inventory import inventory
from scenario_gen.corpus.meetings import search_hour
from scenario_gen.corpus.messages import parse_range, ranges
from scenario_gen.corpus.schedule import accounts_of, clean_tasks, hour_tasks

STAGES = ("parse", "search", "clean")


def work(name: str, archive: Path, out: Path) -> Iterator[Callable[[], object]]:
    """Yield the tasks of a stage of `mine` on an archive."""
    config = CorpusConfig()
    messages = inventory([archive]).messages
    ranged = ranges(messages, out / "messages", config.range_size << 20, config.memory)
    if name == "parse":
        yield from (partial(parse_range, task) for task in ranged)
        return
    hours = hour_tasks(accounts_of(ranged), out, config)
    if name == "search":
        yield from (partial(search_hour, task) for task in hours)
    else:
        yield from (partial(clean_found, task) for task in clean_tasks(hours, out, config))


def warm(name: str) -> None:
    """Do the same on next to nothing, so that libraries and kernels are loaded."""
    with tempfile.TemporaryDirectory() as folder:
        archive = write_archive(Path(folder) / "archive", rows=6000, encounters=2, outside=0)
        for before in STAGES[: STAGES.index(name) + 1]:
            for task in work(before, archive, Path(folder) / "corpus"):
                task()


def main() -> None:
    """Run what the command line names: a stage, the archive, the corpus; or `write`, the archive, its settings."""
    name, archive, rest = sys.argv[1:]
    if name == "write":
        write_archive(Path(archive), 11, **json.loads(rest))
        return
    warm(name)
    found = []
    for task in work(name, Path(archive), Path(rest)):
        begun = time.process_time()
        task()
        found.append(time.process_time() - begun)
    mebibytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(json.dumps({"tasks": found, "mebibytes": mebibytes}))


if __name__ == "__main__":
    main()
