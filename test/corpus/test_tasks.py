# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tasks: each is run once, in bundles of which the scheduler holds few; only the task that ends its workers fails."""

from contextlib import ExitStack
import pickle

from hypothesis import given
from hypothesis import strategies as st
import pytest
from refusing import Counted, end_worker, need_config, refuse, Shared, write_once

from scenario_gen.base.errors import InputError
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.tasks import BUNDLE, bundle_sizes, Spread, spread, WAVE, Workers

ALONE = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}


@given(st.integers(0, 5000), st.integers(1, 300))
def test_sizes_of_bundles(tasks, workers):
    sizes = bundle_sizes(tasks, workers)
    assert sum(sizes) == tasks and all(1 <= size <= BUNDLE for size in sizes)
    assert sizes == sorted(sizes, reverse=True) and set(sizes[-workers:]) <= {1}
    assert all(workers * size <= max(tasks - sum(sizes[:k]), workers) for k, size in enumerate(sizes))


def test_few_tasks_are_single_and_many_are_not():
    assert bundle_sizes(10, 8) == [1] * 10
    assert len(bundle_sizes(100_000, 1000)) < 21_000 and bundle_sizes(0, 3) == []


def test_every_task_of_a_bundle_is_run_once(tmp_path):
    told = []
    with spread(Workers(2, "", lambda *how: told.append(how))) as go:
        tasks = [Counted(str(k), tmp_path) for k in range(60)]
        assert go(write_once, tasks) == []
        assert go(write_once, tasks[:5]) == [f"{k}: {k} was run before" for k in range(5)]
    assert len(list(tmp_path.iterdir())) == 60
    assert [done for done, *_ in told] == [*range(1, 61), *range(1, 6)]


def test_only_the_task_that_ends_its_workers_fails(tmp_path):
    """Neither the others of its bundle, nor those that wait at the same worker."""
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
        with pytest.raises(InputError, match=f"{address} is lost .*goes on where it stopped"):
            go(write_once, [Counted("b", tmp_path)])


@pytest.mark.parametrize("workers", [1, 2])
def test_a_task_that_is_refused_does_not_end_the_others(workers):
    told = []
    with spread(Workers(workers, "", lambda *how: told.append(how))) as go:
        b, c = go(refuse, ["a", "b", "c"])
        assert b == "b: b is none" and c.startswith("c: KeyError at refusing.py:") and c.endswith(": KeyError 'c'")
    assert [done for done, *_ in told] == [1, 2, 3]


def test_a_cluster_that_runs_is_used():
    from distributed import LocalCluster

    with LocalCluster(**ALONE) as cluster, spread(Workers(1, cluster.scheduler_address)) as go:
        assert go(refuse, ["a", "b"]) == ["b: b is none"]


def test_tasks_are_submitted_in_waves_without_what_they_share():
    """The scheduler holds a few tasks for each worker, and the configuration goes to each worker once."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0") as cluster,
        Client(cluster) as client,
    ):
        sizes, held = [], []
        submit = client.map

        def watched(run, tasks, **options):
            sizes.extend(len(pickle.dumps((run, task))) for bundle in tasks for task in bundle)
            held.append(len(client.futures) + len(tasks))
            return submit(run, tasks, **options)

        client.map = watched
        go = Spread(Workers(1, cluster.scheduler_address), ExitStack())
        go._client = client
        config = CorpusConfig()
        assert go(need_config, [Shared(str(k), config) for k in range(40)]) == []
        assert len(sizes) == 40 and max(sizes) <= 500 and max(held) <= 2 * WAVE
