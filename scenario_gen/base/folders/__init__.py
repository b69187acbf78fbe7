# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Folders of results.

Complete or not at all, replacing nothing but an earlier result of the same kind.
"""

from scenario_gen.base.folders.disk import naming, sync, sync_tree, write_text
from scenario_gen.base.folders.replace import (
    check_replaceable,
    Kind,
    MARKER,
    replaced_folder,
    sha256_of,
)
from scenario_gen.base.folders.scratch import scratch

__all__ = [
    "MARKER",
    "Kind",
    "check_replaceable",
    "naming",
    "replaced_folder",
    "scratch",
    "sha256_of",
    "sync",
    "sync_tree",
    "write_text",
]
