# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The shape of the house: stages import only what stands before them, rclpy only in the nodes, nothing local leaks out."""

import ast
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "scenario_gen"

# The data flow, first to last: a room is a folder or a module of scenario_gen, and imports none that stands behind it.
FOUNDATION = {"base", "numerics", "types"}
ROOMS = (
    "base",
    "numerics",
    "smoothing",
    "types",
    "bags",
    "logs",
    "situation",
    "roads",
    "method",
    "pipeline",
    "output",
)
ROOMS += ("closed_loop", "corpus", "ros", "cli", "__main__")
# The same of the stages, folders or modules of scenario_gen/method.
STAGES = (
    "segmentation",
    "fitting",
    "routing",
    "validity",
    "sampling",
    "evaluation",
    "drives",
    "approaches",
    "continuation",
    "decisions",
    "outcome_sets",
    "config",
    "arguments",
    "shortening",
    "chain",
)
# Each concept, its one home, and what would show a second one: a regular expression, searched in the whole text of a file.
CONCEPTS = {
    "rectangles: corners, overlap, distance": (
        "numerics/boxes.py",
        r"def \w*(?:corners|box_gap|box_distance|footprint_gaps?)\(|abs\([^()]* \* [^()]* \+ [^()]* \* [^()]*\), abs\(",
    ),
    "motion between two samples": (
        "numerics/hermite.py",
        r"CubicHermiteSpline\([^)]*position|def (?:control_points|interval_at)\(",
    ),
    "penalised splines, and the noise of fixes": (
        "smoothing/",
        r"def \w*(?:smoothing_spline|fit_path|estimated_noise)\(|BSpline\.design_matrix",
    ),
    "gap of two motions in space and time": ("logs/gap.py", r"def \w*space_time_gap\("),
    "growing of groups": ("logs/growing.py", r"class Growth\b|def \w*grow_groups?\("),
    "least squares of a placement": (
        "situation/placement_lsq.py",
        r"def \w*(?:least_squares|solve_placement)\(",
    ),
    "RRT*-Connect": (
        "method/routing/search/rrt_star_connect.py",
        r"def _?choose_parent\(",
    ),
    "layout of the standard normal numbers": (
        "method/sampling/numbers.py",
        r"class \w*Numbers\(|lateral_root\.shape\[1\] \+",
    ),
    "rows of the certificate": ("method/validity/dynamics.py", r"class Check\(|worst_excess\("),
    "latitude and longitude": ("logs/geodesy.py", r"(?:import|from) pyproj|6_?378_?137|6_?371_?0"),
    "folders that replace others": ("base/folders.py", r"renameat2|RENAME_EXCHANGE"),
    "cells of a polygon": ("numerics/polygons.py", r"rasteri[sz]e\(|np\.lexsort\(\(column, row"),
    "lanes of a road that is drawn": (
        "roads/drawn.py",
        r"LaneNetwork\([^()]*(?:\([^()]*\)[^()]*)*drawn=True, drawn_for",
    ),
    "what is painted on a road": ("types/markings.py", r"class Marking\b"),
    "files of bags": ("bags/storage/", r"(?:import|from) (?:rosbags|mcap)\b"),
}
PYTHON_FILES = sorted([*PACKAGE.rglob("*.py"), *(ROOT / "msg_conventions").rglob("*.py")])


@cache
def imported(path: Path) -> set[str]:
    """Return the dotted names of all modules that the file imports, at any depth, also by a string."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            named = re.fullmatch(r"(scenario_gen(?:\.\w+){2,})(?::\w+)?", node.value)
            names |= {named[1]} if named else set()
    return names


def room(path: Path) -> str:
    """Return the room a file of scenario_gen belongs to: a folder, or a module of the root."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def stage(path: Path) -> str:
    """Return the stage a file of scenario_gen/method belongs to."""
    return path.relative_to(PACKAGE / "method").parts[0].removesuffix(".py")


def rooms_imported() -> dict[str, set[str]]:
    """Return which rooms each room imports."""
    found: dict[str, set[str]] = {name: set() for name in ROOMS}
    for path in (
        path for path in PYTHON_FILES if PACKAGE in path.parents and room(path) != "__init__"
    ):
        names = {name.split(".")[1] for name in imported(path) if name.startswith("scenario_gen.")}
        found[room(path)] |= (names & set(ROOMS)) - {room(path)}
    return found


