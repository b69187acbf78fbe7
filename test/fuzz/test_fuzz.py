# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every reader and every decoder gets its valid inputs and some damaged ones; more of it: `make soak PART=fuzz`."""

from pathlib import Path
import sys

from harness import corpus, CRASHES, execute, found_crashes, fuzz, targets
from lengths import LONG
import pytest
from readers import OF_TARGETS, OWN, PACKAGES, parsing_modules
from skips import NO_RECORDS

from scenario_gen.logs.read import FORMATS

pytestmark = pytest.mark.spread
TARGETS = targets()
DAMAGED = 400 if LONG else 4


@pytest.mark.parametrize("name", TARGETS)
def test_nothing_but_errors_of_ours_comes_out(name, tmp_path):
    seeds = corpus(TARGETS[name], found=False)
    executions = len(seeds) + DAMAGED
    record = fuzz(TARGETS[name], tmp_path, executions, seconds=600.0, seeds=seeds)
    assert record.executions == executions
    assert not not_entered(TARGETS[name], OF_TARGETS.get(name, ()), seeds, tmp_path / "entered")
    assert not record.failures, "\n".join(f"{f.signature}: {f.message} ({tmp_path / f.file})" for f in record.failures.values())


def not_entered(target, modules, seeds, folder):
    """Return which of some modules of ours a target's valid inputs never come to."""
    files = set()
    left = {package / module for module in modules for package in PACKAGES if (package / module).exists()}
    for seed in sorted(seeds, key=len):  # the short ones often come to all of them
        if not left:
            break
        sys.setprofile(lambda frame, *_: files.add(frame.f_code.co_filename))
        try:
            execute(target, seed, folder)
        finally:
            sys.setprofile(None)
        left -= {Path(file) for file in files}
    return left


def test_every_module_that_parses_a_file_is_reached_by_a_target():
    """A new reader fails here until it has a target; and a target that does not reach what it is named for fails above."""
    assert set(OF_TARGETS) <= set(TARGETS)
    reached = {module for modules in OF_TARGETS.values() for module in modules}
    assert parsing_modules() - set(OWN) <= reached
    assert set(OWN) <= parsing_modules(), "what is not there needs no reason"


def test_every_format_of_logs_has_a_target():
    named = {"bag": "mcap_log", "commonroad": "commonroad_log"}
    assert {named.get(name, name) for name in FORMATS.built_in} <= set(TARGETS)


@pytest.mark.recorded
@pytest.mark.parametrize("name", [name for name, target in TARGETS.items() if target.crashes])
def test_what_once_broke_a_reader_does_so_no_more(name, tmp_path):
    seeds = found_crashes(TARGETS[name])
    if not seeds:
        pytest.skip(f"{NO_RECORDS}: {CRASHES}")
    record = fuzz(TARGETS[name], tmp_path, len(seeds), seconds=600.0, seeds=seeds)
    assert record.executions == len(seeds)
    assert not record.failures, "\n".join(f"{f.signature}: {f.message}" for f in record.failures.values())
