# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The first start on a machine: kernels are compiled before there is a node, which is said, and can be ended."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.dds


def test_several_processes_compile_once(tmp_path):
    """Of a module with one kernel, so that it is short, and one that waits for its first call."""
    (tmp_path / "kernel_of_a_test.py").write_text(
        "from scenario_gen.numerics.kernels import F, kernel\n@kernel(F)\ndef twice(x):\n    return x + x\n"
        "@kernel(F, on_demand=True)\ndef half(x):\n    return x / 2.0\n"
    )
    run = (
        "import kernel_of_a_test as module\nfrom scenario_gen.numerics import compiling, kernels\nsaid = []\n"
        "compiling.make_ready(kernels.registered(on_demand=False), lambda *words: said.append(compiling.words(*words)))\n"
        "print(module.twice(2.0), said[-1:])"
    )
    environment = os.environ | {
        "PYTHONPATH": str(tmp_path),
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
    }
    several = [
        subprocess.Popen(
            [sys.executable, "-c", run], stdout=subprocess.PIPE, text=True, env=environment
        )
        for _ in range(2)
    ]
    said = [process.communicate(timeout=300.0)[0] for process in several]
    assert all(text.startswith("4.0 [") for text in said), said
    assert any("once for this installation" in text for text in said)
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 1
    on_demand = f"{run}\nprint(module.half(2.0))"
    warm = subprocess.run(
        [sys.executable, "-c", on_demand],
        capture_output=True,
        text=True,
        env=environment,
        check=True,
    )
    assert warm.stdout == "4.0 []\n1.0\n"
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 2
    nowhere = environment | {"NUMBA_CACHE_DIR": "/proc/nowhere"}
    alone = subprocess.run(
        [sys.executable, "-c", run], capture_output=True, text=True, env=nowhere, check=True
    )
    assert "at every start" in alone.stdout, alone.stdout
