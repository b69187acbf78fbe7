# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Other packages are used by their public modules alone: what is private may change with their next release.

Private attributes, `exec` and `eval` are ruff's (SLF001, S102, S307).
"""

import ast

from test_architecture import PYTHON_FILES, ROOT

OURS = ("scenario_gen.", "msg_conventions.")
INNER_MODULES = ("numba.core.", "numba.np.", "numba.cpython.", "llvmlite.", "rclpy.impl.")


def private_imports(tree: ast.Module) -> list[str]:
    """Return the dotted names of private modules of others, and of names in them, that a file imports."""
    names: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return [
        name
        for name in names
        if not name.startswith(OURS)
        and (
            any(part.startswith("_") and part[1:2] != "_" for part in name.split("."))
            or f"{name}.".startswith(INNER_MODULES)
        )
    ]


def test_private_modules_are_not_used():
    code = (
        "from numba.core import caching; import os._x, numpy as np; from a import _b, __version__"
    )
    assert private_imports(ast.parse(code)) == ["numba.core.caching", "os._x", "a._b"]
    found = {path: private_imports(ast.parse(path.read_text())) for path in PYTHON_FILES}
    assert not {str(path.relative_to(ROOT)): names for path, names in found.items() if names}
