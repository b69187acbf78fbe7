# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scratch folders: gone at the end, of the living kept, of the dead swept."""

from contextlib import suppress
import multiprocessing
import os
import signal
import subprocess

import pytest

from scenario_gen.base.folders import PREFIX, scratch, sweep
from scenario_gen.base.signals import ctrl_c_blocked, on_signal


def left(folder):
    return sorted(path for path in folder.rglob(f"{PREFIX}*"))


@pytest.mark.parametrize("error", [None, KeyError("a fault")])
def test_scratch_folder_goes_at_the_end(tmp_path, error):
    with suppress(KeyError), scratch(tmp_path) as place:
        (place / "deep").mkdir()
        (place / "deep" / "file").write_text("x")
        assert place.stat().st_mode & 0o777 == 0o700 and left(tmp_path) == [place]
        if error:
            raise error
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("number", "stays"), [(signal.SIGINT, False), (signal.SIGKILL, True)])
def test_folder_goes_with_its_holder(tmp_path, number, stays):
    """By Ctrl-C at once, after SIGKILL when its parent is swept, somebody's own things never."""
    pid = os.fork()
    if not pid:
        try:
            signal.signal(signal.SIGINT, on_signal)
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            with scratch(tmp_path):
                os.kill(os.getpid(), number)
        finally:
            os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == -number
    assert bool(left(tmp_path)) == stays
    (tmp_path / f"{PREFIX}notes").mkdir()
    sweep(tmp_path)
    assert left(tmp_path) == [tmp_path / f"{PREFIX}notes"]


def test_children_ignore_ctrl_c():
    def said():
        run = subprocess.run(
            ["sh", "-c", "kill -INT $$; echo deaf"], capture_output=True, text=True, check=False
        )
        return run.stdout

    before = signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # a job in the background ignores it
    try:
        with ctrl_c_blocked():
            context = multiprocessing.get_context("spawn")
            context.Semaphore()  # which needs the tracker that unblocks it
            assert said() == "deaf\n"
        assert said() == ""
    finally:
        signal.signal(signal.SIGINT, before)
