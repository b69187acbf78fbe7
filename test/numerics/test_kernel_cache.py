# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A kernel has one compiled form, kept by what it is compiled from: its sources, those of what it calls, and their constants."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import shutil
import subprocess
import sys

import numpy as np
import pytest

from scenario_gen.numerics import kernel_cache
from scenario_gen.numerics.kernels import F, F2, I, kernel, OUT1

HELPER = """
from scenario_gen.numerics.kernels import kernel
OFFSET = {offset}
@kernel(inline=True)
def half(x):
    return {value} * x
"""
CALLER = """
from scenario_gen.numerics.kernels import F, kernel
from scenario_gen.helper_of_a_test import half, OFFSET
@kernel(F)
def quarter(x):
    return half(half(x)) + OFFSET
"""
SERVER = """
import os, sys, importlib.util
import scenario_gen.numerics.kernels
sys.dont_write_bytecode = True  # what is written twice in a second has the same stamp
def load(name, path):
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
for folder in map(str.strip, sys.stdin):
    if os.fork() == 0:
        load("scenario_gen.helper_of_a_test", folder + "/helper.py")
        print(load("scenario_gen.caller_of_a_test", folder + "/caller.py").quarter(8.0), flush=True)
        os._exit(0)
    os.wait()
"""


@contextmanager
def results(cache: Path) -> Iterator[Callable[[Path], float]]:
    """What the caller in a folder gives, each time in a process that knows no kernel yet: a fork of one that has loaded numba."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", SERVER], env=environment, **pipes) as server:

        def result(folder: Path) -> float:
            print(folder, file=server.stdin, flush=True)
            return float(server.stdout.readline())

        yield result
        server.stdin.close()


def compiled(cache: Path) -> int:
    """How many kernels are kept."""
    return len(list(cache.rglob("*.nbc")))


def test_a_cached_kernel_follows_what_it_is_compiled_from_and_not_where_that_lies(tmp_path):
    here, cache = tmp_path / "here", tmp_path / "cache"
    here.mkdir()
    (here / "caller.py").write_text(CALLER)
    (here / "helper.py").write_text(HELPER.format(value="0.5", offset=0.0))
    with results(cache) as result:
        assert result(here) == 2.0
        assert compiled(cache) == 1, "nothing was cached, so nothing is tested"
        copy = shutil.copytree(here, tmp_path / "elsewhere")  # as colcon and a clone do: other times, another place
        assert result(copy) == 2.0 and compiled(cache) == 1
        (here / "helper.py").write_text(HELPER.format(value="0.25", offset=0.0))
        assert result(here) == 0.5 and compiled(cache) == 2
        assert result(copy) == 2.0 and compiled(cache) == 2
        (here / "helper.py").write_text(HELPER.format(value="0.25", offset=1.0))
        assert result(here) == 1.5 and compiled(cache) == 3


def test_a_helper_is_called_by_kernels_alone():
    with pytest.raises(TypeError, match="called by kernels alone"):
        twice_the_sum(np.ones(2))


def test_what_no_version_needs_is_swept_after_a_time(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_cache, "folder", lambda: tmp_path)
    names = [digit * kernel_cache.DIGITS for digit in "abc"]
    for name in [*names, "of somebody else"]:
        (tmp_path / name).mkdir()
    for name in names[:2]:
        os.utime(tmp_path / name, (0.0, 0.0))
    assert kernel_cache.sweep({names[0]}) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([names[0], names[2], "of somebody else"])


def test_the_folder_is_the_users_own(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_cache.numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(kernel_cache.tempfile, "gettempdir", lambda: str(tmp_path))
    find = kernel_cache.folder.__wrapped__
    home, last = tmp_path / "home" / "scenario_gen" / "kernels", tmp_path / f"scenario_gen_kernels_{os.getuid()}"
    assert find() == home and home.stat().st_mode & 0o777 == 0o700
    home.chmod(0o777)  # somebody else may write what this user would run
    assert find() == last and last.stat().st_mode & 0o777 == 0o700
    last.rmdir()
    last.symlink_to("/")
    assert find() is None


@kernel(inline=True)
def twice_the_sum(values: np.ndarray) -> float:
    """Serve the test above."""
    return 2.0 * values.sum()


@kernel(F2, F, I, OUT1)
def add_rows(table: np.ndarray, factor: float, first: int, out: np.ndarray) -> None:
    """Put factor times the sum of the rows from `first` on into `out`."""
    out[:] = 0.0
    for k in range(first, table.shape[0]):
        out += factor * table[k]


@kernel(F2, OUT1)
def add_all_rows(table: np.ndarray, out: np.ndarray) -> None:
    """Call a kernel with what is writable where read-only is declared."""
    copy = table.copy()
    add_rows(copy, 1.0, 0, out)


def test_all_that_is_given_meets_one_compiled_form():
    table, out = np.arange(6.0).reshape(3, 2), np.empty(2)
    locked = table.copy()
    locked.flags.writeable = False
    for given in (table, locked, np.asfortranarray(table), table[:, ::-1][:, ::-1], table.astype(np.int32), table.tolist()):
        add_rows(given, 2, np.int64(1), out)
        np.testing.assert_array_equal(out, [12.0, 16.0])
    add_all_rows(table, out)
    np.testing.assert_array_equal(out, [6.0, 9.0])
    assert len(add_rows.signatures) == len(add_all_rows.signatures) == 1


@pytest.mark.parametrize(
    "given",
    [
        (np.zeros((2, 2)), 1.0, 0, np.zeros(4)[::2]),
        (np.zeros((2, 2)), 1.0, 0, np.zeros(2, dtype=int)),
        (np.zeros(2), 1.0, 0, np.zeros(2)),
        (np.zeros((2, 2), dtype=complex), 1.0, 0, np.zeros(2)),
        (np.zeros((2, 2)), 1.0, 0.5, np.zeros(2)),
        (np.zeros((2, 2)), "a", 0, np.zeros(2)),
        (np.zeros((2, 2)), 1.0, 0),
    ],
    ids=["a view as output", "an output of integers", "a dimension less", "complex", "half an index", "a word", "too few"],
)
def test_what_a_kernel_cannot_take_is_refused(given):
    with pytest.raises((TypeError, ValueError)):
        add_rows(*given)
