# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What tests of the command line share."""

import sys

import pytest

from scenario_gen.cli.commands import main


@pytest.fixture
def run(monkeypatch, capsys, tmp_path):
    """Run `scenario-gen` in this process, in an empty folder; return its exit code and all that it printed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["scenario-gen", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        printed = capsys.readouterr()
        return end.value.code or 0, printed.out + printed.err

    return call
