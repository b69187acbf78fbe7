# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A result on a disk that fails, or is full, at any call; a process that is killed at any call: nothing is lost, ever."""

from collections.abc import Callable
import errno
import os
from pathlib import Path
import signal
import subprocess
import tempfile
import time

from failing_disk import CHANGES, content, Failing, LOOKS, write_bag, write_nothing, write_texts
from lengths import LONG
import pytest

from scenario_gen.base.errors import InputError


@pytest.fixture(scope="module", autouse=True)
def fast():
    """Fsync is slow, and nothing here needs it: the kernel lives on."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield


@pytest.fixture
def folder(tmp_path):
    """An empty folder, in memory where that can be had."""
    if not os.access("/dev/shm", os.W_OK):
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(dir="/dev/shm") as name:
        yield Path(name)


class Case:
    """A place for a result of some writer, with an earlier one or none."""

    def __init__(self, folder: Path, write: Callable[[Path, int], None], earlier: bool) -> None:
        self.folder, self.write, self.earlier = folder, write, earlier
        self.whole = [self._written(folder / f"whole_{size}", size) for size in (5, 2)]
        if not earlier:
            self.whole.pop()

    def _written(self, above: Path, size: int) -> dict[str, bytes]:
        above.mkdir()
        self.write(above / "out", size)
        return content(above / "out")

    def target(self, k: int) -> Path:
        """A new place."""
        above = self.folder / str(k)
        above.mkdir()
        if self.earlier:
            self.write(above / "out", 2)
        return above / "out"

    def settled(self, target: Path) -> None:
        """One of the two results is there, whole; the next run finds no more than that, and leaves no more."""
        assert not target.exists() or content(target) in self.whole
        write_nothing(target)
        assert not self.earlier or target.exists()
        assert not target.exists() or content(target) in self.whole
        assert [path.name for path in target.parent.iterdir()] in ([], ["out"])
        self.write(target, 5)
        assert content(target) == self.whole[0]
        assert [path.name for path in target.parent.iterdir()] == ["out"]


CASES = {
    "exchange": (write_texts, True, True),
    "two_renames": (write_texts, True, False),
    "nothing_there": (write_texts, False, True),
    "bag": (write_bag, True, True),
}
LATER_TOO = CASES if LONG else ("exchange",)
KILLED = [name for name in CASES if name != "bag"] if LONG else ["exchange"]


@pytest.mark.parametrize(("name", "kind"), [*((name, "once") for name in CASES), *((name, "from_then_on") for name in LATER_TOO)])
def test_every_call_fails_once(folder, name, kind):
    write, earlier, exchanging = CASES[name]
    number = errno.EIO if kind == "once" else errno.ENOSPC
    case = Case(folder, write, earlier)
    for k in range(1000):

        def fail(call, k=k):
            if call == k or (kind == "from_then_on" and call > k):
                raise OSError(number, os.strerror(number))

        target = case.target(k)
        failing = Failing(fail)
        with failing.disk(exchanging, CHANGES if name == "bag" else CHANGES + LOOKS):
            try:
                write(target, 5)
                error = None
            except InputError as refused:
                error = str(refused)
        if error is None:
            assert content(target) == case.whole[0]
        else:
            assert "out" in error and len(error) < 500 and "Errno" not in error, error
        case.settled(target)
        if len(failing.calls) <= k:
            break
    assert k > 60, "fewer calls than that takes"


@pytest.mark.parametrize("name", KILLED)
def test_a_process_is_killed_at_every_call(folder, name):
    write, earlier, exchanging = CASES[name]

    def child(target, k):
        failing = Failing(lambda call: os._exit(9) if call == k else None)
        try:
            with failing.disk(exchanging):
                write(target, 5)
            os._exit(0)
        except BaseException:
            os._exit(1)

    case = Case(folder, write, earlier)
    for k in range(1000):
        target = case.target(k)
        pid = os.fork()
        if pid == 0:
            child(target, k)
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        assert code in (0, 9)
        if earlier and exchanging:
            assert target.exists(), "an exchange leaves no moment without a result"
        case.settled(target)
        if code == 0:
            break
    assert k > 40


def test_a_process_is_killed_at_any_time(folder):
    """The short form of `make soak PART=kills`: one that writes both results in turn, again and again."""

    def child(target):
        try:
            while True:
                for size in (5, 2):
                    write_texts(target, size)
        finally:
            os._exit(1)

    case = Case(folder, write_texts, earlier=True)
    target = case.target(0)
    for k in range(20):
        pid = os.fork()
        if pid == 0:
            child(target)
        time.sleep(0.002 * k)
        os.kill(pid, signal.SIGKILL)
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == -signal.SIGKILL
        assert content(target) in case.whole
        case.settled(target)


def test_a_disk_of_any_size_that_is_full(tmp_path):
    """A real one, page by page: the earlier result stays until the new one fits beside it."""
    disk = tmp_path / "disk"
    disk.mkdir()

    def mount(*options: str) -> "subprocess.CompletedProcess[str]":
        command = ["mount", "-t", "tmpfs", "-o", ",".join(options), "tmpfs", str(disk)]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    made = mount("size=400k")
    if made.returncode:
        pytest.skip(f"no file system can be mounted here: {made.stderr.strip()}")
    try:
        target = disk / "out"
        write_bag(target, 200)
        whole = content(target)
        write_bag(target, 2)
        earlier = content(target)
        seen = []
        for pages in range(2, 40):
            if mount("remount", f"size={4 * pages}k").returncode:
                continue  # less than what is there
            try:
                write_bag(target, 200)
            except InputError as error:
                assert "No space left on device" in str(error)
                assert content(target) == earlier
                seen.append("full")
            else:
                assert content(target) == whole
                seen.append("fits")
                mount("remount", "size=400k")
                write_bag(target, 2)
            assert [path.name for path in disk.iterdir()] == ["out"]
        assert seen.count("full") > 2 and seen.count("fits") > 2
    finally:
        subprocess.run(["umount", str(disk)], check=True)
