# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Small faults in the arithmetic, one at a time, in a copy of the repository: does a test of the same folder fail?

`make soak PART=mutations`; `SCENARIO_GEN_SOAK_MUTANTS` per folder (5), drawn by `SCENARIO_GEN_SOAK_SEED` (1).
"""

import ast
from collections.abc import Iterator
import os
from pathlib import Path
import random
import shutil
import subprocess
import sys
import tempfile
from typing import NamedTuple

from figures import Figure, kept, ROOT

COUNT = int(os.environ.get("SCENARIO_GEN_SOAK_MUTANTS", "5"))
SEED = int(os.environ.get("SCENARIO_GEN_SOAK_SEED", "1"))
WANTED_SHARE = 28 / 30
TIMEOUT_S = 900.0
TESTS = {  # folder of scenario_gen: folders of its tests
    "method/validity": ("method/validity",),
    "method/sampling": ("method/sampling", "requests"),
    "method/fitting": ("method/fitting",),
    "method/evaluation": ("method/evaluation",),
    "smoothing": ("smoothing", "logs", "situation"),
    "situation": ("situation",),
    "closed_loop": ("closed_loop",),
    "logs": ("logs",),
}
RANGES = "base/test_parameters.py"  # of parameters, in each folder's configuration
SWAPPED = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum"}
OPERATORS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
COMPARISONS = {ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt}
TEXTUAL = (ast.JoinedStr, ast.arg, ast.AnnAssign, ast.Subscript, ast.Raise)
SYMMETRIC = {  # functions of which the first two arguments may be swapped
    "_is_same", "_paths_cross", "_wasserstein", "allclose", "box_distance", "feature_extents", "hypot", "is_same_turn",
    "jensen_shannon", "present_slice",
}  # fmt: skip
EQUIVALENT = {  # (file, mutant): the reason why no test can fail
    ("scenario_gen/closed_loop/search/settings.py", "prior_precision: float = (0.45)"): (
        "any prior of the allocation: the weights keep the estimate unbiased"
    ),
    (
        "scenario_gen/closed_loop/driver_traits.py",
        "headway = (config.headway / np.exp(HEADWAY_SPREAD_RATIO * draws.standard_normal()))",
    ): "the logarithm is distributed evenly about zero",
    ("scenario_gen/situation/tracks.py", "NOISE_STEP_RATIO = (1.26)"): (
        "a step of a grid: another one takes its place, within the same deviation"
    ),
    (
        "scenario_gen/method/sampling/sampler.py",
        "_MIN_TTC_S = (0.09000000000000001)",
    ): ("a bound of a guide of the proposal: the weights keep the share unbiased"),
    (
        "scenario_gen/logs/geodesy.py",
        "place @ (4096.0**2, (3686.4), 1.0), return_index=True, return_inverse=True",
    ): "any weights that keep the cells of the earth apart",
    (
        "scenario_gen/method/fitting/search.py",
        "first = ((self._stride // 2)) * self.road.resolution",
    ): ("the start of a search, half a cell aside: refining in steps of 1 m moves it"),
    (
        "scenario_gen/method/sampling/gp.py",
        "transform = chebyshev.chebvander(node, (n + 1)).T * (2.0 / n)",
    ): "two coefficients more, which are zero but for 1e-9",
    (
        "scenario_gen/situation/separation.py",
        "reach = ((diagonal[i] + diagonal[j]) * 2.0)",
    ): "a longer reach chooses more pairs, of which the gap is computed",
    (
        "scenario_gen/situation/traffic_side.py",
        "position=(encounter.position / flip),",
    ): "the factors are 1 and -1, which are their own inverses",
    ("scenario_gen/method/fitting/state_check.py", "_ROUNDING_M = (0.018000000000000002)"): (
        "rounding takes 7 mm at most; any more keeps the room"
    ),
}


class Mutant(NamedTuple):
    """A replacement of an expression in a file."""

    file: str
    line: int
    old: str
    new: str


def changed(node: ast.AST) -> Iterator[ast.expr]:
    """Yield expressions that are wrong in place of an expression."""
    match node:
        case ast.Constant(value=float() as value) if value:
            yield ast.Constant(0.9 * value)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            yield operand
        case ast.BinOp(right=ast.Constant(value=str())):
            return  # a text
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            yield ast.BinOp(left, OPERATORS[type(op)](), right)
            if isinstance(op, ast.Add | ast.Sub):
                yield left  # the second term is dropped
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in COMPARISONS:
            yield ast.Compare(left, [COMPARISONS[type(op)]()], [right])
        case ast.Call(func=ast.Name(id=name), args=[_, _, *_]) if name in SWAPPED:
            yield ast.Call(ast.Name(SWAPPED[name]), node.args, node.keywords)
        case ast.Call(func=ast.Attribute(value=owner, attr=name)) if name in SWAPPED:
            yield ast.Call(ast.Attribute(owner, SWAPPED[name]), node.args, node.keywords)
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)) if name in SYMMETRIC:
            return
        case ast.Call(args=[first, second, *others]) if not isinstance(second, ast.Starred):
            yield ast.Call(node.func, [second, first, *others], node.keywords)


def expressions(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the expressions below a node without those of texts, types, indices and errors."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.AnnAssign) and child.value is not None:
            yield child.value
            yield from expressions(child.value)
        elif not isinstance(child, TEXTUAL):
            yield child
            yield from expressions(child)


def mutants(folder: str) -> list[Mutant]:
    """Return all mutants of a folder's files, on single lines."""
    found = []
    for path in sorted((ROOT / "scenario_gen" / folder).rglob("*.py")):
        text, name = path.read_text(), str(path.relative_to(ROOT))
        for node in expressions(ast.parse(text)):
            for new in changed(node):
                old = ast.get_source_segment(text, node) or "\n"
                if "\n" not in old:
                    line = text.splitlines()[node.lineno - 1]
                    head = line.encode()[: node.col_offset].decode()
                    replaced = f"{head}({ast.unparse(new)}){line[len(head) + len(old) :]}"
                    found.append(Mutant(name, node.lineno, line, replaced))
    return found


