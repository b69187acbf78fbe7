# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The settings under which decisions must not change: what another CPU would choose, and other numbers of threads."""

import json
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = {
    "as it is": {},
    "OpenBLAS as on Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "OpenBLAS as on Sandy Bridge": {"OPENBLAS_CORETYPE": "Sandybridge"},
    "numpy without AVX-512": {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"},
    "glibc without AVX-512, AVX2, FMA": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA"},
    "one thread": {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
    "four threads": {"OPENBLAS_NUM_THREADS": "4", "OMP_NUM_THREADS": "4"},
}
AT_ONCE = {
    "all that differs": {
        key: value for setting in SETTINGS.values() for key, value in setting.items()
    }
}
CODE = {
    "numba as on Haswell": {"NUMBA_CPU_NAME": "haswell"}
}  # compiles every kernel anew: in the long form only
MOST_APART_M = 0.01  # promised; typically a micrometre


def results_under(setting: dict[str, str], count: int, seed: int, *pairs: str) -> dict[str, Any]:
    """What `results_of_a_run.py` prints under a setting; `pairs` are logs and roads in turn.

    Raises:
        RuntimeError: it failed; the message holds its last words.
    """
    command = [
        sys.executable,
        str(ROOT / "test" / "support" / "results_of_a_run.py"),
        str(count),
        str(seed),
        *pairs,
    ]
    other = ("OPENBLAS_", "OMP_", "NPY_", "NUMBA_CPU", "GLIBC_")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(other)}
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=ROOT, env=environment | setting, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{setting}: {done.stderr[-2000:]}")
    return dict(json.loads(done.stdout))


def apart(one: Any, other: Any) -> float:
    """The largest distance [m] of two results in a coordinate; inf if what was decided differs."""
    if one["decided"] != other["decided"]:
        return float("inf")
    flat = [
        np.array([x for group in each["places"] for values in group for x in values])
        for each in (one, other)
    ]
    return float(np.abs(flat[0] - flat[1]).max(initial=0.0))
