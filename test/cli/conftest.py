# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What tests of the command line share: how it is run in this process, and results of two seeds."""

import sys

import pytest

from scenario_gen.cli.commands import main
from scenario_gen.logs.synthetic import bundled

LOG = bundled("c")
QUICK = ("--road", "straight", "--count", "2", "--set", "evaluation.resamples=20")


@pytest.fixture(scope="session")
def code_of():
    """Run `scenario-gen` in this process; return its exit code."""

    def call(*words):
        with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as end:
            patch.setattr(sys, "argv", ["scenario-gen", *map(str, words)])
            main()
        return end.value.code or 0

    return call


@pytest.fixture
def ran(code_of, monkeypatch, capsys, tmp_path):
    """Run a command in an empty folder; return its exit code, standard output and standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    return lambda *words: (code_of(*words), *capsys.readouterr())


@pytest.fixture
def run(ran):
    """Likewise; return its exit code and all that it printed."""

    def call(*words):
        code, out, err = ran(*words)
        return code, out + err

    return call


@pytest.fixture(scope="session")
def results(code_of, once):
    """Folders of `generate`, seed_1 and seed_7."""

    def write(folder):
        for seed in (1, 7):
            assert (
                code_of("generate", LOG, *QUICK, "--seed", seed, "--out", folder / f"seed_{seed}")
                == 0
            )
        return folder

    return once("cli_results", write)


@pytest.fixture(scope="session")
def made(results):
    """A folder of `generate`."""
    return results / "seed_7"
