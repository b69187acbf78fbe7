# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a killed process leaves: a folder of intermediate files whose lock nobody holds."""

from pathlib import Path
from uuid import uuid4

from scenario_gen.base.folders.scratch import LOCK, NEW, PREFIX


def killed_in(folder: Path) -> None:
    """Leave such a folder in another one, which is created if it is missing."""
    own = folder / f"{PREFIX}{uuid4().hex}"
    (own / NEW).mkdir(parents=True)
    (own / LOCK).write_text("process 1 on nowhere")
    (own / NEW / "torn.parquet").write_text("torn")
