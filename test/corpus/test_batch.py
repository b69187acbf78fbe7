# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Batches: the same bytes by whomever, found again by what they are, made again alone; a killed run loses and doubles nothing."""

from dataclasses import replace
from functools import partial
from importlib.util import find_spec
import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
from pyarrow import parquet
import pytest
from support.source_files import ROOT

from scenario_gen.bags.recordings.read import load, read_recording
from scenario_gen.bags.recordings.write import scenario_bytes
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import sha256_of
from scenario_gen.cli.commands import main
from scenario_gen.corpus.batch import run_batch
from scenario_gen.corpus.find import coverage_lines, export_hits, find
from scenario_gen.corpus.parts import BatchRequest
from scenario_gen.corpus.tables import rows_of
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.sampling import SamplingConfig

pytestmark = pytest.mark.xdist_group("corpus")
ROADS = ("corridor", "straight")
REQUEST, TEMPLATES = BatchRequest(count=3, seed=5, bags="hits", hits="index % 2 = 0"), 3
PATIENCE = 300.0  # seconds in which a process is at work
interruptible = partial(
    signal.signal, signal.SIGINT, signal.SIG_DFL
)  # a shell may have it ignored


def digests(out):
    return {
        path.relative_to(out): sha256_of(path)
        for path in out.rglob("*")
        if path.suffix in (".parquet", ".mcap", ".yaml")
    }


@pytest.fixture(scope="module")
def batch(corpus, tmp_path_factory):
    out = tmp_path_factory.mktemp("batch") / "out"
    return out, run_batch(corpus[0], ROADS, out, REQUEST, templates=TEMPLATES)


def test_every_case_is_accounted_for(batch):
    out, made = batch
    cases = list(rows_of(sorted((out / "cases").rglob("*.parquet"))))
    assert made.cases == len(cases) == 6 and made.requested == 18 and not made.failed
    assert sum(case["published"] for case in cases) == made.scenarios == len(find(out).rows) > 6
    assert all(
        case["cause"] and (case["why"] or case["candidates"])
        for case in cases
        if not case["published"]
    )
    assert len({case["seed"] for case in cases}) == 6


def test_scenarios_are_found_and_copied(batch, tmp_path, monkeypatch, capsys):
    out, made = batch
    condition = "road = 'corridor' and speed > 1 and index % 2 = 0"
    found = find(out, condition)
    assert found.rows[0]["road"] == "corridor"
    words = [
        "scenario-gen",
        "--json",
        "find",
        str(out),
        condition,
        "--limit",
        "1",
        "--bag",
        str(tmp_path / "hits"),
    ]
    monkeypatch.setattr("sys.argv", words)
    with pytest.raises(SystemExit):
        main()
    told = capsys.readouterr()
    total = len(found.rows)
    assert total > 1 and f"{total} scenarios; the first 1 are listed" in told.err
    assert len(json.loads(told.out)["scenarios"]) == total, (
        "a limit of what is listed leaves nothing out of the results"
    )
    namespaces = read_recording(tmp_path / "hits").namespaces
    assert {one.hashes for one in namespaces.values()} == {(row["sha256"],) for row in found.rows}
    assert (
        sum(count for *_, count in found.coverage) == made.scenarios
        and "coverage" in coverage_lines(found, out)[0]
    )
    with pytest.raises(InputError, match="differs from the table"):
        export_hits(out, [found.rows[0] | {"sha256": "0"}], tmp_path / "none")
    with pytest.raises(InputError, match="no scenario 1; it has: "):
        export_hits(out, find(out, "index = 1", limit=1).rows, tmp_path / "none")
    with pytest.raises(InputError, match="the columns are"):
        find(out, "colour = 'red'")
    with pytest.raises(InputError, match="no scenario matches; nothing exported"):
        export_hits(out, [], tmp_path / "none")
    for hostile in (
        "sha256 in (select content from read_text('/etc/hostname'))",
        f"true); COPY scenarios TO '{tmp_path}/a.csv'; --",
        f"true); ATTACH '{tmp_path}/a.db' AS a; --",
        "true); DROP TABLE scenarios; --",
        "true) UNION ALL SELECT * FROM scenarios --",
        "",
    ):
        with pytest.raises(InputError, match="condition"):
            find(out, hostile)
    assert not list(tmp_path.glob("a.*"))
    for endless in (
        "(SELECT count(*) FROM range(1000000000000)) > 0",
        "1 IN (WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM r) SELECT n FROM r"
        " WHERE n < 0)",
    ):
        with pytest.raises(InputError, match=r"takes more than 0\.5 s and is stopped"):
            find(out, endless, seconds=0.5)
    limited = find(out, limit=2)
    assert limited.rows == find(out).rows[:2] and limited.count == made.scenarios


