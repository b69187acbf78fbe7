# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Synthetic archives, as `examples/synthetic_archive.py` writes them."""

from dataclasses import dataclass
import json
from pathlib import Path
import subprocess
import sys

SCRIPT = Path(__file__).resolve().parents[1] / "examples" / "synthetic_archive.py"


@dataclass(frozen=True)
class Planted:
    """An encounter in the archive: `threshold` "" or the one that it is close to, `inside` whether it is to be found."""

    kind: str
    devices: tuple[int, ...]
    at: float
    threshold: str
    inside: bool


def write_archive(folder: Path, seed: int = 0, **settings: float) -> Path:
    """Write an archive with settings of `ArchiveConfig`; return its folder."""
    words = [f"--{name.replace('_', '-')}={value}" for name, value in settings.items()]
    subprocess.run(
        [sys.executable, str(SCRIPT), str(folder), f"--seed={seed}", *words],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return folder


def read_planted(folder: Path) -> list[Planted]:
    """Return what is planted in an archive."""
    entries = json.loads((folder / "synthetic.json").read_text(encoding="utf-8"))["planted"]
    return [Planted(**entry | {"devices": tuple(entry["devices"])}) for entry in entries]
