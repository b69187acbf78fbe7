# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tasks: each is run once; only the task that ends its workers fails."""

import errno
import multiprocessing
import os

import pytest
from support.refusing import Counted, end_worker, refuse, write_once

from scenario_gen.base.errors import InputError
from scenario_gen.corpus.tasks import arriving, spread, Workers

ALONE = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}


def test_every_task_is_run_once(tmp_path):
    told = []
    with spread(Workers(2, "", lambda *how: told.append(how))) as go:
        tasks = [Counted(str(k), tmp_path) for k in range(60)]
        assert go(write_once, tasks) == []
        assert go(write_once, tasks[:5]) == [f"{k}: {k} was run before" for k in range(5)]
    assert len(list(tmp_path.iterdir())) == 60
    assert [done for done, _ in told] == [*range(1, 61), *range(1, 6)]


def test_only_the_task_that_ends_its_workers_fails(tmp_path):
    """Not those that wait at the same worker."""
    from dask import config
    from distributed import LocalCluster

    told, processes = [], ALONE | {"n_workers": 2, "processes": True}
    with (
        config.set({"distributed.scheduler.allowed-failures": 1}),
        LocalCluster(**processes) as cluster,
        spread(Workers(1, cluster.scheduler_address, lambda *how: told.append(how))) as go,
    ):
        (failed,) = go(end_worker, [Counted(str(k), tmp_path) for k in range(30)])
    assert failed.startswith("7: ") and "died" in failed
    assert {path.name for path in tmp_path.iterdir()} == {str(k) for k in range(30)} - {"7"}
    assert [done for done, *_ in told] == list(range(1, 31))


def test_only_the_task_that_ends_its_local_process_fails(tmp_path):
    told = []
    with spread(Workers(2, "", lambda *how: told.append(how))) as go:
        (failed,) = go(end_worker, [Counted(str(k), tmp_path) for k in range(30)])
    assert failed.startswith("7: its process died or cannot run it: ")
    assert {path.name for path in tmp_path.iterdir()} == {str(k) for k in range(30)} - {"7"}
    assert [done for done, *_ in told] == list(range(1, 31))
    assert not multiprocessing.active_children()


def test_a_scheduler_that_is_lost_is_named(tmp_path):
    from dask import config
    from distributed import LocalCluster

    with (
        config.set({"distributed.comm.timeouts.connect": "1s"}),
        LocalCluster(**ALONE) as cluster,
        spread(Workers(1, cluster.scheduler_address)) as go,
    ):
        address = cluster.scheduler_address
        assert go(write_once, [Counted("a", tmp_path)]) == []
        cluster.close()
        with pytest.raises(InputError, match=f"{address} is lost .*resumes where it stopped"):
            go(write_once, [Counted("b", tmp_path)])


def test_a_full_disk_is_named_by_the_file_that_was_to_be_written(tmp_path):
    """Arrow's errors name no file, and others the temporary one."""
    for name in (None, "a.parquet"):
        with pytest.raises(OSError, match="No space") as error, arriving(tmp_path / "a") as part:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), name and str(part / name))
        assert error.value.filename == str(tmp_path / "a")
    with pytest.raises(FileNotFoundError) as error, arriving(tmp_path / "a"):
        (tmp_path / "input").read_text()
    assert error.value.filename == str(tmp_path / "input")


def test_a_task_that_is_refused_does_not_end_the_others():
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
