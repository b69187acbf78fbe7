# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

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
