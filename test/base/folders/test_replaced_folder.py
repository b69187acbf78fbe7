# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a result may replace, and what it never touches."""

from contextlib import suppress
import errno
import json
import os
from pathlib import Path
import subprocess
import sys

from failing_disk import content, KIND, write_nothing, write_texts
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import Kind, MARKER, replace, replaced_folder
from scenario_gen.base.folders.claim import GUARD, OWNER, PREFIX


@pytest.fixture
def out(tmp_path):
    """An earlier result, alone in its folder."""
    write_texts(tmp_path / "here" / "out", 2)
    return tmp_path / "here" / "out"


def test_a_new_result_replaces_an_earlier_one_and_says_what_it_is(out):
    before = content(out)
    write_texts(out, 3)
    after = content(out)
    assert after["one.txt"] == b"one.txt" * 3 and after != before
    marker = json.loads(after[MARKER])
    assert marker["kind"] == "test" and marker["format"] == 1
    assert set(marker["files"]) == {"one.txt", "inner/two.txt"}
    write_texts(out, 2)
    assert content(out) == before, "same input, same bytes, marker included"
    assert list(out.parent.iterdir()) == [out]


def test_an_empty_folder_may_be_there_and_missing_ones_are_made(tmp_path):
    (tmp_path / "empty").mkdir()
    write_texts(tmp_path / "empty", 1)
    write_texts(tmp_path / "a" / "b" / "c", 1)
    assert (tmp_path / "empty" / "one.txt").exists() and (tmp_path / "a" / "b" / "c" / "one.txt").exists()
    write_nothing(tmp_path / "d" / "e" / "f")
    assert not (tmp_path / "d").exists()


def foreign_file(out):
    (out / "notes.txt").write_text("mine")
    return "notes.txt"


def foreign_file_deeper(out):
    (out / "inner" / "notes.txt").write_text("mine")
    return "inner/notes.txt"


def foreign_empty_folder(out):
    (out / "mine").mkdir()
    return "mine/"


def foreign_link(out):
    (out / "link").symlink_to("/nowhere")
    return "link"


def changed_file(out):
    (out / "one.txt").write_text("my own words")
    return "one.txt in it was changed"


def file_made_a_link(out):
    (out / "one.txt").unlink()
    (out / "one.txt").symlink_to("inner/two.txt")
    return "one.txt in it was changed"


def other_kind(out):
    (out / MARKER).write_text((out / MARKER).read_text().replace('"test"', '"another"'))
    return "another kind (another, not test)"


def newer_format(out):
    (out / MARKER).write_text((out / MARKER).read_text().replace('"format": 1', '"format": 2'))
    return "not one that this version writes"


def broken_marker(out):
    (out / MARKER).write_text("{")
    return "not one that this version writes"


def no_marker(out):
    (out / MARKER).unlink()
    return "is not an earlier result"


def read_only(out):
    out.chmod(0o555)
    return "read-only"


def a_file(out):
    out.rename(out.parent.parent / "moved")
    out.write_text("mine")
    return "is a file"


def a_link(out):
    out.rename(out.parent / "real")
    out.symlink_to("real")
    return "is a link"


def a_dangling_link(out):
    out.rename(out.parent.parent / "moved")
    out.symlink_to("nowhere")
    return "is a link"


SPOILED = (
    foreign_file,
    foreign_file_deeper,
    foreign_empty_folder,
    foreign_link,
    changed_file,
    file_made_a_link,
    other_kind,
    newer_format,
    broken_marker,
    no_marker,
    read_only,
    a_file,
    a_link,
    a_dangling_link,
)


@pytest.mark.parametrize("spoil", SPOILED)
def test_what_is_no_earlier_result_is_not_replaced(out, spoil):
    words = spoil(out)
    before = content(out.parent), sorted(out.parent.rglob("*"))
    with pytest.raises(InputError) as refused:
        write_texts(out, 3)
    assert words in str(refused.value) and str(out) in str(refused.value)
    assert (content(out.parent), sorted(out.parent.rglob("*"))) == before


