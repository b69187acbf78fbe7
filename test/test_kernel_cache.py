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

"""Kernels are compiled again when a kernel that they call, in another file, has changed."""

from pathlib import Path
import subprocess
import sys

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
