# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The shape of the house: stages import only what stands before them, rclpy only in the nodes, nothing local leaks out."""

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "scenario_gen"

# The data flow, first to last: a room is a folder of scenario_gen, a stage a folder or a module of scenario_gen/method.
ROOMS = ("base", "numerics", "types", "bags", "logs", "template", "roads", "method", "pipeline")
ORDER = (*ROOMS, "output", "closed_loop", "corpus", "ros", "cli", "__main__")
STAGES = ("segmentation", "fitting", "routing", "validity", "sampling", "evaluation", "config", "attempt", "nearest")
RANK = {name: rank for rank, name in enumerate(ORDER)}
STAGE_RANK = {name: rank for rank, name in enumerate(STAGES)}
PYTHON_FILES = sorted([*PACKAGE.rglob("*.py"), *(ROOT / "msg_conventions").rglob("*.py")])


@cache
def imports(path: Path) -> tuple[ast.AST, ...]:
    """Return the import statements of a file, at any depth."""
    return tuple(node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Import | ast.ImportFrom))


def imported(path: Path) -> set[str]:
    """Return the dotted names of all modules that the file imports, at any depth."""
    names: set[str] = set()
    for node in imports(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def room(path: Path) -> str:
    """Return the room a file of scenario_gen belongs to: a folder, or a module of the root."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def stage(path: Path) -> str:
    """Return the stage a file of scenario_gen/method belongs to."""
    return path.relative_to(PACKAGE / "method").parts[0].removesuffix(".py")


def test_every_room_and_stage_has_a_place_in_the_order():
    assert {room(path) for path in PACKAGE.rglob("*.py")} - {"__init__"} == set(ORDER)
    assert {stage(path) for path in (PACKAGE / "method").rglob("*.py")} - {"__init__"} == set(STAGES)


def test_a_room_imports_only_what_stands_before_it():
    for path in (path for path in PYTHON_FILES if PACKAGE in path.parents and room(path) != "__init__"):
        for name in imported(path):
            parts = name.split(".")
            if parts[0] == "scenario_gen" and len(parts) > 1 and parts[1] in RANK:
                assert RANK[parts[1]] <= RANK[room(path)], f"{path} imports {name}"


def test_a_stage_of_the_method_imports_only_what_stands_before_it():
    for path in (PACKAGE / "method").rglob("*.py"):
        for name in imported(path):
            parts = name.split(".")
            if parts[:2] == ["scenario_gen", "method"] and len(parts) > 2:
                assert STAGE_RANK[parts[2]] <= STAGE_RANK[stage(path)], f"{path} imports {name}"


FOUNDATION = ("base", "numerics", "types")  # of scenario_gen, for the conventions


def test_the_conventions_stand_on_the_types_and_below_bags_and_nodes():
    """Bags and nodes alone make and read messages, which know of nothing but the types."""
    for path in PYTHON_FILES:
        names = [name.split(".") for name in imported(path)]
        if PACKAGE not in path.parents:
            assert {parts[1] for parts in names if parts[0] == "scenario_gen" and len(parts) > 1} <= set(FOUNDATION), path
        elif room(path) not in ("bags", "ros"):
            assert "msg_conventions" not in {parts[0] for parts in names}, path


def module(path: Path) -> str:
    """Return the dotted name of a file; of `__init__.py`, its package's."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def modules_imported(path: Path, known: set[str]) -> set[str]:
    """Return the modules among the `known` that a file imports: of `from package import module`, the module."""
    found: set[str] = set()
    for node in imports(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            found |= {name if name in known else node.module for name in names}
    return found & known


def folder(name: str) -> str:
    """Return what a module belongs to: a folder or a single file of scenario_gen, or the conventions."""
    return ".".join(name.split(".")[: 1 + name.startswith("scenario_gen")])


def circle(graph: dict[str, set[str]]) -> list[str]:
    """Return the names of a circle in {name: what it imports}, none if there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_modules_and_no_folders_import_each_other_in_a_circle():
    """Imports inside of functions and those for type checkers count; the public names are looked up lazily, and do not."""
    files = {module(path): path for path in PYTHON_FILES if path != PACKAGE / "__init__.py"}
    graph = {name: modules_imported(path, set(files)) - {name} for name, path in files.items()}
    folders: dict[str, set[str]] = {}
    for name, names in graph.items():
        folders.setdefault(folder(name), set()).update({folder(one) for one in names} - {folder(name)})
    assert len(graph) > 200 and any(graph.values())
    assert circle(graph) == [] and circle(folders) == []
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}})


def test_rclpy_is_imported_only_in_the_nodes():
    for path in PYTHON_FILES:
        if PACKAGE / "ros" not in path.parents:
            assert not {name for name in imported(path) if name.split(".")[0] == "rclpy"}, path


def test_the_command_line_loads_no_library_before_a_command_needs_it():
    """Else `scenario-gen --help` takes seconds."""
    heavy = {"numpy", "scipy", "numba", "pandas", "shapely", "plotly", "jinja2", "rosbags", "yaml", "duckdb", "distributed"}
    program = "import sys, scenario_gen.__main__, scenario_gen.cli.commands; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    assert not heavy & set(loaded)


def test_no_file_needs_a_map():
    for path in PYTHON_FILES:
        assert len(path.read_text().splitlines()) <= 500, path


def test_nothing_of_this_machine_and_no_registry_is_named():
    """Tracked text names no absolute home or work path and no package registry's host."""
    files = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if files.returncode:
        pytest.skip("not a git checkout")
    hosts = "|".join((r"py" r"pi\.org", r"python" r"hosted", r"npm" r"js\.org", r"index.url"))
    leak = re.compile(rf"(?<![\w.])/(?:work|root|home/\w+)/|{hosts}", re.IGNORECASE)
    for name in files.stdout.split():
        path = ROOT / name
        if path == Path(__file__) or not path.is_file() or path.suffix in {".mcap", ".png", ".db3"}:
            continue
        found = leak.search(path.read_text(errors="replace"))
        assert not found, f"{name}: {found.group() if found else ''}"
