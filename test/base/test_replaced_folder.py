# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a result may replace, and what it never touches."""

import json
from pathlib import Path
import subprocess
import sys

from failing_disk import KIND, write_texts
import pytest
from support.source_files import content

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import MARKER, NEW, OLD, PREFIX, replaced_folder


@pytest.fixture
def out(tmp_path):
    """An earlier result, alone in its folder."""
    write_texts(tmp_path / "here" / "out", 2)
    return tmp_path / "here" / "out"


def test_new_result_replaces_an_earlier_one(out):
    before = content(out)
    write_texts(out, 3)
    after = content(out)
    assert after["one.txt"] == b"one.txt" * 3 and after != before
    marker = json.loads(after[MARKER])
    assert marker["kind"] == KIND and set(marker["files"]) == {"one.txt", "inner/two.txt"}
    write_texts(out, 2)
    assert content(out) == before, "same input, same bytes, marker included"
    assert list(out.parent.iterdir()) == [out]


def test_missing_folders_are_made(tmp_path):
    (tmp_path / "empty").mkdir()
    write_texts(tmp_path / "empty", 1)
    write_texts(tmp_path / "a" / "b" / "c", 1)
    assert (tmp_path / "empty" / "one.txt").exists() and (
        tmp_path / "a" / "b" / "c" / "one.txt"
    ).exists()
    with pytest.raises(ZeroDivisionError), replaced_folder(tmp_path / "d" / "e" / "f", KIND):
        raise ZeroDivisionError
    assert not (tmp_path / "d").exists()


def moved(out):
    out.rename(out.parent.parent / "moved")
    return out


SPOILED = {
    "inner/notes.txt": lambda out: (out / "inner" / "notes.txt").write_text("mine"),
    "link": lambda out: (out / "link").symlink_to("/nowhere"),
    "one.txt in it": lambda out: (out / "one.txt").write_text("my own words"),
    "earlier result (bag)": lambda out: (out / MARKER).write_text(
        '{"kind": "another", "format": 1, "files": {}}'
    ),
    "is not an earlier result": lambda out: (out / MARKER).write_text("{"),
    "is a file": lambda out: moved(out).write_text("mine"),
    "is a link": lambda out: moved(out).symlink_to("../moved"),
    "a link": lambda out: moved(out).symlink_to("nowhere"),
}


@pytest.mark.parametrize("words", SPOILED)
def test_other_folders_are_not_replaced(out, words):
    SPOILED[words](out)
    before = content(out.parent), sorted(out.parent.rglob("*"))
    with pytest.raises(InputError, match="name another folder") as refused:
        write_texts(out, 3)
    assert words in str(refused.value) and str(out) in str(refused.value)
    assert (content(out.parent), sorted(out.parent.rglob("*"))) == before


@pytest.mark.parametrize(
    "place", ["/", ".", "..", "/proc/out", "x" * 300, "y/" * 2500, "file/out", "loop/out", "a\0b"]
)
def test_places_where_no_result_can_be(tmp_path, monkeypatch, place):
    (tmp_path / "file").touch()
    (tmp_path / "loop").symlink_to("loop")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError):
        write_texts(Path(place), 1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "loop"]


def test_file_added_meanwhile_is_kept(out):
    with pytest.raises(InputError, match="notes"), replaced_folder(out, KIND):
        (out / "notes.txt").write_text("mine")
    assert (out / "notes.txt").read_text() == "mine" and (out / "one.txt").exists()
    assert list(out.parent.iterdir()) == [out]


def test_inputs_are_not_replaced(out, tmp_path):
    (tmp_path / "link.txt").symlink_to(out / "inner" / "two.txt")
    for given in (
        out,
        out / "one.txt",
        out / "inner",
        tmp_path / "link.txt",
        out / ".." / "out" / "one.txt",
    ):
        with (
            pytest.raises(InputError, match="an input of this command"),
            replaced_folder(out, KIND, [given]),
        ):
            pass
    for given in (tmp_path, tmp_path / "missing", Path("z" * 300)):
        with replaced_folder(out, KIND, [given]):
            pass


HOLDING = """
import sys
from pathlib import Path
from scenario_gen.base.folders import Kind, replaced_folder
with replaced_folder(Path(sys.argv[1]), Kind("bag")) as folder:
    (folder / "half.txt").write_text("half")
    print("writing", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(out):
    """A process that is writing to `out`."""
    words = [sys.executable, "-c", HOLDING, str(out)]
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "writing\n"
        yield process
        process.kill()


def test_second_writer_is_refused(out, holder):
    with pytest.raises(
        InputError, match=rf"is being written by process {holder.pid} on .*; wait for it"
    ):
        write_texts(out, 3)
    write_texts(out.with_name("other"), 3)
    holder.communicate("")
    assert holder.returncode == 0
    assert set(content(out)) == {MARKER, "half.txt"}, "the first is not disturbed"
    assert sorted(path.name for path in out.parent.iterdir()) == ["other", "out"]


def test_killed_run_is_swept(out, holder):
    holder.kill()
    holder.wait()
    assert len(list(out.parent.iterdir())) == 2
    write_texts(out, 3)
    assert list(out.parent.iterdir()) == [out]
    assert (out / "one.txt").read_text() == "one.txt" * 3


def test_leftovers_of_others_stay(out):
    own = out.with_name(f"{PREFIX}out")
    own.mkdir()
    (own / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match=f"{PREFIX}out is needed .*; move it away"):
        write_texts(out, 3)
    assert (own / "mine.txt").exists() and (out / "one.txt").read_text() == "one.txt" * 2
    (own / "mine.txt").unlink()
    (own / "lock").touch()  # killed between two renames; then something else took the place
    out.rename(own / OLD)
    (own / NEW / "out").mkdir(parents=True)
    out.write_text("mine")
    with pytest.raises(InputError, match="is a file"):
        write_texts(out, 3)
    assert out.read_text() == "mine" and (own / OLD / "one.txt").exists()
    out.unlink()
    with pytest.raises(ZeroDivisionError), replaced_folder(out, KIND):
        raise ZeroDivisionError
    assert list(out.parent.iterdir()) == [out] and (out / "one.txt").exists()
