# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A fault costs what it touches: sound rows are mined, the rest is counted and named; a mended file is parsed again alone."""

from collections import Counter
import gzip
import os
from pathlib import Path

import numpy as np
import pytest

from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.mine import mine
from scenario_gen.corpus.mine import UNREAD as UNREAD_KINDS
from scenario_gen.corpus.tables import rows_of
from scenario_gen.logs.text import SPMD_COLUMNS

COUNT = 2000
NOISE = np.random.default_rng(1).bytes(4096)
LINES = [
    f"1,1,{k % 3},{2 * 10**14 + k * 100_000},0,1,65535,4{k % 3}.1,-83.2,200,9,90,0,0,0,0,1,0,0".encode()
    for k in range(COUNT)
]
TEXT = b"\n".join(LINES) + b"\n"
PACKED = gzip.compress(TEXT)
HALF = len(TEXT) // 2 + 9  # within a row
WRONG = LINES[7].replace(b"200000000700000", b"2000000000000000")
FAULTS = {  # the bytes of a file, and its sound rows
    "bad byte": (TEXT[:HALF] + b"\xff" + TEXT[HALF + 1 :], COUNT - 1),
    "first row": (TEXT.replace(b"40.1", b"4\xff.1", 1), COUNT - 1),
    "mixed line ends": (b"".join(r + b"\r\n"[k % 2 :] for k, r in enumerate(LINES)), COUNT),
    "cut": (TEXT[:HALF], TEXT[:HALF].count(b"\n")),
    "empty": (b"", 0),
    "foreign": (b"\x89PNG\r\n\x1a\n" + NOISE, 0),
    "noise": (TEXT[:HALF] + NOISE + TEXT[HALF:], COUNT - 1),
    "NULs": (TEXT[:HALF] + bytes(4096) + TEXT[HALF:], COUNT - 1),
    "quotes": (TEXT[:HALF] + b'"' + TEXT[HALF:], COUNT - 1),
    "wrong stamp": (TEXT.replace(LINES[7], WRONG), COUNT - 1),
    "lone CR": (TEXT[:HALF] + b"\r" + TEXT[HALF:], COUNT - 1),
    "missing column": (b"\n".join(line[4:] for line in LINES), 0),
    "packed and cut": (PACKED[:-8], COUNT),
    "wrong checksum": (PACKED[:-8] + bytes([PACKED[-8] ^ 1]) + PACKED[-7:], COUNT),
    "one row of eight": (TEXT + b"1,2,3\n" * (COUNT // 7), COUNT),
    "a header, quotes": (
        (",".join(SPMD_COLUMNS) + "\n").encode()
        + b"\n".join(b'"' + b'","'.join(line.split(b",")) + b'"' for line in LINES)
        + b'\n"1","2\n',
        COUNT,
    ),
}


UNREAD = (
    "empty",
    "foreign",
    "missing column",
    "packed and cut",
    "wrong checksum",
    "one row of eight",
)


@pytest.fixture(scope="module")
def mined(tmp_path_factory):
    """An archive with all of these files, and the rows that are kept of each."""
    archive = tmp_path_factory.mktemp("faulty") / "in"
    archive.mkdir()
    for name, (data, _) in FAULTS.items():
        suffix = ".csv.gz" if data[:2] == b"\x1f\x8b" else ".csv"
        (archive / (name + suffix)).write_bytes(data)
    result = mine([archive], archive.with_name("out"))
    kept = Counter()
    for row in rows_of(sorted(archive.with_name("out").glob("messages/*.account"))):
        kept[Path(row["file"]).name.partition(".")[0]] += row["rows"] * (not row["cause"])
    return result, kept


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_costs_its_rows(mined, fault):
    result, kept = mined
    sound = FAULTS[fault][1]
    assert 0.999 * sound - 1 <= kept.get(fault, 0) <= sound and not result.failed
    unread = [finding for finding in result.findings if finding.kind in UNREAD_KINDS]
    assert result.findings[: len(unread)] == unread
    is_named = any(f"/{fault}." in why for one in unread for why in one.entries.values())
    assert is_named == (fault in UNREAD)
    assert result.read == (len(FAULTS) - len(UNREAD), len(FAULTS))


def test_changed_files_cost_their_own_ranges(archive, tmp_path):
    rows = sorted(archive.glob("*.csv"))[0].read_bytes().splitlines(keepends=True)[:16_000]
    parts = [b"".join(rows[k::5]) for k in range(5)]
    folder, out = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    for k, part in enumerate(parts):
        (folder / f"{k}.csv").write_bytes(part[:2000] + NOISE * (k == 1) + part[2000:])

    def tables():
        return {path: path.stat().st_mtime_ns for path in out.rglob("*.parquet")}

    config = CorpusConfig(range_size=1)  # MiB, so that no files are parsed together
    mine([folder], out, config)
    before = tables()
    (folder / "1.csv").write_bytes(parts[1])
    os.utime(folder / "1.csv", ns=(1, 1))
    mended = mine([folder], out, config)
    ranges = [path for path in tables() if "range-" in path.name]
    assert len(ranges) == 5 and sum(before.get(path) == tables()[path] for path in ranges) == 4
    (folder / "0.csv").rename(folder / "new.csv")
    assert mine([folder], out, config).encounters == mended.encounters
    assert len(list((out / "messages").glob("*.parquet"))) == 5
