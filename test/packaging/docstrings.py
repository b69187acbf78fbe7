# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What docstrings lack: python test/packaging/docstrings.py [FOLDER ...] lists it, one line each.

Every public module, class, function and method has a docstring. One with arrays in its signature (or among the fields of a
dataclass) gives a shape, as in (T, 2) or (...,), and the unit of real numbers, as in [m] or "seconds". One that raises says
what, under "Raises:".
"""

import ast
from collections.abc import Iterator
from pathlib import Path
import re
import sys

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("scenario_gen", "msg_conventions")
ARRAYS = {"Floats", "Ints", "Bools", "NDArray"}
SIZE = r"(?:\.{3}|\d+|len\(\w+\)|\d*[A-Za-z]\w?'?(?:\s*[-+·]\s*\w+)?)"
SHAPE = re.compile(
    rf"\({SIZE}\s*,[^()]*(?:\([^()]*\)[^()]*)?\)|\(\w+, T'\)|any shape|same shape|scalar array|arrays as in"
)  # (S, K + 2)
UNIT = re.compile(
    r"\[(?:m|s|rad|1/|cells?|kg|bits?|nats?|ns|°|%)[^\]]*\]|\b(?:metres?|seconds?|radians?|m/s|1/m|rad|degrees|cells|pixels)\b"
    r"|\b(?:shares?|fractions?|factors?|weights?|probabilit|standard normal|any unit)"
    r"|\b(?:indices|numbers?|poses|states|quaternions|x, y, yaw)",
    re.IGNORECASE,
)
WITHOUT_UNITS = (  # mathematics of any quantity
    "scenario_gen/method/segmentation/",
    "scenario_gen/numerics/arrays.py",
    "scenario_gen/method/sampling/gp.py",
    *(f"scenario_gen/method/evaluation/{name}.py" for name in ("bootstrap", "dtw", "similarity")),
)
NOT_REPORTED = {"NotImplementedError", "AssertionError", "StopIteration", "KeyboardInterrupt", "SystemExit"}
NO_UNIT = "no unit"
Function = ast.FunctionDef | ast.AsyncFunctionDef
UNDOCUMENTED = (
    "overload",
    "override",
    "app.command",
    "commands.command",
    "installation.command",
)  # or their docstring is the help of a command


def lacking(path: Path) -> Iterator[tuple[int, str, str]]:
    """Yield line, name and what its docstring lacks, for every public definition of a file."""
    tree = ast.parse(path.read_text())
    if not ast.get_docstring(tree):
        yield 1, path.stem, "no docstring"
    pure = str(path.relative_to(ROOT)).startswith(WITHOUT_UNITS)
    for node in tree.body:
        for line, name, what in _lacking_in(node, ""):
            if not (pure and what == NO_UNIT):
                yield line, name, what


def _lacking_in(node: ast.stmt, owner: str) -> Iterator[tuple[int, str, str]]:
    if not isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) or node.name.startswith("_"):
        return
    if any(ast.unparse(decorator).startswith(UNDOCUMENTED) for decorator in node.decorator_list):
        return
    name = owner + node.name
    text = ast.get_docstring(node) or ""
    if not text:
        yield node.lineno, name, "no docstring"
    else:
        for what in _of_class(node, text) if isinstance(node, ast.ClassDef) else _of_function(node, text):
            yield node.lineno, name, what
    if isinstance(node, ast.ClassDef):
        for inner in node.body:
            yield from _lacking_in(inner, f"{name}.")


def _of_class(node: ast.ClassDef, text: str) -> Iterator[str]:
    fields = [statement.annotation for statement in node.body if isinstance(statement, ast.AnnAssign)]
    if any(_has_array(annotation) for annotation in fields) and not SHAPE.search(text):
        yield "no shape"


def _of_function(node: Function, text: str) -> Iterator[str]:
    arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    signature = [annotation for annotation in (*(a.annotation for a in arguments), node.returns) if annotation is not None]
    if any(_has_array(annotation) for annotation in signature) and not SHAPE.search(text):
        yield "no shape"
    if any("Floats" in ast.unparse(annotation) for annotation in signature) and not UNIT.search(text):
        yield NO_UNIT
    raised = _raised(node)
    if raised and "Raises:" not in text and not text.startswith("Raise "):
        yield f"no Raises: ({', '.join(sorted(raised))})"


def _has_array(annotation: ast.expr) -> bool:
    return bool(ARRAYS & set(re.findall(r"\w+", ast.unparse(annotation))))


def _raised(node: Function) -> set[str]:
    """Names of what the body raises itself; what is caught there, or raised in an inner function, does not count."""
    found: set[str] = set()
    stack: list[ast.AST] = list(node.body)
    while stack:
        inner = stack.pop()
        if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda | ast.ClassDef):
            continue
        if isinstance(inner, ast.Try) and inner.handlers:
            stack += [*inner.handlers, *inner.orelse, *inner.finalbody]
            continue
        if isinstance(inner, ast.Raise) and inner.exc is not None:
            call = inner.exc.func if isinstance(inner.exc, ast.Call) else inner.exc
            found.add(ast.unparse(call).rsplit(".", 1)[-1])
        stack += ast.iter_child_nodes(inner)
    return {name for name in found if name[:1].isupper()} - NOT_REPORTED


def main(folders: list[str]) -> int:
    """Print what is lacking in the folders (all, if none is named); return how much it is."""
    count = 0
    for folder in folders or PACKAGES:
        target = ROOT / folder
        for path in sorted(target.rglob("*.py")) if target.is_dir() else [target]:
            for line, name, what in lacking(path):
                print(f"{path.relative_to(ROOT)}:{line}: {name}: {what}")
                count += 1
    return count


if __name__ == "__main__":
    sys.exit(1 if main(sys.argv[1:]) else 0)
