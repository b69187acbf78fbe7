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

"""A million damaged inputs, or ten minutes, for every reader and every type of message: errors of ours, or nothing, come out."""

from collections.abc import Iterator
from pathlib import Path
import sys

from figures import Figure

sys.path.append(str(Path(__file__).resolve().parents[1] / "fuzz"))

from harness import fuzz, MEMORY, SECONDS, targets

EXECUTIONS, MINUTES = 1_000_000, 10.0


def run(state: Path) -> Iterator[Figure]:
    """Fuzz one target after the other; those that are done are not begun again."""
    for name, target in targets().items():
        record = fuzz(target, state, EXECUTIONS, 60.0 * MINUTES)
        found = "; ".join(f"{failure.count} × {failure.signature}" for failure in record.failures.values())
        yield Figure(
            promise=f"{name}: damaged inputs end in errors of ours",
            asked=f"{EXECUTIONS} or {MINUTES:g} min; each ≤ {SECONDS:g} s of CPU and ≤ {MEMORY >> 30} GiB",
            seen=f"{record.executions} in {record.seconds / 60.0:.1f} min: {found or 'nothing else'}",
            met=not record.failures,
        )
