# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the linters look at: everything that is written here, and nothing that is built; what a folder holds."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [
    str(ROOT / name)
    for name in (
        "scenario_gen",
        "msg_conventions",
        "benchmarks",
        "examples",
        "launch",
        "test",
        "setup.py",
    )
]


def python_files() -> list[Path]:
    """Return every Python file of the project."""
    return sorted(
        path
        for source in map(Path, SOURCES)
        for path in (source.rglob("*.py") if source.is_dir() else [source])
    )


def content(folder: Path) -> dict[str, bytes]:
    """Return every file below a folder, by name."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
