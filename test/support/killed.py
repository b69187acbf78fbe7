# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a killed process leaves: a folder of intermediate files."""

from pathlib import Path
from uuid import uuid4

from scenario_gen.base.folders import TEMPORARY


def killed_in(folder: Path) -> None:
    """Leave such a folder in another one, which is created if it is missing."""
    own = folder / f"{TEMPORARY}{uuid4().hex}"
    own.mkdir(parents=True)
    (own / "torn.parquet").write_text("torn")
