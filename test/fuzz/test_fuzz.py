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

"""Every reader gets damaged inputs for two seconds, every decoder 200 of them; more of it: `make soak PART=fuzz`."""

from harness import fuzz, targets
import pytest

TARGETS = targets()


@pytest.mark.parametrize("name", TARGETS)
def test_nothing_but_errors_of_ours_comes_out(name, tmp_path):
    executions, seconds = (200, 60.0) if name.startswith(("message_", "template_")) else (100_000, 2.0)
    record = fuzz(TARGETS[name], tmp_path, executions=executions, seconds=seconds)
    assert record.executions > 0
    assert not record.failures, "\n".join(f"{f.signature}: {f.message} ({tmp_path / f.file})" for f in record.failures.values())
