# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Mining: planted encounters are found and no others, rows left out are counted, the work can be cut off anywhere."""

import json
import shutil

from hypothesis import given, strategies
import numpy as np
import pytest
from support.archives import read_planted
from support.killed import killed_in

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.folders import sha256_of
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import encounter_of, tables_of
from scenario_gen.corpus.grouping import group, grouped, label
from scenario_gen.corpus.inventory import inventory
from scenario_gen.corpus.messages import NO_ROW, OTHER_CLOCK, parse_range, ranges
from scenario_gen.corpus.mine import mine, SHARED
from scenario_gen.corpus.tables import rows_of
from scenario_gen.logs import Meeting
from scenario_gen.logs.config import LogConfig
from scenario_gen.situation import Situation

pytestmark = pytest.mark.xdist_group("corpus")  # one archive for all


def found_in(out):
    rows = rows_of(tables_of(out), ["vehicles", "kind"])
    return {
        frozenset(int(name.partition("x")[0]) for name in row["vehicles"]): row["kind"]
        for row in rows
    }


def test_planted_encounters_are_found_with_their_kinds_and_those_just_outside_are_not(
    archive, corpus
):
    planted = {frozenset(one.devices): one.kind for one in read_planted(archive) if one.inside}
    found = found_in(corpus[0])
    assert found.keys() == planted.keys()
    assert np.mean([found[who] == kind for who, kind in planted.items()]) >= 0.95


def test_every_row_that_is_left_out_is_counted_by_file(archive, corpus):
    mined = corpus[1]
    truth = json.loads((archive / "synthetic.json").read_text())
    assert mined.account["rows"] == truth["rows"]
    assert mined.account[NO_ROW] == truth["damaged"]
    wrong = sum(
        mined.account[cause] for cause in mined.account if "clocks" in cause or "2004" in cause
    )
    assert (
        0.9 * truth["wrong_times"] <= wrong <= truth["wrong_times"]
    )  # a few agree with the other clock by chance
    assert SHARED in [finding.kind for finding in mined.findings]
    page = (corpus[0] / "encounters.html").read_text()
    assert page.count("<svg") == sum(min(n, 10) for n in mined.kinds.values())
    assert page.count("<tr><td>") == mined.encounters
    assert mined.files and not mined.failed


def test_who_reacts_to_whom_stands_in_table_and_page(corpus):
    page, kinds = (corpus[0] / "encounters.html").read_text(), {}
    for row in rows_of(tables_of(corpus[0])):
        found, encounter = json.loads(row["reactions"]), encounter_of(row)
        assert (encounter.name, encounter.duration, encounter.origin) == (
            row["name"],
            row["seconds"],
            (row["lat"], row["lon"]),
        )
        assert found["edges"] == [
            edge.document(encounter.vehicles) for edge in Situation.of(encounter).reactions.edges
        ]
        assert all(sentence in page for sentence in found["sentences"])
        kinds.setdefault(row["kind"], []).append([edge["kind"] for edge in found["edges"]])
    assert ["follow"] in kinds["following"] and not any(
        "follow" in found for found in kinds["oncoming"]
    )


def test_ranges_and_whole_files_give_the_same_rows(archive, tmp_path):
    from pyarrow import parquet

    files = inventory([archive]).messages
    seen = []
    for name, size in (("whole", 1 << 30), ("cut", 700_001)):
        for task in ranges(files, tmp_path / name / "messages", size, 200):
            parse_range(task)
        tables = sorted((tmp_path / name / "messages").glob("*.parquet"))
        rows = np.concatenate(
            [
                np.stack(
                    [
                        parquet.read_table(t, filters=[("cause", "=", 0)])[c].to_numpy()
                        for c in ("device", "t", "lat")
                    ]
                )
                for t in tables
            ],
            1,
        )
        account = rows_of([table.with_suffix(".account") for table in tables])
        seen.append(
            (
                rows[:, np.lexsort(rows)],
                sum(row["rows"] for row in account if not row["cause"].startswith("kept")),
            )
        )
    assert len(tables) > 5
    assert (seen[0][0] == seen[1][0]).all() and seen[0][1] == seen[1][1]


def test_what_is_missing_is_made_again_and_the_same(archive, corpus, tmp_path):
    """As after a kill: of each stage a file is gone, and a torn one lies there."""
    out, _ = corpus
    before = {path.relative_to(out): sha256_of(path) for path in out.rglob("*.parquet")}
    shutil.rmtree(min((out / "hours").iterdir()))
    for stage in ("messages", "hours", "encounters"):
        for table in sorted((out / stage).glob("*.parquet"))[:1]:
            table.unlink()
        killed_in(out / stage)
    killed_in(out)
    mine([archive], out)
    assert {path.relative_to(out): sha256_of(path) for path in out.rglob("*.parquet")} == before
    assert not list(out.rglob(".scenario_gen-*"))
    with pytest.raises(InputError, match="corpus with other parameters"):
        mine([archive], out, CorpusConfig(interaction=5.0))
    for inside in (archive, archive / "corpus"):
        with pytest.raises(InputError, match="is within the input"):
            mine([archive], inside)
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match=r"letter\.txt is a file; name a folder"):
        mine([archive], tmp_path / "letter.txt")
    with pytest.raises(InputError, match="is not empty and no corpus"):
        mine([archive], tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]


