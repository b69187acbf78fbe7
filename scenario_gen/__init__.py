# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Turn a handful of recorded vehicle encounters into any number of new, valid ones on other roads.

The public names are listed in `__init__.pyi`; each is imported when it is first used, so importing the package takes no time.

    from scenario_gen import generate, read_log

    (encounter,) = read_log("my_log.csv").encounters
    made = generate(encounter, "t_intersection", count=50, seed=7)
    print(made.evaluation.to_markdown())
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

__version__ = "0.6.0"

_STUB = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
_MODULE = {alias.name: str(node.module) for node in _STUB.body if isinstance(node, ast.ImportFrom) for alias in node.names}
__all__ = [*_MODULE]  # noqa: PLE0604 - strings all


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562).

    Raises:
        AttributeError: there is no such name.
    """
    if name not in _MODULE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_MODULE[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
