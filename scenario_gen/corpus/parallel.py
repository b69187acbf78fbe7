# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Several encounters on several roads at once, in the library; `scenario-gen batch` does the same for archives."""

from collections.abc import Iterable
import os

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.config import PipelineConfig
from scenario_gen.pipeline import generate
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
    """Generate each case in a process of its own; the number of workers does not change the results.

    Call it below `if __name__ == "__main__":` in a script, for its workers import that script.

    Args:
        cases: (encounter, road) as `generate` takes them, e.g. `itertools.product(log.encounters, ["straight", "curve"])`.
        config: the parameters of every stage.
        count: valid scenarios wanted of each case.
        seed: of all randomness.
        workers: processes; 0: as many as there are cores.

    Returns:
        For each case in order its result, or the error that refused it.

    Raises:
        InputError: a road or a parameter cannot be used.
    """
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    tasks = [(case, config, count, seed) for case in cases]
    workers = min(workers or os.cpu_count() or 1, len(tasks))
    if workers <= 1:
        return list(map(_answer, tasks))
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        return list(pool.map(_answer, tasks))


def _answer(task: tuple[Case, PipelineConfig, int, int]) -> Answer:
    (encounter, road), config, count, seed = task
    try:
        return generate(encounter, road, config, count=count, seed=seed)
    except RefusedError as error:
        return error
