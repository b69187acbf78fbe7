# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Fuzzing guided by coverage, where atheris is installed: `python test/fuzz/guided.py TARGET STATE SECONDS`.

libFuzzer chooses among the inputs by what they reach, the target's own mutators damage them, and the harness judges what comes
out. An input that kills the process or hangs outside of Python is left in STATE by libFuzzer itself.
"""

import json
from pathlib import Path
import random
import signal
import sys
import warnings

import atheris

with atheris.instrument_imports(include=["scenario_gen", "msg_conventions"], enable_loader_override=False):
    from harness import corpus, execute, MEMORY, over_time, SECONDS, targets

    TARGETS = targets()


def main(name: str, state: Path, seconds: float) -> None:
    """Fuzz one target for some time; failures are lines of `guided.jsonl`, their inputs files beside it."""
    target = TARGETS[name]
    seeds = corpus(target)
    inputs = state / f"{name}_inputs"
    inputs.mkdir(parents=True, exist_ok=True)
    for k, seed in enumerate(seeds):
        (inputs / f"seed{k}").write_bytes(seed)
    known: set[str] = set()

    def once(data: bytes) -> None:
        found = execute(target, data, state / f"{name}_input")
        if found and found[0] not in known:
            known.add(found[0])
            file = state / f"{name}_guided_{len(known)}"
            file.write_bytes(data)
            with (state / "guided.jsonl").open("a") as lines:
                lines.write(json.dumps({"target": name, "signature": found[0], "message": found[1], "file": file.name}) + "\n")

    def mutate(data: bytes, most: int, seed: int) -> bytes:
        rng = random.Random(seed)
        return rng.choice(target.mutators)(rng, data, seeds)[:most]

    warnings.simplefilter("ignore")
    signal.signal(signal.SIGPROF, over_time)
    options = [
        *(f"-max_total_time={seconds:.0f}", f"-timeout={10 * SECONDS:.0f}", f"-rss_limit_mb={2 * MEMORY >> 20}", "-seed=1"),
        *(f"-max_len={2 * max(map(len, seeds))}", f"-artifact_prefix={state / name}_", "-print_final_stats=1", str(inputs)),
    ]
    atheris.Setup([sys.argv[0], *options], once, custom_mutator=mutate)
    atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), float(sys.argv[3]))
