# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Libraries that read settings from the working directory do not read them.

A command runs beside its data, and the data may come from anybody.
"""

from collections.abc import Iterator
from contextlib import chdir, contextmanager, nullcontext
import os
from pathlib import Path


@contextmanager
def ignored() -> Iterator[None]:
    """Import libraries in this block as if the program were started in the package's folder."""
    with chdir(Path(__file__).parent) if Path().exists() else nullcontext():
        yield


def without_dds_profiles() -> None:
    """Keep Fast DDS from reading the file of profiles in the working directory."""
    os.environ.setdefault("SKIP_DEFAULT_XML_FILE", "1")
