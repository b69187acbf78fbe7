# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

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
