"""One measured figure."""

from dataclasses import dataclass
from typing import Literal


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

    @property
    def met(self) -> bool | None:
        """True if the value is at least as good as the target."""
        if self.target is None:
            return None
        return self.value >= self.target if self.better == "higher" else self.value <= self.target
