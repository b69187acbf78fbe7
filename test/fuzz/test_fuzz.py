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

"""Every reader and every decoder gets its valid inputs and some damaged ones; more of it: `make soak PART=fuzz`."""

from harness import corpus, CRASHES, found_crashes, fuzz, targets
from lengths import LONG
import pytest
from skips import NO_RECORDS

pytestmark = pytest.mark.spread
TARGETS = targets()
DAMAGED = 400 if LONG else 10


@pytest.mark.parametrize("name", TARGETS)
def test_nothing_but_errors_of_ours_comes_out(name, tmp_path):
    seeds = corpus(TARGETS[name], found=False)
    executions = len(seeds) + DAMAGED
    record = fuzz(TARGETS[name], tmp_path, executions, seconds=600.0, seeds=seeds)
    assert record.executions == executions
    assert not record.failures, "\n".join(f"{f.signature}: {f.message} ({tmp_path / f.file})" for f in record.failures.values())


@pytest.mark.recorded
@pytest.mark.parametrize("name", [name for name, target in TARGETS.items() if target.crashes])
def test_what_once_broke_a_reader_does_so_no_more(name, tmp_path):
    seeds = found_crashes(TARGETS[name])
    if not seeds:
        pytest.skip(f"{NO_RECORDS}: {CRASHES}")
    record = fuzz(TARGETS[name], tmp_path, len(seeds), seconds=600.0, seeds=seeds)
    assert record.executions == len(seeds)
    assert not record.failures, "\n".join(f"{f.signature}: {f.message}" for f in record.failures.values())
