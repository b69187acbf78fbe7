# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scratch folders: gone at the end, of the living kept, of the dead swept, wherever a command may have left them."""

from contextlib import suppress
import multiprocessing
import os
import signal
import subprocess

import pytest
from support.killed import killed_in

from scenario_gen.base.folders import scratch
from scenario_gen.base.folders.scratch import PREFIX, sweep, sweep_beside
from scenario_gen.base.signals import ctrl_c_blocked, on_signal


def left(folder):
    return sorted(path for path in folder.rglob(f"{PREFIX}*"))


@pytest.mark.parametrize("error", [None, KeyError("a fault")])
def test_scratch_folder_goes_at_the_end(tmp_path, error):
    with suppress(KeyError), scratch(tmp_path) as place:
        killed_in(tmp_path)
        (place / "deep").mkdir()
        (place / "deep" / "file").write_text("x")
        assert place.parent.stat().st_mode & 0o777 == 0o700 and len(left(tmp_path)) == 2
        sweep(tmp_path)
        assert left(tmp_path) == [place.parent]
        if error:
            raise error
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("number", "stays"), [(signal.SIGINT, False), (signal.SIGKILL, True)])
def test_folder_goes_with_its_holder(tmp_path, number, stays):
    """By Ctrl-C at once, after SIGKILL with the next command."""
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
    sweep(tmp_path)
    assert not left(tmp_path)


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


@pytest.mark.parametrize("words", [["{}"], ["--out={}"], ["x", "{}/bag"], ["\0", "{}/"]])
def test_command_sweeps_where_its_words_point(tmp_path, words):
    places = [
        tmp_path / "batch",
        tmp_path / "batch" / "cases",
        tmp_path / "batch" / "bags" / "road=a",
    ]
    deep = not any("bag" in word for word in words)
    for folder in places if deep else places[:1]:
        killed_in(folder)
    (tmp_path / "batch" / ".scenario_gen-notes").write_text("somebody's own")
    sweep_beside([word.format(tmp_path / "batch") for word in words])
    assert [path.name for path in left(tmp_path)] == [".scenario_gen-notes"]
