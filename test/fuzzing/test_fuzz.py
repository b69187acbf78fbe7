# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every reader and every decoder gets its valid inputs and some damaged ones; more of it: `make soak PART=fuzz`."""

from fuzzing.harness import corpus, CRASHES, found_crashes, fuzz, targets
import pytest
from support.lengths import LONG
from support.skips import NO_RECORDS

from scenario_gen.logs import LOG_FORMATS

pytestmark = pytest.mark.spread
TARGETS = targets()
DAMAGED = 400 if LONG else 4


@pytest.mark.parametrize("name", TARGETS)
def test_only_own_errors_come_out(name, tmp_path):
    seeds = corpus(TARGETS[name], found=False)
    executions = len(seeds) + DAMAGED
    record = fuzz(TARGETS[name], tmp_path, executions, seconds=600.0, seeds=seeds)
    assert record.executions == executions
    assert record.failures == {}


def test_every_log_format_has_a_target():
    named = {"bag": "mcap_log", "commonroad": "commonroad_log"}
    assert {named.get(name, name) for name in LOG_FORMATS.built_in} <= set(TARGETS)


@pytest.mark.recorded
@pytest.mark.parametrize("name", [name for name, target in TARGETS.items() if target.crashes])
def test_earlier_crashes_stay_fixed(name, tmp_path):
    seeds = found_crashes(TARGETS[name])
    if not seeds:
        pytest.skip(f"{NO_RECORDS}: {CRASHES}")
    record = fuzz(TARGETS[name], tmp_path, len(seeds), seconds=600.0, seeds=seeds)
    assert record.executions == len(seeds)
    assert record.failures == {}
