# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Counts of the working tree as Markdown tables; `make counts` writes them into docs/architecture.md.

    python counts.py [--write PAGE]

* code lines: lines that are not blank, no comment and no docstring, of scenario_gen/ and msg_conventions/;
* rooms: folders of scenario_gen, msg_conventions, and modules of the root;
* arrows: ordered pairs (A, B) of rooms of which A imports B, at any depth; up: B stands behind A in the order of ROOMS in
  test_architecture.py, and the conventions behind the types; mutual: pairs whose inverse is an arrow too;
* floors: rooms of the longest chain of imports;
* parameters: of functions outside numba kernels, `self` and `cls` included.
"""

import argparse
import ast
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
import re
import sys

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "test"))

from test_architecture import ROOMS  # noqa: E402 - needs the path

MARKS = ("<!-- counts -->\n", "<!-- end of counts -->\n")
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
MOST_PARAMETERS, MOST_LINES = 8, 60
STEP = re.compile(r"^\| \d+ \| `scenario_gen/", re.MULTILINE)  # of the way of one encounter, which test_walk.py takes
BEFORE = {  # of commit 4ef626c
    "code lines": "36,446",
    "lines": "57,722",
    "modules at the root; folders beside them": "23; 21",
    "files of the nodes": "35",
    "import arrows; up or mutual": "330; 8",
    f"functions of more than {MOST_PARAMETERS} parameters": "12",
    f"functions of more than {MOST_LINES} lines": "20",
    "imports inside functions": "131",
}


@dataclass(frozen=True, eq=False)
class Source:
    """A file: its room and its text."""

    path: Path
    room: str
    text: str

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """All nodes of its tree, the module first."""
        return tuple(ast.walk(ast.parse(self.text)))

    @cached_property
    def functions(self) -> tuple[ast.FunctionDef, ...]:
        """All functions, at any depth."""
        return tuple(node for node in self.nodes if isinstance(node, ast.FunctionDef))

    @cached_property
    def imports(self) -> tuple[ast.Import | ast.ImportFrom, ...]:
        """All import statements, at any depth."""
        return tuple(node for node in self.nodes if isinstance(node, ast.Import | ast.ImportFrom))

    @cached_property
    def code_lines(self) -> int:
        """The number of lines that hold code: no docstring, no comment, not blank."""
        docstrings: set[int] = set()
        strings: set[int] = set()  # whose lines are code though they look blank, or like comments
        for node in self.nodes:
            if isinstance(node, DOCUMENTED) and node.body and is_text(node.body[0]):
                docstrings |= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
            elif isinstance(node, ast.Constant | ast.JoinedStr):
                strings |= set(range(node.lineno, (node.end_lineno or 0) + 1))
        lines = {k for k, line in enumerate(self.text.splitlines(), start=1) if (bare := line.strip()) and bare[0] != "#"}
        return len((lines | strings) - docstrings)


def is_text(statement: ast.stmt) -> bool:
    """Whether a statement is a string and nothing else."""
    return (
        isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant) and isinstance(statement.value.value, str)
    )


@cache
def sources() -> tuple[Source, ...]:
    """Return all files of the package and the conventions."""
    found = []
    for path in sorted([*ROOT.glob("scenario_gen/**/*.py"), *ROOT.glob("msg_conventions/**/*.py")]):
        parts = path.relative_to(ROOT).parts
        text = path.read_text(encoding="utf-8")
        room = parts[0] if parts[0] != "scenario_gen" else parts[1].removesuffix(".py")
        found.append(Source(path, room, text))
    return tuple(found)


@cache
def arrows() -> set[tuple[str, str]]:
    """Return which rooms import which."""
    rooms = {source.room for source in sources()}
    found = set()
    for source in sources():
        for node in source.imports:
            package = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
            names = [f"{package}{alias.name}" for alias in node.names]
            for parts in (name.split(".") for name in names):
                room = parts[0] if parts[0] == "msg_conventions" else ".".join(parts[1:2])
                if parts[0] in ("scenario_gen", "msg_conventions") and room in rooms and room != source.room:
                    found.add((source.room, room))
    return found


def up_or_mutual(pairs: set[tuple[str, str]], rooms: Iterable[str] = ROOMS) -> set[tuple[str, str]]:
    """Return the arrows to a room that stands behind in the order, and those that go both ways."""
    place = {room: place for place, room in enumerate(rooms)}
    place["msg_conventions"] = place.get("types", 0) + 0.5
    return {(a, b) for a, b in pairs if place[b] > place[a] or (b, a) in pairs}


def floors(pairs: set[tuple[str, str]]) -> int:
    """Return the number of rooms in the longest chain of imports."""

    @cache
    def height(room: str) -> int:
        return 1 + max((height(b) for a, b in pairs if a == room), default=0)

    return max(height(room) for room, _ in pairs)


def is_kernel(function: ast.FunctionDef) -> bool:
    """Whether numba compiles it."""
    return any("kernel" in ast.unparse(one) or "njit" in ast.unparse(one) for one in function.decorator_list)


def parameters(function: ast.FunctionDef) -> int:
    """Return the number of its parameters."""
    given = function.args
    return len(given.posonlyargs) + len(given.args) + len(given.kwonlyargs)


def named(source: Source, function: ast.FunctionDef) -> str:
    """Return a function's module and name."""
    return f"`{source.path.relative_to(ROOT / 'scenario_gen').with_suffix('')}: {function.name}`"


