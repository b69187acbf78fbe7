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

"""The bundled log: the paper's three cases (V-A, Fig. 3), made up and named synthetic everywhere (docs/logs.md)."""

from pathlib import Path

CASES = ("a", "b", "c")
RESOURCES = Path(__file__).resolve().parents[1] / "resources"


def bundled(case: str) -> Path:
    """Return the path of the bundled bag of case "a", "b" or "c".

    Raises:
        ValueError: there is no such case.
    """
    if case not in CASES:
        raise ValueError(f"there is no case {case!r}; choose one of {', '.join(CASES)}")
    return RESOURCES / f"synthetic_{case}"
