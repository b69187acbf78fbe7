# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tasks: each is run once; only the task that ends its workers fails."""

import errno
import multiprocessing
import os

import pytest
from support.refusing import Counted, end_worker, refuse, write_once

from scenario_gen.corpus.tasks import arriving, spread, Workers


def test_every_task_is_run_once(tmp_path):
    told = []
    with spread(Workers(2, "", lambda *how: told.append(how))) as go:
        tasks = [Counted(str(k), tmp_path) for k in range(60)]
        assert go(write_once, tasks) == []
        assert go(write_once, tasks[:5]) == [f"{k}: {k} was run before" for k in range(5)]
    assert len(list(tmp_path.iterdir())) == 60
    assert [done for done, _ in told] == [*range(1, 61), *range(1, 6)]


def test_only_the_crashing_task_fails(tmp_path):
    told = []
    with spread(Workers(2, "", lambda *how: told.append(how))) as go:
        (failed,) = go(end_worker, [Counted(str(k), tmp_path) for k in range(30)])
    assert failed.startswith("7: its process died or cannot run it: ")
    assert {path.name for path in tmp_path.iterdir()} == {str(k) for k in range(30)} - {"7"}
    assert [done for done, *_ in told] == list(range(1, 31))
    assert not multiprocessing.active_children()


def test_full_disk_is_named_by_file(tmp_path):
    """Arrow's errors name no file, and others the temporary one."""
    for name in (None, "a.parquet"):
        with pytest.raises(OSError, match="No space") as error, arriving(tmp_path / "a") as part:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), name and str(part / name))
        assert error.value.filename == str(tmp_path / "a")
    with pytest.raises(FileNotFoundError) as error, arriving(tmp_path / "a"):
        (tmp_path / "input").read_text()
    assert error.value.filename == str(tmp_path / "input")


def test_refused_task_does_not_end_others():
    told = []
    with spread(Workers(1, "", lambda *how: told.append(how))) as go:
        b, c, d = go(refuse, ["a", "b", "c", "d"])
        assert (
            b == "b: b is none"
            and c.startswith("c: KeyError at refusing.py:")
            and c.endswith(": KeyError 'c'")
        )
        assert (
            d
            == "d: d.parquet: No space left on device; make room there, or name a place on another disk"
        )
    assert [done for done, *_ in told] == [1, 2, 3, 4]