def crowded() -> list[str]:
    """Return the functions outside kernels with too many parameters."""
    return [
        f"{named(source, one)} {parameters(one)}"
        for source in sources()
        for one in source.functions
        if parameters(one) > MOST_PARAMETERS and not is_kernel(one)
    ]


def long() -> list[str]:
    """Return the functions that are too long."""
    return [
        f"{named(source, one)} {length}"
        for source in sources()
        for one in source.functions
        if (length := (one.end_lineno or 0) - one.lineno) > MOST_LINES
    ]


def late_imports() -> int:
    """Return the number of imports inside functions."""
    spans = {source: [(one.lineno, one.end_lineno or 0) for one in source.functions] for source in sources()}
    return sum(
        any(first < node.lineno <= last for first, last in spans[source]) for source in sources() for node in source.imports
    )


def totals() -> dict[str, str]:
    """Return the figures of the whole."""
    root = [source for source in sources() if source.path.parent == ROOT / "scenario_gen"]
    folders = [path for path in (ROOT / "scenario_gen").iterdir() if path.is_dir() and not path.name.startswith("_")]
    nodes = [source for source in sources() if source.room == "ros"]
    pairs = arrows()
    return {
        "code lines": f"{sum(source.code_lines for source in sources()):,}",
        "lines": f"{sum(len(source.text.splitlines()) for source in sources()):,}",
        "modules at the root; folders beside them": f"{len(root)}; {len(folders)}",
        "files of the nodes": str(len(nodes)),
        "floors": str(floors(pairs)),
        "import arrows; up or mutual": f"{len(pairs)}; {len(up_or_mutual(pairs))}",
        f"functions of more than {MOST_PARAMETERS} parameters": str(len(crowded())),
        f"functions of more than {MOST_LINES} lines": str(len(long())),
        "imports inside functions": str(late_imports()),
        "files on the way of one encounter (CONTRIBUTING.md)": str(
            len(STEP.findall((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")))
        ),
    }


def stages() -> dict[str, int]:
    """Return the code lines of each stage: a folder or a module of scenario_gen/method."""
    found: Counter[str] = Counter()
    for source in sources():
        if source.room == "method":
            found[source.path.relative_to(ROOT / "scenario_gen" / "method").parts[0].removesuffix(".py")] += source.code_lines
    return {name: n for name, n in found.items() if n and name != "__init__"}


def tables() -> str:
    """Return all tables."""
    lines = ["| | 4ef626c | now |", "|---|---|---|"]
    lines += [f"| {name} | {BEFORE.get(name, '–')} | {value} |" for name, value in totals().items()]
    lines += ["", f"More than {MOST_PARAMETERS} parameters: {', '.join(crowded()) or 'none'}.", ""]
    lines += [f"More than {MOST_LINES} lines: {', '.join(long()) or 'none'}.", ""]
    pairs = arrows()
    lines += ["| room | files | code lines | imports |", "|---|---|---|---|"]
    for room in sorted({source.room for source in sources()} - {"__init__"}):
        own = [source for source in sources() if source.room == room]
        behind = ", ".join(sorted(b for a, b in pairs if a == room))
        lines.append(f"| `{room}` | {len(own)} | {sum(source.code_lines for source in own):,} | {behind} |")
    pages = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    lines += ["", f"Code lines of the stages: {', '.join(f'`{name}` {n:,}' for name, n in sorted(stages().items()))}."]
    words = {page.name: len(re.findall(r"\w+", without_tables(page.read_text(encoding="utf-8")))) for page in pages}
    lines += ["", f"Words by page ({sum(words.values()):,}): {', '.join(f'{name} {n:,}' for name, n in words.items())}."]
    return "\n".join(lines) + "\n"


def without_tables(page: str) -> str:
    """Return a page without these tables, whose words are not written by anybody."""
    before, _, rest = page.partition(MARKS[0])
    return before + rest.partition(MARKS[1])[2]


def written(page: str) -> str:
    """Return a page with the tables between their marks."""
    before, _, rest = page.partition(MARKS[0])
    return before + MARKS[0] + tables() + MARKS[1] + rest.partition(MARKS[1])[2]


def main() -> None:
    """Print the tables, or put them between their marks in a page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=Path)
    page = parser.parse_args().write
    if page is None:
        print(tables(), end="")
    else:
        page.write_text(written(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
