# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""VerifAI's samplers on the numbers of our scenarios: drives until the first failure. `make bench` installs it."""

import json
from pathlib import Path
import subprocess
import sys

import numpy as np
from scipy import special

from benchmarks._late_witness import LateWitness
from scenario_gen.method.evaluation.time_shift import MAX_SHIFT_S

ROOT = Path(__file__).resolve().parents[1]
PYTHON = ROOT / ".venv-judges-verifai" / "bin" / "python"
EDGE = (
    1e-9  # the unit cube's numbers are kept so far from 0 and 1, where a normal number has no end
)


def first_failure(problem: LateWitness, kind: str, seed: int, most: int) -> int:
    """Return the number of the drive in which one of VerifAI's samplers first fails; `most` + 1 if none of so many does.

    Args:
        problem: the planner among its scenarios.
        kind: ce, cross-entropy, or bo, Bayesian.
        seed: of the sampler.
        most: drives.
    """
    generator = np.random.default_rng(seed)
    natural = [
        one
        for one in problem.candidates(generator.standard_normal((256, problem.size)))
        if one is not None
    ]
    margins = [
        response.margin for response in problem.drive(natural[:100])
    ]  # these are not counted
    command = [
        PYTHON,
        ROOT / "benchmarks" / "_verifai_sampler.py",
        kind,
        problem.size,
        seed,
        np.quantile(margins, 0.1),
    ]
    driven = 0
    with subprocess.Popen(
        [str(word) for word in command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as sampler:
        assert sampler.stdin is not None and sampler.stdout is not None
        while driven < most:
            line = sampler.stdout.readline()
            if not line:
                raise RuntimeError(f"VerifAI's sampler {kind} ended after {driven} drives")
            point = np.clip(np.array(json.loads(line)), EDGE, 1.0 - EDGE)
            (scenario,) = problem.candidates(np.asarray(special.ndtri(point))[None])
            margin: float | None = (
                None if kind == "ce" else MAX_SHIFT_S
            )  # the Bayesian one needs a number
            if scenario is not None:
                (response,) = problem.drive([scenario])
                driven += 1
                if response.failed:
                    sampler.kill()
                    return driven
                margin = response.margin
            sampler.stdin.write(json.dumps(margin) + "\n")
            sampler.stdin.flush()
        sampler.kill()
    return most + 1


if __name__ == "__main__":
    from benchmarks._late_witness import natural_scenarios

    late, kind, seed, most = float(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    print(first_failure(LateWitness(natural_scenarios(), late), kind, seed, most))
