# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Turn a handful of recorded vehicle encounters into any number of new, valid ones on other roads.

The public names are listed in `__init__.pyi`. Each is imported when it is first used.

    from scenario_gen import generate, read_log

    (encounter,) = read_log("my_log.csv").encounters
    made = generate(encounter, "t_intersection", count=50, seed=7)
    print(made.evaluation.to_markdown())
"""

from functools import cache
from importlib import import_module
from typing import Any

__version__ = "0.6.0"


@cache
def _modules() -> dict[str, str]:
    """Return the module of each public name."""
    import ast

    with open(f"{__file__}i", encoding="utf-8") as stub:  # noqa: PTH123 - faster than pathlib
        tree = ast.parse(stub.read())
    return {
        alias.name: str(node.module)
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562).

    Raises:
        AttributeError: there is no such name.
    """
    if name == "__all__":
        return [*_modules()]
    if name.startswith("__") or name not in _modules():
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_modules()[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({"__version__", *_modules()})
