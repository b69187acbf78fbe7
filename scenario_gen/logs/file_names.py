# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Names that tell the files of a log apart."""

from collections.abc import Sequence
import os
from pathlib import Path


def file_names(paths: Sequence[Path]) -> list[str]:
    """Return names that tell files apart: those of the files, or of the folders that differ."""
    names = [path.stem for path in paths]
    if len(set(names)) == len(names):
        return names
    absolute = [path.resolve() for path in paths]
    common = os.path.commonpath(absolute)
    relative = [path.relative_to(common).with_suffix("") for path in absolute]
    folders = [path.parts[0] for path in relative]
    if len(set(folders)) == len(folders):
        return folders
    return ["_".join(path.parts) for path in relative]
