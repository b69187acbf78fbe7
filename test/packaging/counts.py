# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Counts of one or more trees of the project, as a Markdown table; `make counts` writes it into docs/architecture.md.

    python counts.py [--write PAGE] [NAME=]COMMIT ...        the working tree comes last

What is counted, of scenario_gen/ and msg_conventions/:

* files: those that end with .py;
* code lines: lines with a token that is no comment, outside of docstrings;
* median: code lines of the file in the middle;
* containers: dataclasses that carry a generation from stage to stage, that is, have three or more of PARTS among their fields,
  or two of them one of which is such a container (a list of whole generations is none);
* arrows: ordered pairs (A, B) of folders of scenario_gen of which A imports B, at any depth and for type checkers too;
* both ways: those pairs whose inverse is an arrow too.
"""

import argparse
import ast
import io
from pathlib import Path
import re
import statistics
import subprocess
import tarfile
import tempfile
import tokenize

ROOT = Path(__file__).resolve().parents[2]
BLANK = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
PARTS = ("Encounter", "Segmentation", "Road", "Fit", "Route", "ScenarioSet")
MARKS = ("<!-- counts -->\n", "<!-- end of counts -->\n")


def code_lines(text: str) -> int:
    """Return the number of lines that hold code: no docstring, no comment, not blank."""
    docstrings: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            docstrings |= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in BLANK:
            lines |= set(range(token.start[0], token.end[0] + 1))
    return len(lines - docstrings)


def containers(texts: list[str]) -> list[str]:
    """Return the names of the dataclasses that carry a generation."""
    parts = {name: {name} for name in PARTS}
    types: dict[str, set[str]] = {}
    for node in (node for text in texts for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ClassDef)):
        if any("dataclass" in ast.unparse(one) for one in node.decorator_list):
            annotations = " ".join(ast.unparse(one.annotation) for one in node.body if isinstance(one, ast.AnnAssign))
            types[node.name] = types.get(node.name, set()) | set(re.findall(r"\w+", annotations))
    found: list[str] = []
    while more := [name for name, held in types.items() if name not in parts and len(carried(held, parts)) >= 3]:
        parts |= {name: carried(types[name], parts) for name in more}
        found += more
    return sorted(found)


def carried(types: set[str], parts: dict[str, set[str]]) -> set[str]:
    """Return the parts of a generation that fields of these types bring."""
    named = types & set(parts)
    return {part for name in named for part in parts[name]} if len(named) > 1 else set()


def arrows(tree: Path) -> set[tuple[str, str]]:
    """Return which folders of scenario_gen import which, at any depth of their code."""
    package = tree / "scenario_gen"
    folders = {path.name for path in package.iterdir() if path.is_dir()}
    found = set()
    for path in package.rglob("*.py"):
        own = path.relative_to(package).parts[0].removesuffix(".py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            else:
                names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            parts = [name.split(".") for name in names]
            found |= {(own, part[1]) for part in parts if part[0] == "scenario_gen" and len(part) > 1 and part[1] in folders}
    return {(a, b) for a, b in found if a in folders and a != b}


def counts(tree: Path) -> dict[str, str]:
    """Return the figures of a tree, by name."""
    texts = [
        path.read_text(encoding="utf-8") for part in ("scenario_gen", "msg_conventions") for path in (tree / part).rglob("*.py")
    ]
    lines = [code_lines(text) for text in texts]
    carriers = containers(texts)
    pairs = arrows(tree)
    return {
        "files": f"{len(texts):,}",
        "code lines": f"{sum(lines):,}",
        "median code lines of a file": f"{statistics.median(lines):g}",
        "containers of a generation": f"{len(carriers)} ({', '.join(carriers)})",
        "import arrows between folders": str(len(pairs)),
        "arrows that go both ways": str(sum((b, a) in pairs for a, b in pairs)),
    }


def of_commit(commit: str) -> dict[str, str]:
    """Return the figures of a commit of this repository."""
    archive = subprocess.run(
        ["git", "archive", commit, "scenario_gen", "msg_conventions"], cwd=ROOT, check=True, capture_output=True
    ).stdout
    with tempfile.TemporaryDirectory() as folder, tarfile.open(fileobj=io.BytesIO(archive)) as packed:
        packed.extractall(folder, filter="data")
        return counts(Path(folder))


def table(columns: dict[str, dict[str, str]]) -> str:
    """Return the figures, one column for each tree."""
    lines = [f"| | {' | '.join(columns)} |", "|---|" + "---|" * len(columns)]
    lines += [f"| {name} | {' | '.join(column[name] for column in columns.values())} |" for name in next(iter(columns.values()))]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the table, or put it between its marks in a page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commits", nargs="*", metavar="[NAME=]COMMIT")
    parser.add_argument("--write", type=Path)
    asked = parser.parse_args()
    columns = {text.rpartition("=")[0] or text: of_commit(text.rpartition("=")[2]) for text in asked.commits}
    said = table(columns | {"this version": counts(ROOT)})
    if asked.write is None:
        print(said, end="")
        return
    page = asked.write.read_text(encoding="utf-8")
    before, _, rest = page.partition(MARKS[0])
    asked.write.write_text(before + MARKS[0] + said + MARKS[1] + rest.partition(MARKS[1])[2], encoding="utf-8")


if __name__ == "__main__":
    main()
