# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One row of the table that `make soak` prints: a promise, what was asked and what was seen; and how progress is kept."""

from collections.abc import Callable
from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Figure:
    """One promise of docs/project.md with the figure seen in this run."""

    promise: str
    asked: str
    seen: str
    met: bool


def kept(path: Path, make: Callable[[], Any]) -> Any:
    """Return what a JSON file holds; where it is not there yet, its content is made and written."""
    if not path.exists():
        path.write_text(json.dumps(make(), indent=1) + "\n")
    return json.loads(path.read_text())