def test_a_folder_without_a_marker_may_be_known_by_its_kind(out):
    (out / MARKER).unlink()
    kind = Kind("test", lambda folder: {path.name for path in folder.iterdir()} == {"one.txt", "inner"})
    with replaced_folder(out, kind) as folder:
        (folder / "new.txt").touch()
    assert set(content(out)) == {MARKER, "new.txt"}


@pytest.mark.parametrize("place", ["/", ".", "..", "/proc/out", "x" * 300, "y/" * 2500, "file/out", "loop/out", "a\0b"])
def test_places_where_no_result_can_be(tmp_path, monkeypatch, place):
    (tmp_path / "file").touch()
    (tmp_path / "loop").symlink_to("loop")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError):
        write_texts(Path(place), 1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "loop"]


def test_what_comes_while_a_result_is_made_is_kept(out, monkeypatch):
    with pytest.raises(InputError, match="notes"), replaced_folder(out, KIND) as folder:
        (folder / "new.txt").touch()
        (out / "notes.txt").write_text("mine")
    assert (out / "notes.txt").read_text() == "mine" and (out / "one.txt").exists()
    (out / "notes.txt").unlink()
    from scenario_gen.base.folders import replace

    exchange = replace.exchange

    def late(one, other):
        if not (one / "notes.txt").exists():
            (other / "notes.txt").write_text("mine")  # between the last look and the exchange
        return exchange(one, other)

    monkeypatch.setattr(replace, "exchange", late)
    with pytest.raises(InputError, match="notes"):
        write_texts(out, 3)
    assert (out / "notes.txt").read_text() == "mine" and (out / "one.txt").read_text() == "one.txt" * 2
    assert list(out.parent.iterdir()) == [out]


def test_inputs_are_not_replaced(out, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "link.txt").symlink_to(out / "inner" / "two.txt")
    (elsewhere / "log.txt").touch()
    for given in (out, out / "one.txt", out / "inner", elsewhere, elsewhere / "link.txt", out / ".." / "out" / "one.txt"):
        with pytest.raises(InputError, match="which is read"), replaced_folder(out, KIND, [given]):
            pass
    (elsewhere / "link.txt").unlink()
    for given in (elsewhere, elsewhere / "log.txt", tmp_path / "missing", Path("z" * 300)):
        with replaced_folder(out, KIND, [given]):
            pass


HOLDING = """
import sys
from pathlib import Path
from scenario_gen.base.folders import Kind, replaced_folder
with replaced_folder(Path(sys.argv[1]), Kind("test")) as folder:
    (folder / "half.txt").write_text("half")
    print("writing", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(out):
    """A process that is writing to `out`."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDING, str(out)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "writing\n"
    yield process
    process.kill()
    process.communicate()


def test_a_second_writer_is_refused_and_told_who_the_first_is(out, holder):
    with pytest.raises(InputError, match=rf"is being written by process {holder.pid} on .* since \d{{4}}-.*; wait for it"):
        write_texts(out, 3)
    assert (out / "one.txt").read_text() == "one.txt" * 2
    write_texts(out.with_name("other"), 3)
    holder.communicate("")
    assert holder.returncode == 0
    assert set(content(out)) == {MARKER, "half.txt"}, "the first is not disturbed"
    assert sorted(path.name for path in out.parent.iterdir()) == ["other", "out"]


@pytest.mark.parametrize("next_one", ["out", "other"])
def test_what_a_killed_run_left_is_removed_by_the_next_one(out, holder, next_one):
    holder.kill()
    holder.wait()
    assert len([path for path in out.parent.iterdir() if path.name.startswith(PREFIX)]) == 1
    write_texts(out.with_name(next_one), 3)
    assert {path.name for path in out.parent.iterdir()} == {"out", next_one}
    assert (out / "one.txt").read_text() == "one.txt" * (3 if next_one == "out" else 2)


@pytest.mark.parametrize("gone", [("inner/two.txt",), ("one.txt",), (MARKER,), ("inner/two.txt", MARKER)])
def test_an_earlier_result_whose_removal_was_cut_short_is_removed(out, gone):
    write_texts(out.with_name("earlier"), 3)
    left = out.parent / f"{PREFIX}dead"
    (left / "new").mkdir(parents=True)
    (left / OWNER).write_text(json.dumps({"target": "out", "pid": 1, "host": "h", "since": "s"}))
    out.with_name("earlier").rename(left / "new" / "out")
    for name in gone:
        (left / "new" / "out" / name).unlink()
    write_nothing(out)
    assert list(out.parent.iterdir()) == [out]


