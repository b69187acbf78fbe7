# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Compiled kernels are found by a copy of the package, repaired, and not taken from others."""

import os
import shutil
import subprocess
import sys

import pytest
from support.source_files import ROOT

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import own_folder

PROGRAM = """
from scenario_gen.numerics import boxes
from scenario_gen.numerics.compiling import words
from scenario_gen.numerics.kernels import registered
kernel = min(registered(), key=lambda each: each.size)
function = kernel.compile()
print(sum(function.stats.cache_hits.values()), words(0, 1, 0.0))
"""

DAMAGED = """
from scenario_gen.numerics.kernels import Kernel
from scenario_gen.numerics.kernel_cache import root
cache = root()
damages = (
    lambda data: data[:20],
    lambda data: b"",
    lambda data: data[: len(data) // 2] + bytes(4096) + data[len(data) // 2 + 4096 :],
    lambda data: data[:-1] + bytes([data[-1] ^ 1]),
)
for suffix in ("nbi", "nbc"):
    for damage in damages:
        (file,) = cache.rglob(f"*.{suffix}")
        spoiled = damage(file.read_bytes())
        file.write_bytes(spoiled)
        again = Kernel(kernel.function, kernel.declared, on_demand=False).compile()
        assert not again.stats.cache_hits
        (file,) = cache.rglob(f"*.{suffix}")
        assert file.read_bytes() != spoiled
"""


def compiled(package, cache, more=""):
    """Return how often a new process finds the smallest kernel in the cache, and what it says."""
    result = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM + more],
        env=os.environ | {"PYTHONPATH": str(package), "NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        check=True,
    )
    hits, _, text = result.stdout.strip().partition(" ")
    return int(hits), text


def test_kernel_cache_is_shared_and_repaired(tmp_path):
    cache = tmp_path / "cache"
    assert compiled(ROOT, cache) == (
        0,
        "kernels: 0 of 1 compiled, 0 s; once for this installation",
    )
    copy = tmp_path / "install"
    for name in ("scenario_gen", "msg_conventions"):
        shutil.copytree(ROOT / name, copy / name, copy_function=shutil.copyfile)
    assert compiled(copy, cache)[0] == 1
    compiled(ROOT, cache, DAMAGED)
    assert compiled(ROOT, cache)[0] == 1
    cache.chmod(0o777)
    hits, text = compiled(ROOT, cache)
    assert hits == 0
    assert f"at every start: other accounts may write to {cache}; run `chmod go-w" in text


def test_cache_folder_belongs_to_this_account(tmp_path):
    own_folder(tmp_path / "new")
    assert (tmp_path / "new").stat().st_mode & 0o777 == 0o700
    (tmp_path / "link").symlink_to(tmp_path / "new")
    with pytest.raises(InputError, match="is a link"):
        own_folder(tmp_path / "link")
    if os.geteuid() == 0:
        os.chown(tmp_path / "new", 12345, 12345)
        with pytest.raises(InputError, match="belongs to another account"):
            own_folder(tmp_path / "new")
