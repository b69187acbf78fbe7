# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Measure the sources and their budget; `make counts` writes the tables into CONTRIBUTING.md.

    python counts.py [--write PAGE] [--list NAME] [PATH ...]

All figures are those of scenario_gen/ and msg_conventions/, compiled kernels included:

* tokens: names, operators, numbers and strings; no comments and no docstrings;
* long lines: lines of more than 99 columns;
* complex functions: functions whose cognitive complexity (complexipy) is above 15;
* branching functions: functions whose cyclomatic complexity is above 15;
* nested functions: functions with more than three nested blocks;
* long functions: more than 60 lines without the docstring;
* crowded functions: more than 8 parameters, except parameters of a scikit-learn estimator;
* constants: single numbers in constants of modules;
* constants without a unit: those whose name does not end with a unit, or with a word that says
  what the number is (`_RATIO`, `_COUNT`, ...);
* banned names: names that a reader has to decode (`own`, `found`, `one`, ...); names of parameters
  are interfaces and stay.

With `--list NAME`, the places that one figure counts; with paths, only those files.
"""

import argparse
import ast
from collections.abc import Iterable, Iterator
from functools import cache
import io
from operator import attrgetter
from pathlib import Path
import re
import sys
import tokenize

from complexipy import file_complexity

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "test"))

from test_architecture import FOUNDATION, PYTHON_FILES, room, rooms_imported  # noqa: E402

MARKS = ("<!-- counts -->\n", "<!-- end of counts -->\n")
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
BLOCKS = (ast.For, ast.AsyncFor, ast.While, ast.If, ast.With, ast.AsyncWith, ast.Try, ast.Match)
BRANCHES = (
    ast.For,
    ast.AsyncFor,
    ast.While,
    ast.If,
    ast.IfExp,
    ast.ExceptHandler,
    ast.comprehension,
)
MAX_COLUMNS, MAX_COMPLEXITY, MAX_NESTING = 99, 15, 3
MAX_PARAMETERS, MAX_FUNCTION_LINES = 8, 60

# Measured at 982257a1, before the code was rewritten for readers.
BEFORE = {
    "tokens": 495_999,
    "long lines": 7_237,
    "complex functions": 161,
    "branching functions": 76,
    "nested functions": 56,
    "long functions": 0,
    "crowded functions": 1,
    "constants": 1_299,
    "constants without a unit": 917,
    "banned names": 1_014,
}
# A change that needs more tokens deletes something, or says why in the commit. Splitting dense
# code into plain steps has cost 14,000 tokens so far; 435,000 are wanted. Fitting the interaction
# instead of the whole recording, users beside each other in a lane, obstacles from maps, playback at
# its rate, and arguments that are checked have cost 12,500. Traffic lights with a state and their
# formats have cost 17,000 (9,000 planned), archives that grow and mend by file and tables of
# trajectories 9,000 (1,000 planned), trailers, rows of parked cars and obstacles in exports 6,500.
BUDGET = {
    "tokens": 600_500,
    "long lines": 0,
    "complex functions": 1,
    "branching functions": 0,
    "nested functions": 0,
    "long functions": 0,
    "crowded functions": 0,
    "constants": 980,
    "constants without a unit": 0,
    "banned names": 0,
}

UNITS = {
    "M", "M2", "MM", "KM", "S", "MS", "US", "NS", "RAD", "DEG", "MPS", "MPS2", "MPS3", "RADPS", "HZ",
    "PX", "BYTES", "KIB", "MIB", "GIB", "COLUMNS", "PER_M", "PER_S", "PER_MPS", "RGB", "RGBA",
}  # fmt: skip
WORDS = {
    "RATIO", "SHARE", "COUNT", "WEIGHT", "FACTOR", "ROWS", "STEPS", "ITERATIONS", "PERCENT",
    "PROBABILITY", "CONFIDENCE", "SIGMAS", "DECIMALS", "EXPONENT", "DEGREE", "INDEX", "CODE",
    "VERSION", "SEED", "PORT", "DEPTH", "BITS", "CELLS", "SAMPLES", "POINTS", "VEHICLES",
    "DIGITS", "LEVELS", "LINES", "CHARACTERS", "FILES", "MESSAGES", "ATTEMPTS", "SCENARIOS",
    "CANDIDATES", "SLOT", "COST", "EPSG", "ID", "YEAR", "LENGTHS", "WIDTHS", "POSES",
}  # fmt: skip
BANNED = {
    "own", "found", "one", "there", "here", "what", "beside", "apart", "likeliest", "unlooking",
    "minded", "onward", "hardly", "thereof", "late", "take", "give", "tell", "say", "hear",
    "settle", "let_go", "askew", "aside",
}  # fmt: skip


@cache
def tree_of(path: Path) -> ast.Module:
    """Return the syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def name_of(path: Path) -> str:
    """Return the path of a file for people."""
    return path.relative_to(ROOT).as_posix().removeprefix("scenario_gen/")