def drawn(folder: str) -> list[Mutant]:
    """Return the mutants of a folder that are tested: first of one file, then of another."""
    rng = random.Random(f"{SEED} {folder}")
    found = [
        m for m in mutants(folder) if (m.file, m.new.partition("  #")[0].strip()) not in EQUIVALENT
    ]
    files = sorted({mutant.file for mutant in found})
    rng.shuffle(files)
    return [
        rng.choice([mutant for mutant in found if mutant.file == files[k % len(files)]])
        for k in range(COUNT)
    ]


def tests_pass(copy: Path, folder: str) -> bool:
    """Return whether the tests of a folder pass in the copy; a run that does not end fails."""
    places = [f"test/{place}" for place in (*TESTS[folder], RANGES)]
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *places]
    options = {"capture_output": True, "timeout": TIMEOUT_S}
    try:
        return subprocess.run(command, check=False, cwd=copy, **options).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def survives(copy: Path, folder: str, mutant: Mutant) -> bool:
    """Return whether the tests pass with a mutant."""
    path = copy / mutant.file
    text = path.read_text()
    lines = text.splitlines(keepends=True)
    lines[mutant.line - 1] = mutant.new + "\n"
    path.write_text("".join(lines))
    passed = tests_pass(copy, folder)
    path.write_text(text)
    return passed


def run(state: Path) -> Iterator[Figure]:
    """Test the mutants of one folder after the other; results are kept."""
    with tempfile.TemporaryDirectory() as name:
        copy = Path(name) / "copy"
        skipped = shutil.ignore_patterns(".*", "out", "build", "install", "log", "__pycache__")
        shutil.copytree(ROOT, copy, ignore=skipped)
        for folder in TESTS:
            place = state / f"{folder.replace('/', '.')}_{SEED}"
            place.mkdir(parents=True, exist_ok=True)
            sound = kept(place / "without.json", lambda folder=folder: tests_pass(copy, folder))
            alive = []
            for number, mutant in enumerate(drawn(folder)):
                if kept(place / f"{number}.json", lambda m=mutant, f=folder: survives(copy, f, m)):
                    alive.append(f"{mutant.file}:{mutant.line}: {mutant.new.strip()}")
            seen = f"{COUNT - len(alive)} of {COUNT}{''.join(f'; {one}' for one in alive)}"
            met = sound and len(alive) <= (1.0 - WANTED_SHARE) * COUNT
            yield Figure(f"{folder}: tests fail with a fault", "28 of 30", seen, met)
