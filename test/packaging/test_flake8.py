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

"""ament_flake8, with the settings of setup.cfg."""

import pytest
from source_files import ROOT, SOURCES


@pytest.mark.flake8
@pytest.mark.long  # `ruff check` has the same rules in a second
@pytest.mark.linter
def test_flake8():
    linter = pytest.importorskip("ament_flake8.main")
    code, errors = linter.main_with_errors(["--config", str(ROOT / "setup.cfg"), *SOURCES])
    assert code == 0, f"{len(errors)} errors:\n" + "\n".join(errors)
