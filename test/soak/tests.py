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

"""Every test in its long form: all cases, larger counts, every random example."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
import json
import os
from pathlib import Path
import subprocess
import sys

from figures import Figure

ROOT = Path(__file__).resolve().parents[2]


def passes(state: Path, name: str) -> bool:
    """Run one test file; its output stays in `state`."""
    with (state / f"{name.replace('/', '.')}.log").open("w") as log:
        environment = os.environ | {"SCENARIO_GEN_TESTS": "long"}
        command = [sys.executable, "-m", "pytest", name]
        code = subprocess.run(command, cwd=ROOT, env=environment, stdout=log, stderr=log, check=False).returncode
    return code in (0, 5)  # 5: nothing of it can run here, as test/launch without `launch`


def run(state: Path) -> Iterator[Figure]:
    """Run every test file, two at a time; those that have passed are not run again."""
    files = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "test").rglob("test_*.py"))
    kept = state / "passed.json"
    passed: list[str] = json.loads(kept.read_text()) if kept.exists() else []
    left = [name for name in files if name not in passed]
    with ThreadPoolExecutor(2) as pool:
        for name, good in zip(left, pool.map(partial(passes, state), left), strict=True):
            if good:
                passed.append(name)
                kept.write_text(json.dumps(passed, indent=2) + "\n")
    failed = [name for name in files if name not in passed]
    seen = f"{len(files) - len(failed)} of {len(files)}" + (f"; not {', '.join(failed)}" if failed else "")
    yield Figure("every test in its long form passes", f"{len(files)} files", seen, not failed)