def test_a_file_that_cannot_be_read_is_said_and_does_not_end_the_others(archive, tmp_path):
    (tmp_path / "in").mkdir()
    row = "1,1,7,259200000000000,0,0,0,42.3,-83.7,250,0,0,0,0,0,0,0,0,100\n"
    (tmp_path / "in" / "a.csv").write_text(
        row + "0,0\n" + row.replace(",7,", ",,").replace("42.3", "95.0") + row[:40]
    )
    (tmp_path / "in" / "one.csv").write_text("t,x,y\n0,0,0\n1,1,0\n")
    (tmp_path / "in" / "wide.csv").write_text("1," * 100_000)
    (tmp_path / "in" / "packed.csv.gz").write_bytes(b"\x1f\x8b")
    mined = mine([tmp_path / "in"], tmp_path / "out")
    assert (
        mined.encounters == 0
        and not mined.failed
        and mined.read == (0, 4)
        and {str(file) for file in (tmp_path / "in").iterdir()}
        == {name for finding in mined.findings[:-1] for name in finding.entries}
        and "not a table" in str(mined.findings)
        and "unpacked" in str(mined.findings)
    )
    told = mined.lines()
    assert told[1].startswith("damaged: 1 (") and "a.csv: 3 of 4 rows left out: " in told[1]
    assert len({line.partition(":")[0] for line in told}) == len(told) == 2 + len(mined.findings)
    details = json.loads((tmp_path / "out" / "mine.json").read_text())["findings"]
    assert [(one["kind"], one["count"]) for one in details] == [
        (finding.kind, len(finding.entries)) for finding in mined.findings
    ]
    assert details[0]["kind"] == "damaged"
    with pytest.raises(RefusedError, match="without --strict it is left out"):
        mine([tmp_path / "in"], tmp_path / "out", strict=True)
    assert mined.account == {"rows": 4, NO_ROW: 2, "left out: no vehicle": 1}


def test_a_second_clock_that_is_another_one_is_not_asked_and_said(archive, tmp_path):
    """DSecond 20 s off in all rows of one of two files of a range; both of `_p001` and of a day that is not theirs."""
    (tmp_path / "in").mkdir()
    lines = (archive / sorted(archive.glob("*.csv"))[0].name).read_text().splitlines()[:8000]
    for name, add in (("TripStart_bsmrx_41000_p001.csv", 20_000), ("plain.csv", 0)):
        rows = [line.split(",") for line in lines]
        rows = [
            [*row[:6], str((int(row[6]) + add) % 60_000), *row[7:]]
            for row in rows
            if len(row) == 19
        ]
        (tmp_path / "in" / name).write_text("\n".join(map(",".join, rows)) + "\n")
    mined = mine([tmp_path / "in"], tmp_path / "out")
    entries = {finding.kind: list(finding.entries) for finding in mined.findings}
    assert len(entries[OTHER_CLOCK]) == 1 and "41000" in entries[OTHER_CLOCK][0]
    assert not mined.failed
    off, good = (
        mined.files[str(tmp_path / "in" / name)]
        for name in ("TripStart_bsmrx_41000_p001.csv", "plain.csv")
    )
    assert off["kept: stamps of another day"] > 3000 and not [
        why for why in off if "clocks" in why
    ]
    assert (
        0 < good["kept: stamps that run backwards"] <= off["kept: stamps that run backwards"]
    )  # one clock tells less


def test_nothing_to_read_is_an_error(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        mine([tmp_path / "nowhere"], tmp_path / "out")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="has no log in a known format"):
        mine([tmp_path / "empty"], tmp_path / "out")


def meeting(a, b, start, end, gap):
    return Meeting(gap, int(start * 1e6), a, b, int(end * 1e6))


def test_who_is_joined_to_whom():
    config = LogConfig()
    platoon = [meeting(k, k + 1, 0, 20, 1.0 + k) for k in range(3)]
    assert [one.devices for one in group(platoon, config)] == [
        (0, 1, 2),
        (2, 3),
    ]  # 3 meets one of three: too few
    apart = [meeting(1, 2, 0, 20, 1.0), meeting(2, 3, 30, 50, 1.0)]
    assert [one.devices for one in group(apart, config)] == [(1, 2), (2, 3)]
    crowd = [meeting(a, b, 0, 20, 1.0 + a) for b in range(15) for a in range(b)]
    assert max(len(one.devices) for one in group(crowd, config)) == config.max_vehicles
    brief = [meeting(1, 2, 0, 4, 1.0)]
    assert group(brief, config) == []
    assert label(17 + (2 << 40)) == "17x2"


@given(
    rows=strategies.lists(
        strategies.tuples(*(strategies.integers(0, high) for high in (4, 3, 150, 40, 9))).filter(
            lambda row: row[3] >= 3
        ),
        max_size=40,
    )
)
def test_meetings_in_order_of_time_give_the_encounters_of_all(rows):
    config = LogConfig(max_vehicles=3)
    meetings = [
        meeting(a, a + 1 + more, start, start + length, float(gap))
        for a, more, start, length, gap in rows
    ]
    in_order = sorted(meetings, key=lambda meeting: (meeting.start, meeting.a, meeting.b))
    assert list(grouped(in_order, config)) == group(meetings, config)


def test_small_tasks_give_the_same_corpus(archive, corpus, tmp_path):
    config = CorpusConfig(task_encounters=3)
    mine([archive], tmp_path / "out", config)
    assert len(tables_of(tmp_path / "out")) > 3
    assert list(rows_of(tables_of(tmp_path / "out"))) == list(rows_of(tables_of(corpus[0])))
