# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The shape of the house: stages import only what stands before them, rclpy only in the nodes, nothing local leaks out."""

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
import importlib
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "scenario_gen"

# The data flow, first to last: a room is a folder or a module of scenario_gen. What each imports, besides the foundation.
FOUNDATION = {"base", "numerics", "types"}
ROOMS = {
    "base": set(),
    "numerics": set(),
    "types": set(),
    "bags": set(),
    "logs": {"bags"},
    "template": set(),
    "roads": {"logs", "template"},
    "method": {"bags", "logs", "roads", "template"},
    "pipeline": {"method", "roads"},
    "output": {"bags", "logs", "method", "pipeline", "roads", "template"},
    "closed_loop": {"bags", "method", "output", "roads", "template"},
    "corpus": {"bags", "logs", "method", "output", "pipeline", "roads", "template"},
    "ros": {"bags", "closed_loop", "logs", "method", "roads", "template"},
    "cli": {"bags", "closed_loop", "corpus", "logs", "method", "output", "pipeline", "roads", "ros"},
    "__main__": {"cli"},
}
# The same of the stages, folders or modules of scenario_gen/method: what one makes, `pipeline` hands to the next.
STAGES = {
    "segmentation": set(),
    "fitting": set(),
    "routing": set(),
    "validity": set(),
    "sampling": {"validity"},
    "evaluation": set(),
    "config": {"segmentation", "fitting", "routing", "validity", "sampling", "evaluation"},
    "attempt": {"config", "fitting", "routing", "sampling", "evaluation"},
    "suitable_roads": {"config", "segmentation", "fitting"},
    "nearest": {"attempt", "segmentation", "fitting", "sampling", "suitable_roads"},
}
# Rooms and stages that others enter by their packages alone; behind the door stand what an extra brings, and what is slow.
DOORS = {"types", "template", "roads", "logs", *(f"method.{stage}" for stage in STAGES)}
BESIDE_THE_DOOR = {
    "logs.tables": "needs pandas",
    "method.validity.collision": "kernels, named by what they prove",
    "method.validity.containment": "kernels, named by what they prove",
}
# What may be imported inside a function, and why: libraries, and modules of ours that load such.
LATE = {
    "arviz": "tests alone install it",
    "betterosi": "extra osi",
    "ast": "read when the first public name is used",
    "dask": "extra corpus",
    "distributed": "extra corpus",
    "duckdb": "extra corpus",
    "fsspec": "extra stores",
    "concurrent": "slow to load",
    "jsonschema": "slow to load",
    "matplotlib": "extra plot",
    "multiprocessing": "slow to load",
    "pandas": "slow to load",
    "protobuf": "extra osi",
    "pyarrow": "extra parquet",
    "rich": "extra cli",
    "rosbags": "extra bags",
    "sklearn": "tests alone install it",
    "yaml": "slow to load",
}
LATE_OURS = {
    "__main__.py": "a command loads what it needs",
    "cli/": "a command loads what it needs",
    "logs/adapters/tracks.py": "needs pyarrow",
    "logs/read.py": "adapters need extras",
    "logs/tables.py": "needs pyarrow",
    "method/routing/search/ompl/planners.py": "needs ompl",
    "ros/plumbing/sampling_requests.py": "loads all stages, and few requests need them",
    "ros/plumbing/start.py": "loads rclpy",
    "types/generation.py": "its methods call public functions, which are loaded when they are first used",
    "types/scenario.py": "likewise",
}
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


def test_every_room_imports_what_the_table_says_and_nothing_behind_it():
    found: dict[str, set[str]] = {name: set() for name in ROOMS}
    for path in (path for path in PYTHON_FILES if PACKAGE in path.parents and room(path) != "__init__"):
        names = {name.split(".")[1] for name in imported(path) if name.startswith("scenario_gen.")}
        found[room(path)] |= (names & set(ROOMS)) - {room(path)}
    order = list(ROOMS)
    assert all(order.index(other) < order.index(name) for name, others in found.items() for other in others)
    assert {name: others - FOUNDATION for name, others in found.items()} == ROOMS


def test_every_stage_imports_what_the_table_says_and_nothing_behind_it():
    found: dict[str, set[str]] = {name: set() for name in STAGES}
    for path in (path for path in (PACKAGE / "method").rglob("*.py") if stage(path) != "__init__"):
        parts = [name.split(".") for name in imported(path)]
        found[stage(path)] |= {part[2] for part in parts if part[:2] == ["scenario_gen", "method"] and len(part) > 2}
    order = list(STAGES)
    assert all(order.index(other) <= order.index(name) for name, others in found.items() for other in others)
    assert {name: others - {name} for name, others in found.items()} == STAGES


def door(name: str) -> str:
    """Return the room or stage with a door that a module stands in, "" if there is none."""
    parts = name.split(".")[1:] if name.startswith("scenario_gen.") else []
    own = ".".join(parts[: 2 if parts[:1] == ["method"] else 1])
    return own if own in DOORS else ""


def test_rooms_and_stages_are_entered_by_their_doors():
    modules = {module(path) for path in PYTHON_FILES}
    used = set()
    for path in (path for path in PYTHON_FILES if path != PACKAGE / "__init__.py"):
        for name in modules_imported(path, modules):
            entered = door(name)
            package, _, last = name.rpartition(".")
            is_public = package == f"scenario_gen.{entered}" and last in importlib.import_module(package).__all__
            if entered and entered != door(module(path)) and name != f"scenario_gen.{entered}" and not is_public:
                assert name.removeprefix("scenario_gen.") in BESIDE_THE_DOOR, f"{path} imports {name}"
                used.add(name.removeprefix("scenario_gen."))
    assert used == set(BESIDE_THE_DOOR)


def imports_in_functions(path: Path) -> set[str]:
    """Return the modules that are imported inside functions of a file."""
    functions = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef)]
    found: set[str] = set()
    for node in (node for function in functions for node in ast.walk(function)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
    return found


def test_functions_import_extras_and_what_is_slow_to_load_alone():
    used, libraries = set(), set()
    for path in PYTHON_FILES:
        name = path.relative_to(PACKAGE if PACKAGE in path.parents else ROOT).as_posix()
        for imported_name in imports_in_functions(path):
            if imported_name.split(".")[0] in LATE:
                libraries.add(imported_name.split(".")[0])
                continue
            own = [known for known in LATE_OURS if name.startswith(known)]
            assert own and imported_name.split(".")[0] == "scenario_gen", f"{name} imports {imported_name} inside a function"
            used.add(own[0])
    assert used == set(LATE_OURS) and libraries == set(LATE)


def test_the_conventions_stand_on_the_types_and_below_bags_and_nodes():
    """Bags and nodes alone make and read messages, which know of nothing but the types."""
    for path in PYTHON_FILES:
        names = [name.split(".") for name in imported(path)]
        if PACKAGE not in path.parents:
            assert {parts[1] for parts in names if parts[0] == "scenario_gen" and len(parts) > 1} <= FOUNDATION, path
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
    heavy = {"numpy", "scipy", "numba", "pandas", "shapely", "jinja2", "rosbags", "yaml", "duckdb", "distributed"}
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
