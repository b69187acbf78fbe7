# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One measured figure."""

from dataclasses import asdict, dataclass
import json
import math
from pathlib import Path
from typing import Any, Literal

MADE: "list[Row]" = []
"""All rows of this process, as they are measured: a benchmark that is stopped keeps what it has."""
FILE: str | None = None
"""Gets each row at once, so that a SIGKILL loses none."""


@dataclass(frozen=True)
class Row:
    """A figure, its target and whether it is met (None where there is no target).

    `peer` names what it was measured against, with the peer's own figure.
    """

    id: str
    value: float
    unit: str
    better: Literal["higher", "lower"]
    target: float | None = None
    peer: str | None = None

    def __post_init__(self) -> None:  # numbers of numpy are no numbers of JSON
        object.__setattr__(self, "value", float(self.value))
        object.__setattr__(self, "target", None if self.target is None else float(self.target))
        MADE.append(self)
        if FILE:
            with Path(FILE).open("a", encoding="utf-8") as file:
                file.write(json.dumps(self.document()) + "\n")

    @property
    def met(self) -> bool | None:
        """True if the value is at least as good as the target."""
        if self.target is None:
            return None
        return self.value >= self.target if self.better == "higher" else self.value <= self.target

    def document(self) -> dict[str, Any]:
        """Return what stands in the JSON line; null for a value that is not finite, which JSON cannot say."""
        return asdict(self) | {
            "value": self.value if math.isfinite(self.value) else None,
            "met": self.met,
        }


def lower(
    id: str,  # noqa: A002
    value: float,
    unit: str = "",
    target: float | None = None,
    peer: str | None = None,
) -> Row:
    """Return a figure that is better when it is lower."""
    return Row(id, value, unit, "lower", target, peer)


def higher(
    id: str,  # noqa: A002
    value: float,
    unit: str = "",
    target: float | None = None,
    peer: str | None = None,
) -> Row:
    """Return a figure that is better when it is higher."""
    return Row(id, value, unit, "higher", target, peer)
