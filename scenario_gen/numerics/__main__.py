# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`python -m scenario_gen.numerics [PACKAGE ...]` compiles the kernels of the packages that are named, or all."""

import importlib
import os
import shutil
import sys
from time import monotonic, time

from scenario_gen.numerics.compiling import make_ready, ONLY, words
from scenario_gen.numerics.kernel_cache import root
from scenario_gen.numerics.kernels import import_all, registered

UNUSED_S = 60.0 * 86400.0  # after which kernels of another version are removed


def _work(names: list[str]) -> None:
    """Compile these kernels, as long as somebody waits for them."""
    parent = os.getppid()
    for name in names:
        if os.getppid() == parent:
            module, _, function = name.partition(":")
            getattr(importlib.import_module(module), function).compile()


def main() -> None:
    """Compile the kernels of the packages that are named, or all; remove those of versions that were not used for long."""
    if ONLY in sys.argv:
        _work(sys.argv[2:])
        return
    started = monotonic()
    import_all(sys.argv[1:])
    end, last = "\r" if sys.stdout.isatty() else "\n", ""

    def show(done: int, needed: int, seconds: float) -> None:
        nonlocal last
        text = words(done, needed, seconds)
        if sys.stdout.isatty() or text[:16] != last[:16]:
            print(text, end=end, flush=True)
        last = text

    count = make_ready(registered(), show)
    for each in registered():
        each.mark.parent.touch()
    for old in root().glob("kernels-*"):
        if time() - old.stat().st_mtime > UNUSED_S:
            shutil.rmtree(old, ignore_errors=True)
    print(f"{count} kernels ready after {monotonic() - started:.1f} s", flush=True)


if __name__ == "__main__":
    main()
