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

"""Shared fixtures: where the recorded data is; a rule that CI may not skip, with one exception; the short form of the tests."""

import os
from pathlib import Path

from lengths import DATA, LONG
import pytest
from skips import NO_LAUNCH


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of recorded data; the test skips where it is missing."""
    if not DATA.is_dir():
        pytest.skip(f"recorded data not found at {DATA}; set SCENARIO_GEN_DATA")
    return DATA


@pytest.fixture(scope="session")
def crashes() -> Path:
    """The folder of files that once broke a reader, beside the recorded data; the test skips where it is missing."""
    folder = DATA.parent / "crashes"
    if not folder.is_dir():
        pytest.skip(f"files that broke a reader not found at {folder}; set SCENARIO_GEN_DATA to the folder beside it")
    return folder


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """In the short form leave out what is marked `long`; let one worker run a file, unless it is marked `spread`."""
    left_out = [] if LONG else [item for item in items if item.get_closest_marker("long")]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if not item.get_closest_marker("long")]
    for item in items:
        if not item.get_closest_marker("spread"):
            item.add_marker(pytest.mark.xdist_group(item.path.stem))


def _not_in_ci(report: pytest.TestReport | pytest.CollectReport) -> None:
    """In CI what is skipped has failed."""
    reason = report.longrepr[-1] if isinstance(report.longrepr, tuple) else report.longrepr
    if report.skipped and os.environ.get("CI") and not hasattr(report, "wasxfail") and NO_LAUNCH not in str(reason):
        report.outcome = "failed"
        report.longrepr = f"skipped in CI: {reason}"


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]):
    outcome = yield
    _not_in_ci(outcome.get_result())


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector: pytest.Collector):
    outcome = yield
    _not_in_ci(outcome.get_result())