def test_batch_resumes_only_as_itself(batch, corpus):
    out, _ = batch
    before = digests(out)
    (
        out / "cases" / "road=straight" / "part-00000.parquet"
    ).unlink()  # as if killed before its last file
    assert not find(out, "road = 'straight'").rows
    run_batch(corpus[0], ROADS, out, REQUEST, templates=TEMPLATES)
    assert digests(out) == before
    for other, said in (({"count": 2}, "other count"), ({"seed": 6}, "other seed")):
        with pytest.raises(InputError, match=said):
            run_batch(corpus[0], ROADS, out, replace(REQUEST, **other), templates=TEMPLATES)


def test_batch_grows_by_what_it_lacks(corpus, tmp_path):
    """By templates, roads and scenarios; what is there is neither written again nor changed."""
    out = tmp_path / "out"

    def grown(roads, count, templates):
        before = {path: path.stat().st_mtime_ns for path in out.rglob("*.parquet")}
        made = run_batch(corpus[0], roads, out, BatchRequest(count=count), templates=templates)
        now = {path: path.stat().st_mtime_ns for path in out.rglob("*.parquet")}
        assert before.items() <= now.items() and made.requested == made.cases * count
        return len(now) - len(before), made.cases

    assert grown(ROADS[:1], 1, 1)[1] == 1
    assert grown(ROADS[:1], 1, 2)[1] == 2
    before = find(out).rows
    assert grown(ROADS[:1], 1, 2)[0] == 0
    assert grown(ROADS, 1, 2)[1] == 4
    assert grown(ROADS, 2, 2)[1] == 4
    after = find(out).rows
    assert all(row in after for row in before) and len({row["sha256"] for row in after}) == len(
        after
    )


def test_trajectories_are_those_of_the_scenarios(batch, tmp_path):
    """As pandas reads them, with units, within 2 mm of the bag; the page's code reads them."""
    out, made = batch
    page = (ROOT / "docs" / "corpus.md").read_text().replace("out/batch", str(out))
    for code in re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        library = re.search(r"import (\w+)", code)[1]
        if find_spec(library) is not None:  # polars is not among the libraries of the tests
            exec(code, {})
    table = pd.read_parquet(out / "trajectories")
    assert table["sha256"].nunique() == made.scenarios and {"kind", "road"} <= set(table)
    rows = find(out, "road = 'corridor' and index % 2 = 0").rows
    export_hits(out, rows, tmp_path / "hits")
    for name in read_recording(tmp_path / "hits").results:
        result = load(tmp_path / "hits", namespace=name)
        (scenario,) = result
        hit = table[table["sha256"] == scenario_bytes(scenario, result.encounter)[1]]
        for vehicle, samples in zip(hit["vehicle"], hit["trajectory"], strict=True):
            x = scenario.position[scenario.ids.index(vehicle), :, 0]
            assert np.abs(x - [sample["x"] for sample in samples]).max() < 0.002
    schema = parquet.read_schema(next((out / "trajectories").rglob("*.parquet")))
    sample = schema.field("trajectory").type.value_type
    assert [(field.name, field.metadata[b"unit"]) for field in sample] == [
        ("t", b"s"), ("x", b"m"), ("y", b"m"), ("heading", b"rad"), ("speed", b"m/s"),
    ]  # fmt: skip


def at_work(run, folder, pattern):
    """Wait until a process has made what matches a pattern; it must not end before, nor take for ever."""
    end = time.monotonic() + PATIENCE
    while not list(folder.rglob(pattern)):
        assert run.poll() is None and time.monotonic() < end, (
            "it ended, or did nothing, before it could be stopped"
        )
        time.sleep(0.01)


FOREVER = "(SELECT count(*) FROM range(100000000) a, range(100000000) b WHERE a.range * b.range % 7 = 3) > pet"


def test_ended_find_leaves_nothing(batch, tmp_path):
    words = [sys.executable, "-m", "scenario_gen", "find", str(batch[0])]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    place = os.environ | {"TMPDIR": str(tmp_path)}
    with subprocess.Popen(
        [*words, FOREVER],
        preexec_fn=interruptible,  # noqa: PLW1509 - one thread
        env=place,
        **quiet,
    ) as run:
        at_work(run, tmp_path, ".scenario_gen*")
        run.send_signal(signal.SIGINT)
    assert not list(tmp_path.glob(".scenario_gen*"))


def test_drawn_decisions_have_one_set_each(corpus, tmp_path):
    drawn = BatchRequest(PipelineConfig(sampling=SamplingConfig(decisions="drawn")), 8, 5)
    made = run_batch(corpus[0], ["corridor"], tmp_path / "out", drawn, templates=3)
    cases = list(rows_of(sorted((tmp_path / "out" / "cases").rglob("*.parquet"))))
    assert made.cases == 3 < len(cases) and made.requested == 24 and not made.failed
    assert len({case["namespace"] for case in cases}) == len(cases)
    assert "goes first" in made.outcomes and sum(made.outcomes.values()) <= made.scenarios
    first, *_ = find(tmp_path / "out", "outcome = 'goes first'").rows
    assert 0.0 < first["probability"] < 1.0