@cache
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


def long_lines(path: Path) -> Iterator[str]:
    """Yield the places of lines that are too long."""
    lines = path.read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines, start=1):
        if len(line) > MAX_COLUMNS:
            yield f"{name_of(path)}:{number}"


def complex_functions(path: Path) -> Iterator[str]:
    """Yield the functions that are hard to follow: cognitive complexity."""
    for function in file_complexity(path.as_posix()).functions:
        if function.complexity > MAX_COMPLEXITY:
            yield f"{name_of(path)}: {function.name} {function.complexity}"


def functions(path: Path) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Yield all functions of a file."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, FUNCTIONS):
            yield node


def within(function: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a function, without those of functions inside of it."""
    for node in ast.iter_child_nodes(function):
        if not isinstance(node, FUNCTIONS):
            yield node
            yield from within(node)


def branching_functions(path: Path) -> Iterator[str]:
    """Yield the functions with many branches: cyclomatic complexity."""
    for function in functions(path):
        paths = 1
        for node in within(function):
            if isinstance(node, BRANCHES):
                paths += 1 + (len(node.ifs) if isinstance(node, ast.comprehension) else 0)
            elif isinstance(node, ast.BoolOp):
                paths += len(node.values) - 1
            elif isinstance(node, ast.match_case):
                paths += 1
        if paths > MAX_COMPLEXITY:
            yield f"{name_of(path)}: {function.name} {paths}"


def depth(node: ast.AST) -> int:
    """Return how deeply blocks are nested; `elif` is no deeper than its `if`."""
    deepest = 0
    for name, value in ast.iter_fields(node):
        children = value if isinstance(value, list) else [value]
        is_elif = isinstance(node, ast.If) and name == "orelse" and len(children) == 1
        for child in children:
            if not isinstance(child, ast.AST) or isinstance(child, FUNCTIONS):
                continue
            is_block = isinstance(child, BLOCKS)
            below = is_block and not (is_elif and isinstance(child, ast.If))
            deepest = max(deepest, depth(child) + below)
    return deepest


def nested_functions(path: Path) -> Iterator[str]:
    """Yield the functions that are deeply nested."""
    for function in functions(path):
        if (deep := depth(function)) > MAX_NESTING:
            yield f"{name_of(path)}: {function.name} {deep}"


def long_functions(path: Path) -> Iterator[str]:
    """Yield the functions of too many lines."""
    for function in functions(path):
        lines = (function.end_lineno or 0) - function.lineno
        if ast.get_docstring(function, clean=False) is not None:
            lines -= (function.body[0].end_lineno or 0) - function.body[0].lineno + 1
        if lines > MAX_FUNCTION_LINES:
            yield f"{name_of(path)}: {function.name} {lines}"


def crowded_functions(path: Path) -> Iterator[str]:
    """Yield the functions of too many parameters, `self` and `cls` included."""
    for function in functions(path):
        given = function.args
        is_estimator = function.name == "__init__" and "random_state" in map(
            attrgetter("arg"), given.kwonlyargs
        )
        if is_estimator:  # scikit-learn reads its parameters from the signature
            continue
        parameters = len(given.posonlyargs) + len(given.args) + len(given.kwonlyargs)
        if parameters > MAX_PARAMETERS:
            yield f"{name_of(path)}: {function.name} {parameters}"


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


def has_unit(name: str) -> bool:
    """Return whether the name of a constant says what its number is."""
    parts = name.strip("_").upper().split("_")
    last = parts[-1]
    return last in UNITS | WORDS or "_".join(parts[-2:]) in UNITS


def all_constants(path: Path) -> Iterator[str]:
    """Yield a place for every single number in the constants of a module."""
    for name, count in constants(path):
        yield from [f"{name_of(path)}: {name}"] * count


def constants_without_unit(path: Path) -> Iterator[str]:
    """Yield the constants whose names do not say a unit."""
    for name, _ in constants(path):
        if not has_unit(name):
            yield f"{name_of(path)}: {name}"


def defined_names(node: ast.AST) -> Iterator[str]:
    """Yield the names that a node of the syntax tree defines."""
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id
    elif isinstance(node, ast.arg):
        yield node.arg
    elif isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
        yield node.name


def is_parameter(node: ast.AST) -> bool:
    """Return whether a node declares a parameter that users set by its name."""
    value = getattr(node, "value", None)
    return (
        isinstance(node, ast.AnnAssign)
        and isinstance(value, ast.Call)
        and isinstance(value.func, ast.Name)
        and value.func.id == "parameter"
    )


def banned_names(path: Path) -> Iterator[str]:
    """Yield the places where a name is defined that a reader has to decode."""
    nodes = list(ast.walk(tree_of(path)))
    interfaces = {node.target for node in nodes if is_parameter(node)}
    for node in nodes:
        for name in defined_names(node):
            if node not in interfaces and re.sub(r"^_+", "", name).lower() in BANNED:
                yield f"{name_of(path)}:{getattr(node, 'lineno', 0)} {name}"


FIGURES = {
    "long lines": long_lines,
    "complex functions": complex_functions,
    "branching functions": branching_functions,
    "nested functions": nested_functions,
    "long functions": long_functions,
    "crowded functions": crowded_functions,
    "constants": all_constants,
    "constants without a unit": constants_without_unit,
    "banned names": banned_names,
}


def lines_of(folder: str) -> int:
    """Return the number of lines of the Python files of a folder."""
    files = (ROOT / folder).rglob("*.py")
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)


def totals(paths: Iterable[Path] = PYTHON_FILES) -> dict[str, int]:
    """Return the figures of all files, or of some."""
    files = list(paths)
    figures = {"tokens": sum(map(tokens, files))}
    for name, places in FIGURES.items():
        figures[name] = sum(1 for path in files for _ in places(path))
    return figures


def tables() -> str:
    """Return all tables."""
    lines = ["| | 982257a1 | now | at most |", "|---|---|---|---|"]
    for name, count in totals().items():
        before = format(BEFORE[name], ",") if name in BEFORE else ""
        most = format(BUDGET[name], ",") if name in BUDGET else ""
        lines.append(f"| {name} | {before} | {count:,} | {most} |")
    lines += [f"| lines of {name} | | {lines_of(name):,} | |" for name in ("test", "benchmarks")]
    lines += ["", "| room | files | tokens | imports |", "|---|---|---|---|"]
    for name, imports in {**rooms_imported(), "msg_conventions": FOUNDATION}.items():
        files = [path for path in PYTHON_FILES if room_of(path) == name]
        count = sum(map(tokens, files))
        lines.append(f"| `{name}` | {len(files)} | {count:,} | {', '.join(sorted(imports))} |")
    return "\n".join(lines) + "\n"


def room_of(path: Path) -> str:
    """Return the room of a file."""
    first = path.relative_to(ROOT).parts[0]
    return room(path) if first == "scenario_gen" else first


def chosen(paths: list[str]) -> list[Path]:
    """Return the source files that some paths name; all without any."""
    if not paths:
        return PYTHON_FILES
    folders = [Path(path).resolve() for path in paths]
    return [path for path in PYTHON_FILES if any(path.is_relative_to(each) for each in folders)]


def main() -> None:
    """Print the figures, or put the tables between their marks in a page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", type=Path)
    parser.add_argument("--list", choices=FIGURES)
    parser.add_argument("paths", nargs="*")
    options = parser.parse_args()
    files = chosen(options.paths)
    if options.list:
        for path in files:
            for place in FIGURES[options.list](path):
                print(place)
        return
    if options.paths:
        print(*(f"{name}: {count:,}" for name, count in totals(files).items()), sep="\n")
        return
    if options.write is None:
        print(tables(), end="")
        return
    before, _, rest = options.write.read_text(encoding="utf-8").partition(MARKS[0])
    text = before + MARKS[0] + tables() + MARKS[1] + rest.partition(MARKS[1])[2]
    options.write.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
