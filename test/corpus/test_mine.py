# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Mining: planted encounters are found and no others, rows left out are counted, the work can be cut off anywhere."""

import json
import shutil

from hypothesis import given, strategies
import numpy as np
import pytest
from synthetic_archive import read_planted

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import sha256_of, TEMPORARY
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import encounter_of, tables_of
from scenario_gen.corpus.grouping import group, grouped, label
from scenario_gen.corpus.messages import NO_ROW
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


def test_planted_encounters_are_found(archive, corpus):
    planted = {frozenset(one.devices): one.kind for one in read_planted(archive) if one.inside}
    found = found_in(corpus[0])
    assert found.keys() == planted.keys()
    assert np.mean([found[who] == kind for who, kind in planted.items()]) >= 0.95


def test_rows_left_out_are_counted(archive, corpus):
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


def test_reactions_stand_in_the_table(corpus):
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


def killed_in(folder):
    """Leave the folder of intermediate files of a process that was killed."""
    own = folder / f"{TEMPORARY}killed"
    own.mkdir(parents=True)
    (own / "torn.parquet").write_text("torn")


def test_missing_files_are_made_again(archive, corpus, tmp_path):
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
def test_ordered_meetings_give_all_encounters(rows):
    config = LogConfig(max_vehicles=3)
    meetings = [
        meeting(a, a + 1 + more, start, start + length, float(gap))
        for a, more, start, length, gap in rows
    ]
    in_order = sorted(meetings, key=lambda meeting: (meeting.start, meeting.a, meeting.b))
    assert list(grouped(in_order, config)) == group(meetings, config)
