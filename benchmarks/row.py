# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""One measured figure."""

from dataclasses import asdict, dataclass
import math
from typing import Any, Literal


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

    @property
    def met(self) -> bool | None:
        """True if the value is at least as good as the target."""
        if self.target is None:
            return None
        return self.value >= self.target if self.better == "higher" else self.value <= self.target

    def document(self) -> dict[str, Any]:
        """Return what stands in the JSON line; null for a value that is not finite, which JSON cannot say."""
        return asdict(self) | {"value": self.value if math.isfinite(self.value) else None, "met": self.met}
