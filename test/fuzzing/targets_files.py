# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Public recordings, scenario files and the tables of a corpus as targets; several files are one input, with names between."""

from collections.abc import Callable, Sequence
from pathlib import Path
import random
import re

from fuzzing.harness import Mutator, Target
from fuzzing.mutators import BYTES, TEXT, tree
from fuzzing.targets_bags import JSON
from fuzzing.targets_logs import safety_messages, SHORT
from fuzzing.targets_maps import MAP
import pandas as pd
from support.recording_files import (
    argoverse2,
    commonroad,
    highd,
    ind,
    interaction,
    nocturne,
    omega_prime,
)

from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import (
    account_of,
    encounter_of,
    row_of,
    tables_of,
    write_encounters,
)
from scenario_gen.corpus.find import coverage_lines, find
from scenario_gen.corpus.messages import parse_range, ranges
from scenario_gen.corpus.parts import CASE_COLUMNS, SCENARIO_COLUMNS
from scenario_gen.corpus.sources import message_table
from scenario_gen.corpus.tables import rows_of
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled

FILE = re.compile(rb"\n\x00FILE ([\w./=-]+)\x00\n")  # begins a file of an input of several
WAYS: dict[str, Sequence[Mutator]] = {
    ".csv": TEXT,
    ".parquet": BYTES,
    ".mcap": BYTES,
    ".xml": MAP,
    ".xosc": (*MAP, *[tree] * 6),
    ".json": JSON,
}


def packed(folder: Path) -> bytes:
    """Return the files below a folder as one input."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return b"".join(
        b"\n\x00FILE %s\x00\n%s" % (str(path.relative_to(folder)).encode(), path.read_bytes())
        for path in files
    )


def one_file(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Damage one file of an input in a way of its kind; seldom leave one out, or empty."""
    _, *parts = FILE.split(data)
    files = dict(zip(parts[::2], parts[1::2], strict=True))
    if not files:
        return rng.choice(seeds)
    name = rng.choice(list(files))
    if rng.random() < 0.02:
        files[name] = b""
    elif rng.random() < 0.02:
        del files[name]
    else:
        files[name] = rng.choice(WAYS[Path(name.decode()).suffix])(rng, files[name], [files[name]])
    return b"".join(b"\n\x00FILE %s\x00\n%s" % (key, content) for key, content in files.items())


def files_target(
    name: str,
    seeds: Callable[[Path], object],
    read: Callable[[Path], object],
    named: str = "input",
) -> Target:
    """Return a target whose input is a folder of files; messages name the folder, or what is in it."""

    def make(folder: Path) -> list[bytes]:
        (folder / "input").mkdir()
        seeds(folder / "input")
        return [packed(folder / "input")]

    def run(data: bytes, folder: Path) -> None:
        _, *parts = FILE.split(data)
        (folder / "input").mkdir()
        for key, content in zip(parts[::2], parts[1::2], strict=True):
            path = folder / "input" / key.decode()
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        read(folder / "input")

    return Target(name, make, run, (one_file,), named=named)


def read_all(folder: Path) -> None:
    """Read a folder of tables, or its only file, as a log."""
    main = [
        path
        for path in sorted(folder.iterdir())
        if path.suffix in (".parquet", ".xml", ".xosc", ".mcap")
    ]
    read_log(main[0] if main else folder, SHORT)


def corpus_tables(folder: Path) -> None:
    """Write a table of two encounters as a corpus has it."""
    rows = [
        row_of(read_log([bundled(case)]).encounters[0], "log", CorpusConfig()) for case in "bc"
    ]
    write_encounters(folder / "encounters" / "log-0.parquet", rows)


def read_corpus(folder: Path) -> None:
    """Read all encounters of a corpus."""
    for table in tables_of(folder):
        account_of(table)
        for row in rows_of([table]):
            encounter_of(row, table)


def archive(folder: Path) -> None:
    """Write an archive of safety messages."""
    (folder / "one.csv").write_bytes(safety_messages(folder)[0])


def parse_archive(folder: Path) -> None:
    """Parse an archive with the database."""
    files = [(path, table) for path in folder.glob("*.csv") if (table := message_table(path))]
    for task in ranges(files, folder.parent / "messages", 1 << 20, 400):
        parse_range(task)


def batch_tables(folder: Path) -> None:
    """Write the two tables of a part of a batch."""
    kinds = {"string": ["a", "b"], "int64": [1, 2], "double": [1.5, None], "string[]": [["a"], []]}
    for name, columns in (("scenarios", SCENARIO_COLUMNS), ("cases", CASE_COLUMNS)):
        place = folder / name / "road=straight" / "part-00000.parquet"
        place.parent.mkdir(parents=True)
        pd.DataFrame({column: kinds[kind] for column, kind in columns.items()}).to_parquet(place)


def find_all(folder: Path) -> None:
    """Find every scenario of a batch, and show its coverage."""
    coverage_lines(find(folder), folder)


TARGETS = (
    files_target("batch", batch_tables, find_all),
    files_target("argoverse2", argoverse2, read_all),
    files_target("interaction", interaction, read_all),
    files_target("ind", ind, read_all),
    files_target("highd", highd, read_all),
    files_target("commonroad_log", commonroad, read_all),
    files_target("nocturne", nocturne, read_all),
    files_target("omega_prime", omega_prime, read_all),
    files_target("corpus", corpus_tables, read_corpus),
    files_target("archive", archive, parse_archive),
)
