# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Other packages are used by their public names alone: what is private may change with their next release."""

import ast
from collections.abc import Iterator

from test_architecture import PYTHON_FILES, ROOT

OURS = {"scenario_gen", "msg_conventions"}
INNER_MODULES = ("numba.core.", "numba.np.", "numba.cpython.", "llvmlite.", "rclpy.impl.")
PUBLIC = {"_asdict", "_exit", "_fields", "_make", "_replace"}  # documented in spite of their names
FORGED = {
    "Structure",
    "Union",
    "CFUNCTYPE",
}  # of ctypes: a layout that is copied from somebody's header
KNOWN: set[str] = set()  # files that do it still; it may only shrink


def is_private(name: str) -> bool:
    """Whether a name, or a part of a dotted one, begins with one underscore."""
    return any(
        part.startswith("_") and not part.startswith("__") and part not in PUBLIC
        for part in name.split(".")
    )


def own_names(trees: dict[str, ast.Module]) -> set[str]:
    """Return the private names that our classes and modules define."""
    found: set[str] = set()
    for node in (node for tree in trees.values() for node in ast.walk(tree)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            found.add(node.id if isinstance(node, ast.Name) else node.attr)
        elif isinstance(node, ast.ImportFrom):
            found |= {alias.asname or alias.name for alias in node.names}
    return found


def private_uses(tree: ast.Module, own: set[str]) -> Iterator[str]:
    """Yield the private names of others that a file uses, and calls of `exec`."""
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        for name in (name for name in names if name.split(".")[0] not in OURS):
            if is_private(name) or f"{name}.".startswith(INNER_MODULES):
                yield name
        if isinstance(node, ast.Attribute) and node.attr not in own:
            if is_private(node.attr) or (
                node.attr in FORGED and ast.unparse(node.value) == "ctypes"
            ):
                yield ast.unparse(node)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            texts = [
                arg.value
                for arg in node.args
                if isinstance(arg, ast.Constant) and isinstance(arg.value, str)
            ]
            if node.func.id in ("exec", "eval"):
                yield node.func.id
            if node.func.id in ("getattr", "setattr", "hasattr"):
                yield from (text for text in texts if is_private(text) and text not in own)


def test_no_private_name_of_another_package_is_used():
    trees = {
        path.relative_to(ROOT).as_posix(): ast.parse(path.read_text()) for path in PYTHON_FILES
    }
    own = own_names(trees)
    found = {name: uses for name, tree in trees.items() if (uses := set(private_uses(tree, own)))}
    assert not {name: uses for name, uses in found.items() if name not in KNOWN}, (
        "use public names, or do without"
    )


def test_what_counts_as_private():
    code = "from numba.core import caching; w._Writer__end(); exec(text); ctypes.Structure; getattr(node, '_handle')"
    found = {"numba.core.caching", "exec", "_handle", "w._Writer__end", "ctypes.Structure"}
    assert {*private_uses(ast.parse(code), set())} == found
    assert not [
        *private_uses(
            ast.parse("self._own, made._replace(a=1), os._exit(1), np.dtype.__name__"), {"_own"}
        )
    ]
