# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where compiled kernels are kept: in numba's own cache, in a folder of this version of the sources."""

from functools import cache
from hashlib import sha256
import os
from pathlib import Path
import platform
import re
import tempfile

import numba

PACKAGE = Path(__file__).parents[1]
_DECORATED = re.compile(rb"^@kernel\(", re.MULTILINE)


@cache
def sources() -> tuple[Path, ...]:
    """Return the files of the package that hold kernels."""
    return tuple(file for file in sorted(PACKAGE.rglob("*.py")) if _DECORATED.search(file.read_bytes()))


@cache
def folder() -> Path:
    """Return the folder of compiled kernels: in `NUMBA_CACHE_DIR`, the user's cache, or a temporary folder of this process.

    Its name is a hash of all sources of kernels, as numba tells them apart (path, time, size), and of the versions of Python and
    numba: a kernel is compiled anew when another file that it calls has changed.
    """
    stamps = [(str(file), file.stat().st_mtime_ns, file.stat().st_size) for file in sources()]
    name = "kernels-" + sha256(repr((stamps, numba.__version__, platform.python_version())).encode()).hexdigest()[:16]
    user = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache") / "scenario_gen"
    try:
        place = Path(numba.config.CACHE_DIR or user.expanduser()) / name
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=place).close()
    except (OSError, RuntimeError):  # the latter: the user has no home
        place = Path(_temporary().name) / name
        place.mkdir(mode=0o700)
    return place


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    """A folder that goes with this process."""
    return tempfile.TemporaryDirectory(prefix="scenario_gen-kernels-")


def is_lasting() -> bool:
    """Say whether other processes will find the kernels that this one compiles."""
    return _temporary.cache_info().currsize == 0
