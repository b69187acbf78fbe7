# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Shared fixtures; a rule that CI may not skip, with two exceptions; the short form of the tests and their order."""

from collections.abc import Callable, Iterator
import fcntl
from functools import partial
import gc
import os
from pathlib import Path

from hypothesis import HealthCheck, settings
import pytest
from support.lengths import DATA, LONG
from support.skips import MAY_SKIP, NO_RECORDS

os.environ.setdefault(
    "OPENBLAS_NUM_THREADS", "1"
)  # read when numpy is loaded; threads of several workers wait for one another


def recorded_folder(folder: Path) -> Path:
    """Return a folder of recorded files; the test skips where it is missing."""
    if not folder.is_dir():
        pytest.skip(f"{NO_RECORDS}: {folder}; set SCENARIO_GEN_DATA")
    return folder


def made_once(factory: pytest.TempPathFactory, name: str, write: Callable[[Path], Path]) -> Path:
    """Return a folder that the first worker to need it writes, for all workers; nobody changes what is in it."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return write(factory.mktemp(name))
    folder = factory.getbasetemp().parent / name
    with folder.with_suffix(".lock").open("a+") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.is_dir():
            new = folder.with_suffix(".new")
            new.mkdir()
            write(new).rename(folder)
    return folder


@pytest.fixture(scope="session")
def once(
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[[str, Callable[[Path], Path]], Path]:
    """What gives a folder that is written once, by name and by what writes it."""
    return partial(made_once, tmp_path_factory)


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of recorded data; whoever uses it is marked `recorded`."""
    return recorded_folder(DATA)


untimed = settings(
    database=None, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)  # a machine may be busy
settings.register_profile("same", untimed, derandomize=True)
settings.register_profile("new", untimed, print_blob=True)
settings.load_profile(
    os.environ.get("SCENARIO_GEN_EXAMPLES", "same")
)  # the same examples every time, unless new ones are asked for


@pytest.fixture(scope="session")
def browser() -> Iterator[object]:
    """Headless Chromium, for all tests of a worker; the test skips where it is not installed."""
    from support.browser_tab import chromium

    with chromium() as instance:
        yield instance


LONGEST = """
browser tutorial generate_action traffic loss live_segmentation recorder over_dds demo_bag node_options
requests_over_dds maps bad_tracks launching signals restart preview off_road reacting search
batch suitable_roads recorded_encounters packaging pages same_encounters tasks asked_states cli cli_out library_alone every_cpu
service_calls mistakes ros_parameters first_start examples plugin paper benchmarks fuzz fit
"""  # of the files of tests, longest first, so that none is left alone with one at the end
ORDER = {name: place for place, name in enumerate(LONGEST.split())}


def pytest_configure(config: pytest.Config) -> None:
    """Let xdist take groups as they come; of itself it takes those of the most tests first."""
    config.option.loadscopereorder = False


@pytest.hookimpl(tryfirst=True)  # before marks are chosen, and before xdist reads the groups
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """In the short form leave out what is marked `long`; let one worker run a file (or a group), unless it is marked `spread`."""
    for item in items:
        if "data" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.recorded)
    left_out = [] if LONG else [item for item in items if item.get_closest_marker("long")]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if not item.get_closest_marker("long")]
    if not config.pluginmanager.hasplugin("xdist"):
        return
    for item in items:
        if not item.get_closest_marker("spread"):
            needed = getattr(
                item, "fixturenames", ()
            )  # items of launch_testing and other plugins need not have any
            item.add_marker(
                pytest.mark.xdist_group("browser" if "browser" in needed else item.path.stem)
            )
    items.sort(key=_place)


def _place(item: pytest.Item) -> int:
    group = item.get_closest_marker("xdist_group")
    return ORDER.get(
        (group.args[0] if group else item.path.stem).removeprefix("test_"), len(ORDER)
    )


def pytest_collection_finish() -> None:
    """Look for no garbage in what has been loaded: it stays; and seldom for any, which takes a twentieth of the tests' time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


def pytest_sessionfinish() -> None:
    """Let all of it go at the end: libraries complain of what they miss then."""
    gc.unfreeze()


def _not_in_ci(report: pytest.TestReport | pytest.CollectReport) -> None:
    """In CI what is skipped has failed."""
    reason = report.longrepr[-1] if isinstance(report.longrepr, tuple) else report.longrepr
    if (
        report.skipped
        and os.environ.get("CI")
        and not hasattr(report, "wasxfail")
        and not any(one in str(reason) for one in MAY_SKIP)
    ):
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
