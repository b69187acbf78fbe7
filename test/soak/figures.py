# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One row of the table that `make soak` prints: a promise, what was asked and what was seen."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """One promise of docs/reliability.md with the figure seen in this run."""

    promise: str
    asked: str
    seen: str
    met: bool
