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

"""What the linters look at: everything that is written here, and nothing that is built."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [
    str(ROOT / name) for name in ("scenario_gen", "msg_conventions", "benchmarks", "examples", "launch", "test", "setup.py")
]


def python_files() -> list[Path]:
    """Return every Python file of the project."""
    return sorted(path for source in map(Path, SOURCES) for path in (source.rglob("*.py") if source.is_dir() else [source]))
