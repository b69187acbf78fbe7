# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A result on a disk that fails, or is full, at any call; a process that is killed at any call: nothing is lost, ever."""

from contextlib import suppress
import errno
import os
from pathlib import Path
import tempfile

from failing_disk import Failing, KIND, write_bag, write_texts
import pytest
from support.lengths import LONG
from support.source_files import content

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import replaced_folder


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder, in memory where that can be had; fsync is slow, and nothing here needs it: the kernel lives on."""
    monkeypatch.setattr(os, "fsync", lambda _: None)
    if not os.access("/dev/shm", os.W_OK):
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(dir="/dev/shm") as name:
        yield Path(name)


class Case:
    """Places for a result of some writer, with an earlier one or none."""

    def __init__(self, folder, write, earlier):
        self.folder, self.write, self.earlier = folder, write, earlier
        write(folder / "new" / "out", 5)
        write(folder / "former" / "out", 2)
        self.new, self.former = content(folder / "new" / "out"), content(folder / "former" / "out")

    def target(self, k):
        (self.folder / str(k)).mkdir()
        if self.earlier:
            self.write(self.folder / str(k) / "out", 2)
        return self.folder / str(k) / "out"

    def settled(self, target):
        """The next command finds one of the two results, whole, and leaves no more; a further run is as any other."""
        with suppress(ZeroDivisionError), replaced_folder(target, KIND):
            raise ZeroDivisionError
        assert content(target) in (self.new, self.former) if target.exists() else not self.earlier
        assert [path.name for path in target.parent.iterdir()] in ([], ["out"])
        self.write(target, 5)
        assert content(target) == self.new
        assert [path.name for path in target.parent.iterdir()] == ["out"]


EVERY = 1 if LONG else 8
CASES = {
    "texts": (write_texts, True),
    "nothing_there": (write_texts, False),
    "bag": (write_bag, True),
}


@pytest.mark.parametrize(
    ("name", "later_too"),
    [
        *((name, False) for name in CASES),
        *((name, True) for name in (CASES if LONG else ("texts",))),
    ],
)
def test_every_call_fails(folder, name, later_too):
    case = Case(folder, *CASES[name])
    for k in range(0, 1000, EVERY):

        def fail(call, k=k):
            if call == k or (later_too and call > k):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        target, failing, error = case.target(k), Failing(fail), ""
        with failing.disk():
            try:
                case.write(target, 5)
            except InputError as refused:
                error = str(refused)
        assert (
            content(target) == case.new
            if not error
            else "out" in error and len(error) < 500 and "Errno" not in error
        ), error
        case.settled(target)
        if failing.calls <= k:
            break
    assert k > 60, "fewer calls than that takes"


@pytest.mark.parametrize("name", CASES if LONG else ["texts"])
def test_process_is_killed_at_every_call(folder, name):
    case = Case(folder, *CASES[name])
    for k in range(0, 1000, EVERY):
        target = case.target(k)
        pid = os.fork()
        if pid == 0:
            try:
                with Failing(lambda call, k=k: os._exit(9) if call == k else None).disk():
                    case.write(target, 5)
                os._exit(0)
            finally:
                os._exit(1)
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        assert code in (0, 9)
        case.settled(target)
        if code == 0:
            break
    assert k > 40
