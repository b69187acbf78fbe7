# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Compile kernels: `python -m scenario_gen.numerics [PACKAGE ...]`, by default all.

Of named packages, the kernels that are compiled on demand are left out.
"""

import importlib
import os
import shutil
import sys
from time import monotonic, time

from scenario_gen.numerics.compiling import make_ready, next_name, QUEUE, words
from scenario_gen.numerics.kernel_cache import root
from scenario_gen.numerics.kernels import import_all, registered

MAX_UNUSED_S = 60.0 * 86400.0  # after which kernels of other versions are removed


def _compile_queued() -> None:
    """Compile the kernels in the queue on standard input while the parent process lives."""
    parent = os.getppid()
    while (name := next_name()) and os.getppid() == parent:
        module, _, function = name.partition(":")
        getattr(importlib.import_module(module), function).compile()


def _remove_unused() -> None:
    """Remove the kernels of versions that were not used for long."""
    for kernel in registered():
        kernel.mark.parent.touch()
    for folder in root().glob("kernels-*"):
        if time() - folder.stat().st_mtime > MAX_UNUSED_S:
            shutil.rmtree(folder, ignore_errors=True)


def main() -> None:
    """Compile the kernels of the named packages, or all."""
    if QUEUE in sys.argv:
        _compile_queued()
        return
    started = monotonic()
    import_all(sys.argv[1:])
    is_terminal = sys.stdout.isatty()
    last_done = -1

    def show(done: int, needed: int, seconds: float) -> None:
        nonlocal last_done
        if is_terminal or done != last_done:
            print(words(done, needed, seconds), end="\r" if is_terminal else "\n", flush=True)
        last_done = done

    count = make_ready(registered(on_demand=not sys.argv[1:]), show)
    _remove_unused()
    print(f"{count} kernels ready after {monotonic() - started:.1f} s", flush=True)


if __name__ == "__main__":
    main()