def test_leftovers_that_may_be_another_s_stay(out):
    """Folders of like names: without an owner, with another's, with more in them than we put there."""
    here = out.parent
    (here / ".out.partial").mkdir()
    owner = json.dumps({"target": "out", "pid": 1, "host": "h", "since": "s"})
    strange = {
        "none": {"mine.txt": "mine"},
        "text": {OWNER: "mine"},
        "json": {OWNER: json.dumps({"target": "../out", "pid": 1, "host": "h", "since": "s"})},
        "more": {OWNER: owner, "mine.txt": "mine"},
        "beside": {OWNER: owner, "new/mine.txt": "mine"},
    }
    for name, files in strange.items():
        for file, text in files.items():
            (here / f"{PREFIX}{name}" / file).parent.mkdir(parents=True, exist_ok=True)
            (here / f"{PREFIX}{name}" / file).write_text(text)
    before = content(here)
    write_texts(out, 3)
    write_texts(out, 2)
    assert content(here) == before and (here / ".out.partial").is_dir()
    (here / GUARD).write_text("mine")
    with pytest.raises(InputError, match="needed as a lock"):
        write_texts(out, 2)
    assert (here / GUARD).read_text() == "mine"


def test_an_earlier_result_that_waits_is_put_back_even_for_another_run(out, monkeypatch):
    """Where two folders cannot be exchanged, and the process is killed between the two renames."""
    from scenario_gen.base.folders import replace

    before = content(out)
    pid = os.fork()
    if pid == 0:
        monkeypatch.setattr(replace, "exchange", lambda *_: False)
        rename = os.rename
        monkeypatch.setattr(os, "rename", lambda *names: (rename(*names), os._exit(9)))
        with suppress(BaseException):
            write_texts(out, 3)
        os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 9
    assert not out.exists()
    write_nothing(out.with_name("other"))
    assert content(out) == before
    assert list(out.parent.iterdir()) == [out]


def test_an_earlier_result_that_cannot_be_put_back_is_named(out, monkeypatch):
    from scenario_gen.base.folders import replace

    before = content(out)
    monkeypatch.setattr(replace, "exchange", lambda *_: False)
    rename, calls = os.rename, []

    def one_only(*names):
        calls.append(names)
        if len(calls) > 1:
            raise OSError(5, os.strerror(5), names[0])
        rename(*names)

    monkeypatch.setattr(os, "rename", one_only)
    with pytest.raises(InputError, match=r"the earlier result is in .*old/out, the next run puts it back"):
        write_texts(out, 3)
    monkeypatch.undo()
    write_nothing(out)
    assert content(out) == before


def test_a_mount_point_and_a_read_only_file_system_are_refused(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "tmpfs", str(disk)], capture_output=True, text=True, check=False)
    if made.returncode:
        pytest.skip(f"no file system can be mounted here: {made.stderr.strip()}")
    try:
        with pytest.raises(InputError, match="mount point"):
            write_texts(disk, 1)
        write_texts(disk / "out", 2)
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        for name in ("out", "new"):
            with pytest.raises(InputError, match="Read-only file system"):
                write_texts(disk / name, 3)
        assert (disk / "out" / "one.txt").read_text() == "one.txt" * 2
    finally:
        subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.parametrize(
    ("number", "said"),
    [
        *((forbidden, "it cannot be written to: name another folder") for forbidden in (errno.EACCES, errno.EPERM, errno.EROFS)),
        (errno.ENOSPC, "make room, or name another folder"),
    ],
)
def test_a_place_that_cannot_be_written_to_is_told_from_a_full_one(tmp_path, monkeypatch, number, said):
    def refuse(place):
        raise OSError(number, os.strerror(number), str(place))

    monkeypatch.setattr(replace, "claim", refuse)
    with pytest.raises(InputError, match=f"{os.strerror(number)}; what was there is untouched; {said}$"):
        write_texts(tmp_path / "out", 1)
    assert list(tmp_path.iterdir()) == []
