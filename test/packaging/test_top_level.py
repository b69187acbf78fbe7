# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What stands at the top of the source tree has its reason; nothing strays there."""

from fnmatch import fnmatch
from pathlib import Path
import subprocess

TOP = Path(__file__).resolve().parents[2]
ALLOWED = {
    ".pre-commit-config.yaml",
    *("package.xml", "setup.py", "setup.cfg", "pyproject.toml", "MANIFEST.in", "Makefile", ".gitignore", ".ci", "requirements*"),
    *("README.md", "CHANGELOG.rst", "CONTRIBUTING.md", "LICENSE", "config", "docs", "examples", "launch", "resource"),
    *("scenario_gen", "scenario_gen_interfaces", "msg_conventions", "test", "benchmarks"),
}
MADE = (".git", ".venv", ".venv-*", ".*_cache", ".hypothesis", "PKG-INFO", ".coverage*")  # beside what .gitignore names


def tracked() -> set[str]:
    """Return the names at the top that git knows; without git all that are there and that no tool makes."""
    if (TOP / ".git").exists():
        listed = subprocess.run(["git", "-C", str(TOP), "ls-files", "-z"], capture_output=True, text=True, check=False)
        if listed.returncode == 0:  # there is a git, and the folder is its user's
            return {name.partition("/")[0] for name in listed.stdout.split("\0") if name}
    ignored = [line.strip("/") for line in (TOP / ".gitignore").read_text().splitlines()] if (TOP / ".gitignore").exists() else []
    made = [*ignored, *MADE]
    return {path.name for path in TOP.iterdir() if not any(fnmatch(path.name, pattern) for pattern in made)}


def test_nothing_strays_at_the_top():
    found = tracked()
    assert {"scenario_gen", "setup.py"} <= found
    assert not {name for name in found if not any(fnmatch(name, pattern) for pattern in ALLOWED)}
