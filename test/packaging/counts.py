# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Print how large the project is, beside the figures of its last release: `make counts`.

    python counts.py [PATH ...]

* tokens: names, operators, numbers and strings of scenario_gen/ and msg_conventions/, compiled
  kernels included; no comments and no docstrings;
* constants: single numbers in constants of their modules;
* complex functions: functions whose cognitive complexity (complexipy) is above 15;
* files entered: files with a function that one `generate` calls (synthetic_c on four_way);
* parameters: those that the configurations declare; commands: those of scenario-gen;
* lines of test/ and benchmarks/; words of docs/*.md.

With paths, the tokens of these files only.
"""

import argparse
import ast
from collections.abc import Iterator
import io
from pathlib import Path
import sys
import threading
import tokenize
from types import FrameType
from typing import cast

from complexipy import file_complexity
from typer.core import TyperGroup
from typer.main import get_command

from scenario_gen import generate, read_log
from scenario_gen.cli.commands import app

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "test"))

from test_architecture import PACKAGE, PYTHON_FILES, room, ROOMS  # noqa: E402

DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
MAX_COMPLEXITY = 15
RELEASED = {  # measured at 2ba46f00
    "tokens": 600_218,
    "constants": 980,
    "complex functions": 1,
    "files entered": 204,
    "parameters": 308,
    "commands": 20,
    "lines of test": 47_376,
    "lines of benchmarks": 9_025,
    "words of documentation": 18_798,
}


def tree_of(path: Path) -> ast.Module:
    """Return the syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def tokens(path: Path) -> int:
    """Return the number of tokens: the same with every version of Python."""
    docstrings = {
        (node.body[0].lineno, node.body[0].col_offset)
        for node in ast.walk(tree_of(path))
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None
    }
    counted = (tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING)
    count = 0
    nesting = 0  # of f-strings, which are several tokens since Python 3.12 and one before
    for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline):
        kind = tokenize.tok_name[token.type]
        if kind == "FSTRING_START":
            count += nesting == 0
            nesting += 1
        elif kind == "FSTRING_END":
            nesting -= 1
        elif nesting == 0 and token.type in counted and token.start not in docstrings:
            count += 1
    return count


def complex_functions(path: Path) -> int:
    """Return how many functions are hard to follow: cognitive complexity."""
    functions = file_complexity(path.as_posix()).functions
    return sum(function.complexity > MAX_COMPLEXITY for function in functions)


def numbers_in(value: ast.expr) -> int:
    """Return how many numbers a constant expression holds; 0 if it is no plain number."""
    if isinstance(value, ast.Constant):
        return int(isinstance(value.value, int | float) and not isinstance(value.value, bool))
    if isinstance(value, ast.UnaryOp):
        return numbers_in(value.operand)
    if isinstance(value, ast.BinOp):
        return int(numbers_in(value.left) > 0 and numbers_in(value.right) > 0)
    if isinstance(value, ast.Tuple | ast.List):
        counts = [numbers_in(element) for element in value.elts]
        return sum(counts) if all(counts) else 0
    return 0


def constants(path: Path) -> Iterator[tuple[str, int]]:
    """Yield the names of numeric constants of a module, with how many numbers each holds."""
    for node in tree_of(path).body:
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            targets: list[ast.expr] = [node.target]
        elif isinstance(node, ast.Assign):
            targets = node.targets
        else:
            continue
        for target in targets:
            pairs = [(target, node.value)]
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = list(zip(target.elts, node.value.elts, strict=True))
            for name, value in pairs:
                if isinstance(name, ast.Name) and (count := numbers_in(value)):
                    yield name.id, count


def parameters(path: Path) -> int:
    """Return how many parameters the configurations in a file declare."""
    return sum(
        isinstance(node, ast.Call) and ast.unparse(node.func) == "parameter"
        for node in ast.walk(tree_of(path))
    )


def files_entered() -> int:
    """Return in how many files one `generate` calls a function, after a first one."""

    def run() -> None:
        log = read_log(PACKAGE / "resources" / "synthetic_c")
        generate(log.encounters[0], "four_way", count=2, seed=7)

    entered = set()

    def enter(frame: FrameType, event: str, argument: object) -> None:
        if event == "call" and frame.f_code.co_name != "<module>":
            entered.add(frame.f_code.co_filename)

    run()
    threading.setprofile(enter)
    sys.setprofile(enter)
    run()
    sys.setprofile(None)
    threading.setprofile(None)
    return len(entered & set(map(str, PYTHON_FILES)))


def lines_of(folder: str) -> int:
    """Return the number of lines of the Python files of a folder."""
    files = (ROOT / folder).rglob("*.py")
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)


def figures() -> dict[str, int]:
    """Return all figures by their names."""
    pages = [path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")]
    return {
        "tokens": sum(map(tokens, PYTHON_FILES)),
        "constants": sum(count for path in PYTHON_FILES for _, count in constants(path)),
        "complex functions": sum(map(complex_functions, PYTHON_FILES)),
        "files entered": files_entered(),
        "parameters": sum(map(parameters, PYTHON_FILES)),
        "commands": len(cast(TyperGroup, get_command(app)).commands),
        "lines of test": lines_of("test"),
        "lines of benchmarks": lines_of("benchmarks"),
        "words of documentation": sum(len(page.split()) for page in pages),
    }


def main() -> None:
    """Print all figures and the tokens of each room, or the tokens of some files."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("paths", nargs="*", type=Path)
    folders = [path.resolve() for path in parser.parse_args().paths]
    if folders:
        files = [path for path in PYTHON_FILES if any(map(path.is_relative_to, folders))]
        print(f"{sum(map(tokens, files)):,} tokens in {len(files)} files")
        return
    print(f"{'':24}{'2ba46f00':>10}{'now':>10}")
    for name, count in figures().items():
        print(f"{name:24}{RELEASED[name]:10,}{count:10,}")
    for name in ROOMS:
        files = [path for path in PACKAGE.rglob("*.py") if room(path) == name]
        print(f"{'tokens of ' + name:34}{sum(map(tokens, files)):10,}")


if __name__ == "__main__":
    main()
