# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Names tell their meaning, and those of constants a unit, or that the number is a ratio or a count."""

import ast
from collections.abc import Iterator
from pathlib import Path
import re

from counts import constants
from test_architecture import PYTHON_FILES, ROOT

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
TEST_NAME_WORDS = 6


def has_unit(name: str) -> bool:
    """Return whether the name of a constant says what its number is."""
    parts = name.strip("_").upper().split("_")
    last = parts[-1]
    return last in UNITS | WORDS or "_".join(parts[-2:]) in UNITS


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
    nodes = list(ast.walk(ast.parse(path.read_text())))
    interfaces = {node.target for node in nodes if is_parameter(node)}
    for node in nodes:
        for name in defined_names(node):
            if node not in interfaces and re.sub(r"^_+", "", name).lower() in BANNED:
                yield f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 0)} {name}"


def test_no_name_needs_decoding():
    assert not [place for path in PYTHON_FILES for place in banned_names(path)]


def test_constants_say_their_unit():
    assert not [
        f"{path.relative_to(ROOT)}: {name}"
        for path in PYTHON_FILES
        for name, _ in constants(path)
        if not has_unit(name)
    ]


def test_names_of_tests_are_short():
    assert not [
        f"{path.relative_to(ROOT)}: {node.name}"
        for path in (ROOT / "test").rglob("test_*.py")
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.FunctionDef)
        and node.name.startswith("test_")
        and node.name.count("_") > TEST_NAME_WORDS
    ]
