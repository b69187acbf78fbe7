# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios from several encounters on several roads; for archives see `scenario-gen batch`."""

from collections.abc import Iterable, Sequence
from itertools import chain
import os

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.signals import ctrl_c_blocked, worker_pool
from scenario_gen.method.config import PipelineConfig
from scenario_gen.pipeline import generate_outcomes
from scenario_gen.types import Encounter, GenerationResult, Road

Case = tuple[Encounter, Road | str]
Answer = GenerationResult | RefusedError


def generate_many(
    cases: Iterable[Case],
    config: PipelineConfig = PipelineConfig(),
    *,
    count: int = 50,
    seed: int = 0,
    workers: int = 0,
) -> list[Answer]:
    """Generate the scenarios of several cases in parallel processes.

    The number of workers does not change the results. In a script, call this function below
    `if __name__ == "__main__":`, since the workers import the script.

    Args:
        cases: pairs (encounter, road) of arguments for `generate`,
            e.g. `itertools.product(log.encounters, ["straight", "curve"])`.
        config: the parameters of every stage.
        count: number of valid scenarios for each case.
        seed: seed of every case.
        workers: number of processes; 0 starts one per core.

    Returns:
        For each case, in order, its result or the error that refused it. With
        `sampling.decisions=drawn` a case has a result for each outcome (`generate_outcomes`).

    Raises:
        InputError: a case is no pair, or a road or a parameter is invalid.

    Example:
        >>> answers = generate_many([(encounter, "straight"), (encounter, "curve")], count=20)
        >>> results = [answer for answer in answers if not isinstance(answer, RefusedError)]
    """
    cases = list(cases)
    for case in cases:
        if not isinstance(case, Sequence) or len(case) != 2:
            raise InputError(
                "generate_many: pairs (encounter, road) are needed, e.g. "
                f'[(encounter, "four_way")], not {type(case).__name__}'
            )
    tasks = [(case, config, count, seed) for case in cases]
    workers = min(workers or os.cpu_count() or 1, len(tasks))
    if workers <= 1:
        return list(chain.from_iterable(map(_answers, tasks)))
    with worker_pool(workers) as pool:
        with ctrl_c_blocked():
            answers = pool.map(_answers, tasks)
        return list(chain.from_iterable(answers))


def _answers(task: tuple[Case, PipelineConfig, int, int]) -> Sequence[Answer]:
    (encounter, road), config, count, seed = task
    try:
        return generate_outcomes(encounter, road, config, count=count, seed=seed)
    except RefusedError as error:
        return [error]
