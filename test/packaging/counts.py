# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Counts of the working tree as Markdown tables, and their budget; `make counts` writes them into docs/architecture.md.

    python counts.py [--write PAGE]

* code lines: lines that are not blank, no comment and no docstring, of scenario_gen/ and msg_conventions/, kernels too;
* report lines: of its scripts, styles and templates that are not blank;
* parameters: of every function, kernels too, `self` and `cls` included.
"""

import argparse
import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
import sys

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "test"))

from test_architecture import FOUNDATION, PYTHON_FILES, room, rooms_imported  # noqa: E402 - needs the path

MARKS = ("<!-- counts -->\n", "<!-- end of counts -->\n")
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
MAX_PARAMETERS, MAX_LINES = 8, 60
CROWDED, LONG = (
    f"functions of more than {MAX_PARAMETERS} parameters",
    f"functions of more than {MAX_LINES} lines",
)
BUDGET = {
    "code lines": 41_264,
    CROWDED: 1,
    LONG: 0,
}  # a change that needs more deletes something, or says why
BEFORE = {
    "code lines": 42_330,
    "report lines": 1_348,
    "test lines": 35_837,
    CROWDED: 42,
    LONG: 13,
}  # of commit f376887


@cache
def code_lines(path: Path) -> int:
    """Return the number of lines that hold code: no docstring, no comment, not blank."""
    text = path.read_text(encoding="utf-8")
    docstrings: set[int] = set()
    strings: set[int] = set()  # whose lines are code though they look blank, or like comments
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            docstrings |= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
        elif isinstance(node, ast.Constant | ast.JoinedStr):
            strings |= set(range(node.lineno, (node.end_lineno or 0) + 1))
    lines = {
        k
        for k, line in enumerate(text.splitlines(), start=1)
        if (bare := line.strip()) and bare[0] != "#"
    }
    return len((lines | strings) - docstrings)


def functions() -> Iterator[tuple[str, int, int]]:
    """Yield module and name, parameters and lines of every function."""
    for path in PYTHON_FILES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                given = node.args
                parameters = len(given.posonlyargs) + len(given.args) + len(given.kwonlyargs)
                name = f"`{path.relative_to(ROOT).with_suffix('')}: {node.name}`".replace(
                    "scenario_gen/", ""
                )
                yield name, parameters, (node.end_lineno or 0) - node.lineno


def totals() -> dict[str, int]:
    """Return the figures of the whole."""
    page = [
        path
        for path in (ROOT / "scenario_gen").rglob("*")
        if path.suffix in (".js", ".css", ".j2")
    ]
    sizes = list(functions())
    return {
        "code lines": sum(map(code_lines, PYTHON_FILES)),
        "report lines": sum(
            bool(line.strip())
            for path in page
            for line in path.read_text(encoding="utf-8").splitlines()
        ),
        "test lines": sum(
            len(path.read_text(encoding="utf-8").splitlines())
            for path in (ROOT / "test").rglob("*.py")
        ),
        CROWDED: sum(parameters > MAX_PARAMETERS for _, parameters, _ in sizes),
        LONG: sum(lines > MAX_LINES for _, _, lines in sizes),
    }


def tables() -> str:
    """Return all tables."""
    lines = ["| | f376887 | now | at most |", "|---|---|---|---|"]
    lines += [
        f"| {k} | {BEFORE[k]:,} | {n:,} | {format(BUDGET[k], ',') if k in BUDGET else ''} |"
        for k, n in totals().items()
    ]
    for title, place, most in ((CROWDED, 1, MAX_PARAMETERS), (LONG, 2, MAX_LINES)):
        named = [f"{sizes[0]} {sizes[place]}" for sizes in functions() if sizes[place] > most]
        lines += ["", f"{title.capitalize()}: {', '.join(named) or 'none'}."]
    lines += ["", "| room | files | code lines | imports |", "|---|---|---|---|"]
    for name, imports in {**rooms_imported(), "msg_conventions": FOUNDATION}.items():
        files = [
            path
            for path in PYTHON_FILES
            if name in (path.relative_to(ROOT).parts[0], room_of(path))
        ]
        lines.append(
            f"| `{name}` | {len(files)} | {sum(map(code_lines, files)):,} | {', '.join(sorted(imports))} |"
        )
    return "\n".join(lines) + "\n"


def room_of(path: Path) -> str:
    """Return the room of a file of scenario_gen, "" for others."""
    return room(path) if "scenario_gen" in path.relative_to(ROOT).parts[:1] else ""


def main() -> None:
    """Print the tables, or put them between their marks in a page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", type=Path)
    page = parser.parse_args().write
    if page is None:
        print(tables(), end="")
        return
    before, _, rest = page.read_text(encoding="utf-8").partition(MARKS[0])
    page.write_text(
        before + MARKS[0] + tables() + MARKS[1] + rest.partition(MARKS[1])[2], encoding="utf-8"
    )


if __name__ == "__main__":
    main()
