# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The settings under which results must not change: what another CPU would choose, and other numbers of threads."""

import os
from pathlib import Path
import subprocess
import sys

ROOT = Path(__file__).resolve().parents[3]
SETTINGS = {
    "as it is": {},
    "OpenBLAS as on Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "OpenBLAS as on Sandy Bridge": {"OPENBLAS_CORETYPE": "Sandybridge"},
    "numpy without AVX-512": {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"},
    "glibc without AVX-512, AVX2, FMA": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA"},
    "one thread": {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
    "four threads": {"OPENBLAS_NUM_THREADS": "4", "OMP_NUM_THREADS": "4"},
}
AT_ONCE = {"all that differs": {key: value for setting in SETTINGS.values() for key, value in setting.items()}}
CODE = {"numba as on Haswell": {"NUMBA_CPU_NAME": "haswell"}}  # compiles every kernel anew: in the long form only


def digests(setting: dict[str, str], count: int, seed: int, *pairs: str) -> str:
    """What `digest.py` prints under a setting; `pairs` are logs and roads in turn.

    Raises:
        RuntimeError: it failed; the message holds its last words.
    """
    command = [sys.executable, str(ROOT / "test" / "numerics" / "exact" / "digest.py"), str(count), str(seed), *pairs]
    other = ("OPENBLAS_", "OMP_", "NPY_", "NUMBA_CPU", "GLIBC_")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(other)}
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment | setting, check=False)
    if done.returncode:
        raise RuntimeError(f"{setting}: {done.stderr[-2000:]}")
    return done.stdout
