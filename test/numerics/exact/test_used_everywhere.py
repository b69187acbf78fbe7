# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Nothing that enters a result is computed with functions whose last bit depends on the CPU, or on the version of Python."""

import ast
from collections.abc import Iterator
from pathlib import Path
import re

ROOT = Path(__file__).resolve().parents[3]
FILES = sorted([*(ROOT / "scenario_gen").rglob("*.py"), *(ROOT / "msg_conventions").rglob("*.py")])

NUMPY = """
    sin cos tan arcsin arccos arctan arctan2 sinh cosh tanh arcsinh arccosh arctanh exp exp2 expm1 log log2 log10 log1p power
    float_power cbrt hypot sinc angle dot vdot inner matmul tensordot einsum linalg polyfit cov corrcoef convolve correlate
    logaddexp geomspace logspace i0 kaiser hanning hamming blackman
"""  # their loops are chosen by CPU, or the linear-algebra library behind them is
MATH = """
    sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 expm1 log log2 log10 log1p pow cbrt hypot dist
    gamma lgamma erf erfc sumprod
"""  # by the C library
DRAWS = """
    standard_normal normal standard_gamma gamma beta dirichlet exponential standard_exponential multivariate_normal multinomial
    binomial poisson standard_t
"""  # they call the C library's logarithm
FORBIDDEN = {"np": set(NUMPY.split()), "math": set(MATH.split())}
COUNTS = {  # sum() of whole numbers
    "scenario_gen/output/review/evaluation.py",
    "scenario_gen/bags/storage/reindex.py",
    "scenario_gen/method/evaluation/metrics.py",
    "scenario_gen/output/report/page.py",
    "scenario_gen/types/evaluation.py",
    "scenario_gen/output/report/summary.py",
    "scenario_gen/numerics/kernels.py",
    "scenario_gen/logs/parquet.py",
    "scenario_gen/ros/nodes/evaluator.py",
    "scenario_gen/bags/storage/bag.py",
    "scenario_gen/cli/output.py",
    "scenario_gen/closed_loop/bounded.py",
    "scenario_gen/closed_loop/reacting.py",
    "scenario_gen/closed_loop/results.py",
    "scenario_gen/closed_loop/trials.py",
}
EXEMPT = {
    "scenario_gen/method/routing/search/ompl/solve.py": "OMPL's planners are not the same on every machine, and say so",
    "scenario_gen/closed_loop/search/gamma.py": "rounded to nine digits",
}


def is_whole(node: ast.expr) -> bool:
    """Whether an expression is a whole number written out."""
    if isinstance(node, ast.BinOp):
        return is_whole(node.left) and is_whole(node.right)
    if isinstance(node, ast.UnaryOp):
        return is_whole(node.operand)
    return isinstance(node, ast.Constant) and isinstance(node.value, int)


def compiled_lines(tree: ast.Module) -> set[int]:
    """The lines of compiled functions, where a power with a whole exponent is a product."""
    lines: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and any("kernel" in ast.unparse(mark) for mark in node.decorator_list):
            lines |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines


def imports(node: ast.AST) -> Iterator[str]:
    """What the statement takes of scipy, whose solvers are LAPACK's."""
    if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "scipy":
        yield from (f"{node.module}.{a.name}" for a in node.names)
    elif isinstance(node, ast.Import):
        yield from (a.name for a in node.names if a.name.split(".")[0] == "scipy")


def attribute(node: ast.AST) -> Iterator[str]:
    """A function that is fetched by its name."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        name = node.value.id
        if node.attr in FORBIDDEN.get(name, set()) or (node.attr in {*DRAWS.split(), "dot"} and name not in {"exact", "self"}):
            yield f"{name}.{node.attr}"


def operator(node: ast.AST, name: str, compiled: set[int]) -> Iterator[str]:
    """A product of matrices, a power, or a sum whose order the interpreter chooses."""
    if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult):
        yield "@, use exact.matmul"
    elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
        if not (is_whole(node) or (node.lineno in compiled and is_whole(node.right))):
            yield f"{ast.unparse(node)}, use np.square or exact.power"
    elif isinstance(node, ast.Call) and re.match(r"sum\((?!.*(int|len)\()", ast.unparse(node)) and name not in COUNTS:
        yield f"{ast.unparse(node)}, use math.fsum: from Python 3.12 on `sum` adds floats differently"


def faults(name: str, text: str) -> list[str]:
    """Where a file uses what depends on the CPU."""
    tree = ast.parse(text)
    compiled = compiled_lines(tree)
    return [
        f"{name}, line {getattr(node, 'lineno', 0)}: {fault}"
        for node in ast.walk(tree)
        for fault in (*imports(node), *attribute(node), *operator(node, name, compiled))
    ]


def test_what_depends_on_the_cpu_is_not_used():
    files = {path.relative_to(ROOT).as_posix(): path for path in FILES}
    own = {
        name: path for name, path in files.items() if name not in EXEMPT and not name.startswith("scenario_gen/numerics/exact/")
    }
    found = [fault for name, path in own.items() for fault in faults(name, path.read_text())]
    assert not found, "\n".join(found)
    assert len(own) > 200 and faults("a.py", "y = np.sin(x)") == ["a.py, line 1: np.sin"]


def behind_the_door(text: str) -> list[str]:
    """What a file imports from within `scenario_gen.numerics.exact`."""
    names = [node.module or "" for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)]
    names += [alias.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import) for alias in node.names]
    return [name for name in names if name.startswith("scenario_gen.numerics.exact")]


def test_exact_arithmetic_has_one_door():
    outside = [path for path in FILES if "numerics" not in path.relative_to(ROOT).parts]
    found = {path: behind_the_door(path.read_text()) for path in outside}
    assert not {path: names for path, names in found.items() if names}
    assert len(outside) > 200 and behind_the_door("from scenario_gen.numerics.exact.algebra import qr")