def test_rooms_import_only_downwards():
    found = rooms_imported()
    assert not [
        (name, other)
        for name, others in found.items()
        for other in others
        if ROOMS.index(other) > ROOMS.index(name)
    ]


def test_stages_import_only_downwards():
    for path in (path for path in (PACKAGE / "method").rglob("*.py") if stage(path) != "__init__"):
        parts = [name.split(".") for name in imported(path)]
        used = {
            part[2] for part in parts if part[:2] == ["scenario_gen", "method"] and len(part) > 2
        }
        assert not [other for other in used if STAGES.index(other) > STAGES.index(stage(path))], (
            path
        )


def test_every_concept_has_one_home():
    homes: dict[str, set[str]] = {}
    for path in (path for path in PYTHON_FILES if PACKAGE in path.parents):
        name, text = path.relative_to(PACKAGE).as_posix(), path.read_text()
        for concept, (home, pattern) in CONCEPTS.items():
            if not name.startswith(home) and re.search(pattern, text):
                homes.setdefault(concept, set()).add(name)
    assert not homes


def test_conventions_stand_on_types():
    """Bags and nodes alone make and read messages, which know of nothing but the types."""
    for path in PYTHON_FILES:
        names = [name.split(".") for name in imported(path)]
        if PACKAGE not in path.parents:
            assert {
                parts[1] for parts in names if parts[0] == "scenario_gen" and len(parts) > 1
            } <= FOUNDATION, path
        elif room(path) not in ("bags", "ros"):
            assert "msg_conventions" not in {parts[0] for parts in names}, path


def test_modules_form_no_circle():
    """Imports inside of functions and those for type checkers count; the public names are looked up lazily, and do not."""
    files = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in PYTHON_FILES
    }
    del files["scenario_gen"]
    graph = {}
    for name, path in files.items():
        known = imported(path) & set(files) - {name}  # of `from package import module`, the module
        graph[name] = {
            one for one in known if not any(other.startswith(f"{one}.") for other in known)
        }
    TopologicalSorter(graph).prepare()  # a CycleError names the circle


def test_rclpy_stays_in_the_nodes():
    for path in PYTHON_FILES:
        if PACKAGE / "ros" not in path.parents:
            assert not {name for name in imported(path) if name.split(".")[0] == "rclpy"}, path


def test_command_line_loads_lazily():
    """Else `scenario-gen --help` takes seconds."""
    heavy = {
        "numpy",
        "scipy",
        "numba",
        "pandas",
        "shapely",
        "jinja2",
        "rosbags",
        "yaml",
        "duckdb",
        "distributed",
    }
    program = "import sys, scenario_gen.__main__, scenario_gen.cli.commands; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    assert not heavy & set(loaded)


def test_no_file_needs_a_map():
    for path in PYTHON_FILES:
        assert len(path.read_text().splitlines()) <= 500, path


def test_tracked_text_leaks_nothing():
    """Tracked text names no absolute home or work path and no package registry's host."""
    files = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if files.returncode:
        pytest.skip("not a git checkout")
    hosts = "|".join((r"py" r"pi\.org", r"python" r"hosted", r"npm" r"js\.org", r"index.url"))
    leak = re.compile(rf"(?<![\w.])/(?:work|root|home/\w+)/|{hosts}", re.IGNORECASE)
    for name in files.stdout.split():
        path = ROOT / name
        if (
            path == Path(__file__)
            or not path.is_file()
            or path.suffix in {".mcap", ".png", ".db3"}
        ):
            continue
        found = leak.search(path.read_text(errors="replace"))
        assert not found, f"{name}: {found.group() if found else ''}"


READS_TEXT = re.compile(
    r"\b(?:\w*notes?|adaptations?|str\(\w*error\w*\)|\w*message|remarks?|sentences?|\w*fault)"
    r"\.(?:startswith|endswith|partition|rpartition|split)\((?!\)|\"\\n\")"  # lines and spaces may be split
    r"|[\"'A-Z]\)? (?:not )?in (?:note|str\(\w*error\w*\)|sentence|remark)\b"
)


def test_logic_reads_kinds_not_wording():
    found = [
        f"{path.relative_to(ROOT)}:{number}"
        for path in PYTHON_FILES
        for number, line in enumerate(path.read_text().splitlines(), 1)
        if READS_TEXT.search(line)
    ]
    assert not found
