# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The demo: three recorded encounters with reactions.

This process and, on request, the ROS nodes generate scenarios; both must agree byte for byte.
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from scenario_gen.bags.recordings.read import read_recording, SCENARIOS
from scenario_gen.bags.recordings.write import scenario_bytes
from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.cli.folder import Advance, FolderRequest, generate_folder
from scenario_gen.logs import bundled
from scenario_gen.output.results import namespaces
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.types import GenerationResult

ROADS = {
    "ngsim_left_turn": "four_way",
    "ngsim_two_left_turns": "t_intersection",
    "v2x_following": "curve",
}
"""The bundled encounters and their roads."""
TITLE = "Demo: new scenarios from three recorded encounters"


def run_demo(
    out: Path,
    *,
    count: int,
    seed: int,
    ros: bool,
    progress: Callable[[], AbstractContextManager[Advance]],
    status: Callable[[], AbstractContextManager[Callable[[str], None]]],
) -> tuple[list[GenerationResult], list[str]]:
    """Generate scenarios from the bundled encounters.

    Args:
        out: the folder.
        count: scenarios per case.
        seed: of all random numbers.
        ros: let the nodes record the bag over DDS, and compare their scenarios.
        progress: as in `generate_folder`.
        status: a context manager whose value shows a status line about the nodes.

    Raises:
        InputError: ROS 2 is not installed, or `out` must not be replaced.
        ScenarioGenError: the scenarios from the nodes differ, which is a bug.
    """
    config = PipelineConfig()
    jobs = [((bundled(case),), (road,)) for case, road in ROADS.items()]
    record = recorder(config, count, seed, status) if ros else None
    requested = FolderRequest(jobs, config, count, seed, TITLE)
    return generate_folder(out, requested, record=record, progress=progress)


def recorder(
    config: PipelineConfig,
    count: int,
    seed: int,
    status: Callable[[], AbstractContextManager[Callable[[str], None]]],
) -> Callable[[Path, Sequence[GenerationResult]], None]:
    """Return a function that lets the ROS suite record a bag, and compares it with given cases.

    Raises:
        InputError: ROS 2 is not installed.
    """
    try:
        from scenario_gen.ros.common.suite import Job, run_suite
    except ImportError as error:
        raise InputError(
            f"ROS 2 is not available ({error}); run `make install`, or leave out --ros"
        ) from error

    def record(bag: Path, cases: Sequence[GenerationResult]) -> None:
        names = namespaces(len(ROADS))
        jobs = [
            Job(name, bundled(case), road)
            for name, (case, road) in zip(names, ROADS.items(), strict=True)
        ]
        with status() as show:
            run_suite(jobs, config, count=count, seed=seed, bag=bag, progress=show)
        compare_with_nodes(cases, bag)

    return record


def compare_with_nodes(cases: Sequence[GenerationResult], bag: Path) -> None:
    """Check that the nodes recorded the scenarios of this process, byte for byte.

    Raises:
        ScenarioGenError: they differ, which is a bug.
    """
    recorded = {
        name: namespace.data(SCENARIOS)
        for name, namespace in read_recording(bag, topics=(SCENARIOS,)).namespaces.items()
    }
    for case, namespace in zip(cases, namespaces(len(cases)), strict=True):
        # A scenario has several messages where a vehicle leaves early.
        expected = b"".join(scenario_bytes(scenario, case.encounter)[0] for scenario in case)
        if expected != b"".join(recorded.get(namespace, [])):
            raise ScenarioGenError(
                f"{case.encounter.name}: the nodes generated other scenarios than this process"
            )
