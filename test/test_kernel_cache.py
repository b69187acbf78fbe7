# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A kernel has one compiled form, which is made again when a kernel that it calls, in another file, has changed."""

from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest

from scenario_gen.kernels import F, F2, I, kernel, OUT1

HELPER = """
from scenario_gen.kernels import kernel
@kernel(inline=True)
def half(x):
    return {value} * x
"""
CALLER = """
from scenario_gen.kernels import F, kernel
from scenario_gen.helper_of_a_test import half
@kernel(F)
def quarter(x):
    return half(half(x))
"""
RUN = """
import sys, importlib.util
def load(name, path):
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
load("scenario_gen.helper_of_a_test", sys.argv[1] + "/helper.py")
print(load("scenario_gen.caller_of_a_test", sys.argv[1] + "/caller.py").quarter(8.0))
"""


def result(folder: Path) -> float:
    """What the caller gives in a fresh process."""
    done = subprocess.run([sys.executable, "-c", RUN, str(folder)], capture_output=True, text=True, check=True)
    return float(done.stdout)


def test_a_cached_kernel_follows_the_kernels_it_calls(tmp_path):
    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "helper.py").write_text(HELPER.format(value="0.5"))
    assert result(tmp_path) == 2.0
    assert list(tmp_path.rglob("*.nbi")), "nothing was cached, so nothing is tested"
    (tmp_path / "helper.py").write_text(HELPER.format(value="0.25"))
    assert result(tmp_path) == 0.5


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
