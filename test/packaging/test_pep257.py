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

"""ament_pep257 in its Google convention, with the codes left out that its own convention leaves out."""

import pytest
from source_files import SOURCES

LEFT_OUT = [f"D10{digit}" for digit in range(8)]  # whether there must be a docstring is ruff's matter here


@pytest.mark.pep257
@pytest.mark.long  # `ruff check` has the same rules in a second
@pytest.mark.linter
def test_pep257(capsys):
    linter = pytest.importorskip("ament_pep257.main")
    code = linter.main([*SOURCES, "--convention", "google", "--add-ignore", *LEFT_OUT])
    said = capsys.readouterr()
    assert code == 0, said.err
