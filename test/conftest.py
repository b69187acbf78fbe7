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

"""Shared fixtures; a rule that CI may not skip, with one exception; the short form of the tests and their order."""

from collections import OrderedDict
from collections.abc import Iterator
import gc
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


@pytest.fixture(scope="session")
def browser() -> Iterator[object]:
    """Headless Chromium, for all tests of a worker; the test skips where it is not installed."""
    from browser_tab import chromium

    with chromium() as instance:
        yield instance


LONGEST = """
browser live_segmentation recorder over_dds loss demo_bag packaging bad_tracks restart doctor frames asked_states under_load
recorded_encounters requests_over_dds first_start benchmarks every_cpu signals diagnostics cli_out folder_faults service_calls
ros_parameters streams silence suites maps launching broken_bags cli rrt_star_connect fuzz fit
"""  # of the groups of tests, longest first
ORDER = {name: place for place, name in enumerate(LONGEST.split())}


class LongestFirst(OrderedDict[str, dict[str, bool]]):
    """Groups of tests that wait for a worker: the longest are taken first, so that none is left alone with one at the end."""

    def popitem(self, last: bool = False) -> tuple[str, dict[str, bool]]:
        """Return what is next; xdist asks for the first."""

        def place(group: str) -> int:
            name = Path(group.partition("::")[0]).stem.removeprefix("test_")  # of a test marked `spread` its id stands here
            return ORDER.get(name, len(ORDER))

        group = min(self, key=place)
        return group, self.pop(group)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """Let xdist take the longest groups first; of itself it takes those of the most tests."""
    from xdist.scheduler import LoadGroupScheduling

    scheduler = LoadGroupScheduling(config, log)
    scheduler.workqueue = LongestFirst()
    return scheduler


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """In the short form leave out what is marked `long`; let one worker run a file (or a group), unless it is marked `spread`."""
    left_out = [] if LONG else [item for item in items if item.get_closest_marker("long")]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if not item.get_closest_marker("long")]
    for item in items:
        if not item.get_closest_marker("spread"):
            item.add_marker(pytest.mark.xdist_group("browser" if "browser" in item.fixturenames else item.path.stem))


def pytest_collection_finish() -> None:
    """Look for no garbage in what has been loaded: it stays."""
    gc.collect()
    gc.freeze()


def pytest_sessionfinish() -> None:
    """Let all of it go at the end: libraries complain of what they miss then."""
    gc.unfreeze()


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
