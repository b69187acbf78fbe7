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

"""`make core`: the wheel and the core's locked packages, alone in an environment of their own, segment and generate."""

import json
from pathlib import Path
import re
import subprocess
import sys
import tempfile

from licences import extras, installed, needed_at_run_time, ROOT
from packaging.utils import canonicalize_name
from test_library import EXTRA_MODULES, write_csv


def core_lock() -> str:
    """Return the part of requirements.lock that the core needs, hashes included."""
    needed = needed_at_run_time(installed(), extras()["core"])
    blocks = re.split(r"^(?=\w)", (ROOT / "requirements.lock").read_text(encoding="utf-8"), flags=re.MULTILINE)
    return "".join(block for block in blocks if canonicalize_name(re.split(r"[=\s]", block)[0]) in needed)


def main() -> None:
    """Build, install, run, and say what was seen."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "core.lock").write_text(core_lock(), encoding="utf-8")
        pip = (sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check")
        run(*pip, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, ROOT)
        (wheel,) = folder.glob("*.whl")
        run(sys.executable, "-m", "venv", folder / "env")
        python = folder / "env" / "bin" / "python"
        pip = (python, "-m", "pip", "--quiet", "--disable-pip-version-check")
        run(*pip, "install", "--require-hashes", "-r", folder / "core.lock")
        run(*pip, "install", "--no-deps", wheel)
        run(*pip, "check")
        told = json.loads(run(python, ROOT / "test" / "packaging" / "core_use.py", write_csv(folder / "log.csv")))
        packages = run(python, "-m", "pip", "freeze").split()
    assert told["scenarios"] == 4 and told["same"] and not set(told["loaded"]) & set(EXTRA_MODULES), told
    print(f"{len(packages)} packages: {', '.join(packages)}")
    print(f"{told['scenarios']} scenarios from {len(told['changepoints'])} changepoints")


def run(*command: str | Path) -> str:
    """Run a command, away from the sources; return what it printed."""
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, cwd=tempfile.gettempdir()).stdout


if __name__ == "__main__":
    main()
